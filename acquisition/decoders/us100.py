"""US-100: a polled sensor whose replies have neither a header nor a checksum.

The request 0x55 returns the distance in mm (high byte, low byte). A surplus or missing byte shifts every later reply.
Three rules keep the decoder synchronised:

- The reader flushes after a time-out, and before a request if a part of a reply has come.
- A distance outside 20 to 4500 mm is a missing sample. When the decoder is shifted by one byte, the low byte takes the
  place of the high byte, and 14 of 15 readings are outside that range.
- Two consecutive readings may be out of range but give a distance in range if they are read one byte later. Then one
  byte is skipped and counted as ``resynchronised``.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from acquisition.decoders.decoder import Decoder
from acquisition.decoders.sensor import Poll, Sensor
from acquisition.errors import SensorError
from acquisition.readings import NAN, Reading, Readings

_NEAREST_MM, _FARTHEST_MM = 20, 4500


def _in_range(high: int, low: int) -> bool:
    return _NEAREST_MM <= (high << 8 | low) <= _FARTHEST_MM


class Us100Decoder(Decoder):
    """Decodes US-100 replies.

    In logs of 0.2.0, one byte with a temperature may follow every ``temperature_every`` distances; it is skipped.
    """

    def __init__(self, temperature_every: int = 0) -> None:
        if not str(temperature_every).isdecimal():
            raise SensorError(f"temperature_every must be a whole number from 0, got {temperature_every!r}")
        self._every = int(temperature_every)
        self._distances = 0  # since the last temperature
        self._faults = {"garbage_bytes": 0, "resynchronised": 0}
        self._held = b""
        self._odd_low: int | None = None  # low byte of the last reply if its distance was out of range, else None

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of faults, by name; a distance out of range is not a fault but a missing sample."""
        return MappingProxyType(self._faults)

    @property
    def pending(self) -> int:
        """Number of bytes of an incomplete reply."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the readings of the replies that the bytes complete."""
        data = self._held + data
        readings: list[Reading] = []
        at, size = 0, len(data)
        while at < size:
            if 0 < self._every <= self._distances:
                self._distances, self._odd_low = 0, None
                at += 1
            elif at + 1 < size:
                high, low = data[at], data[at + 1]
                readings.append(Reading(host_ns, distance_m=(high << 8 | low) / 1000 if _in_range(high, low) else NAN))
                self._distances += 1
                at += 2 - self._slips(high, low)
            else:
                break
        self._held = data[at:]
        return Readings(readings)

    def flush(self) -> None:
        """Discard an incomplete reply."""
        self._faults["garbage_bytes"] += len(self._held)
        self._held, self._odd_low, self._distances = b"", None, 0

    def _slips(self, high: int, low: int) -> int:
        """Return 1 if this low byte must be the high byte of the next reply, else 0."""
        before = self._odd_low
        self._odd_low = None if _in_range(high, low) else low
        if before is None or self._odd_low is None or not _in_range(before, high):
            return 0
        self._odd_low = None
        self._faults["resynchronised"] += 1
        return 1


FAMILY = Sensor(
    name="us100",
    title="US-100 in serial mode (two bytes a distance, no header, no checksum)",
    baud=9600,
    rate_hz=20.0,
    resolution_m=1e-3,
    range_m=(_NEAREST_MM / 1000, _FARTHEST_MM / 1000),
    limits="No checksum: a changed or lost byte may give a wrong reading before it is detected.",
    decoder=Us100Decoder,
    poll=Poll(request=b"\x55", interval_s=0.05, timeout_s=0.15, reply_bytes=2),
    past_options=("temperature_every",),
    self_framing=False,
    source="US-100 data sheet (serial mode); Adafruit 4019",
)
