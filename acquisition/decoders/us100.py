"""US-100: a polled sensor whose replies have neither a header nor a checksum.

The request 0x55 returns the distance in mm (high byte, low byte), the request 0x50 the temperature (one byte, the
temperature in degC plus 45). Only the request determines what the bytes mean, so a surplus or missing byte shifts every
later reply: in one case this gave a temperature of -44 degC. Three rules keep the decoder synchronised:

- The reader flushes after a time-out, and before a request if bytes are ``pending``.
- A distance outside 20 to 4500 mm is a missing sample. When the decoder is shifted by one byte, the low byte takes the
  place of the high byte, and 14 of 15 readings are outside that range.
- Two consecutive readings may be out of range but give a distance in range if they are read one byte later. Then one
  byte is skipped and counted as ``resynchronised``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from acquisition.decoders.cycle import OPTIONS, Cycle, PolledEncoder
from acquisition.decoders.family import Family, Poll
from acquisition.readings import NAN, Reading, Readings

__all__ = ["FAMILY", "Us100Decoder"]

_ASK_DISTANCE, _ASK_TEMPERATURE = b"\x55", b"\x50"
_NEAREST_MM, _FARTHEST_MM = 20, 4500
_COLDEST_C, _HOTTEST_C = -20, 70


def _in_range(high: int, low: int) -> bool:
    return _NEAREST_MM <= (high << 8 | low) <= _FARTHEST_MM


class Us100Decoder:
    """Decodes US-100 replies; a temperature is added to the next distance reading.

    Parameters
    ----------
    temperature_every : int
        Number of distances between two temperatures; 0 for no temperatures. Temperatures need a reader that sends
        the bytes of :attr:`request`.
    """

    def __init__(self, temperature_every: int = 0) -> None:
        self._cycle = Cycle(_ASK_DISTANCE, _ASK_TEMPERATURE, temperature_every)
        self._faults = {"garbage_bytes": 0, "bad_temperature": 0, "resynchronised": 0}
        self._held = b""
        self._celsius = NAN
        self._odd_low: int | None = None  # low byte of the last reply if its distance was out of range, else None

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of faults, by name; a distance out of range is not a fault but a missing sample."""
        return MappingProxyType(self._faults)

    @property
    def pending(self) -> int:
        """Number of bytes of an incomplete reply; it should be 0 when a request is due."""
        return len(self._held)

    @property
    def request(self) -> bytes:
        """The next request."""
        return self._cycle.request

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the readings of the replies that the bytes complete."""
        data = self._held + data
        readings: list[Reading] = []
        at, size = 0, len(data)
        while at < size:
            if self._cycle.wants_temperature:
                self._take_temperature(data[at])
                at += 1
            elif at + 1 < size:
                distance_m = self._distance(data[at], data[at + 1])
                readings.append(Reading(host_ns, distance_m=distance_m, temperature_c=self._celsius))
                self._celsius = NAN
                at += 2 - self._slips(data[at], data[at + 1])
            else:
                break
        self._held = data[at:]
        return Readings(readings)

    def flush(self) -> None:
        """Discard an incomplete reply; the next request is for a distance."""
        self._faults["garbage_bytes"] += len(self._held)
        self._held = b""
        self._odd_low = None
        self._cycle.restart()

    def _take_temperature(self, byte: int) -> None:
        self._cycle.answered(temperature=True)
        self._odd_low = None
        celsius = byte - 45
        if _COLDEST_C <= celsius <= _HOTTEST_C:
            self._celsius = float(celsius)
        else:
            self._faults["bad_temperature"] += 1

    def _distance(self, high: int, low: int) -> float:
        self._cycle.answered(temperature=False)
        return (high << 8 | low) / 1000 if _in_range(high, low) else NAN

    def _slips(self, high: int, low: int) -> int:
        """Return 1 if this low byte must be the high byte of the next reply, else 0."""
        before = self._odd_low
        self._odd_low = None if _in_range(high, low) else low
        if before is None or self._odd_low is None or not _in_range(before, high):
            return 0
        self._odd_low = None
        self._faults["resynchronised"] += 1
        return 1


def _distance_reply(distance_m: float) -> bytes:
    mm = 0 if math.isnan(distance_m) else round(distance_m * 1000)
    return (mm if _in_range(0, mm) else 0).to_bytes(2, "big")


def _temperature_reply(temperature_c: float) -> bytes:
    celsius = 0.0 if math.isnan(temperature_c) else temperature_c
    return bytes([min(max(round(celsius) + 45, 0), 255)])


def _encoder(temperature_every: int = 0) -> PolledEncoder:
    return PolledEncoder(Cycle(_ASK_DISTANCE, _ASK_TEMPERATURE, temperature_every), _distance_reply, _temperature_reply)


FAMILY = Family(
    name="us100",
    title="US-100 in serial mode (two bytes a distance, no header, no checksum)",
    baud=9600,
    rate_hz=20.0,
    resolution_m=1e-3,
    range_m=(_NEAREST_MM / 1000, _FARTHEST_MM / 1000),
    limits="No checksum: a changed or lost byte may give a wrong reading before it is detected.",
    decoder=Us100Decoder,
    encoder=_encoder,
    poll=Poll(request=_ASK_DISTANCE, interval_s=0.05, timeout_s=0.15),
    options=OPTIONS,
    self_framing=False,
    source="US-100 data sheet (serial mode); Adafruit 4019",
)
