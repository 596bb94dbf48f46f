"""DFRobot SEN0149, SEN0150 (URM06, RS-485, UART): polled, frames ``55 AA address length command H L SUM``.

Command 2 requests the distance in mm: the reply ``55 AA 11 02 02 12 34 5A`` is 4660 mm, and FF FF means out of range.
Command 3 requests the temperature; logs of 0.2.0 may contain replies to it, which are skipped.
"""

from __future__ import annotations

from acquisition.decoders.family import Family, Poll
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.sum_frames import SumFrames, with_sum
from acquisition.readings import NAN, Reading

_DISTANCE, _TEMPERATURE = 0x02, 0x03
_INVALID = 0xFFFF
_FARTHEST_MM = 12_000


def _plausible(frame: bytes) -> bool:
    """Return whether a frame can be a reply of the sensor, whose address may have any value."""
    value = frame[5] << 8 | frame[6]
    if frame[1] != 0xAA or frame[3] != 2:
        return False
    return frame[4] == _TEMPERATURE or (frame[4] == _DISTANCE and (value <= _FARTHEST_MM or value == _INVALID))


class Sen0149Decoder(FramedDecoder):
    """Decodes replies."""

    def __init__(self, temperature_every: int = 0) -> None:
        super().__init__(SumFrames(8, b"\x55", _plausible))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a distance reply."""
        if frame[4] == _TEMPERATURE:
            return None
        mm = frame[5] << 8 | frame[6]
        return Reading(host_ns, distance_m=NAN if mm in (0, _INVALID) else mm / 1000)


FAMILY = Family(
    name="sen0149",
    title="SEN0149, SEN0150 (URM06) frames 55 AA address length command H L SUM",
    baud=19200,
    rate_hz=10.0,
    resolution_m=1e-3,
    range_m=(0.2, 10.0),
    limits="Nothing nearer than 20 cm, and one request at a time on the bus.",
    decoder=Sen0149Decoder,
    poll=Poll(request=with_sum(bytes([0x55, 0xAA, 0x11, 0, _DISTANCE])), interval_s=0.1, timeout_s=0.25, reply_bytes=8),
    past_options=("temperature_every",),
    source="DFRobot SEN0149, SEN0150: communication protocol",
)
