"""DFRobot URM37 (SEN0001): a polled sensor with frames of a command, two data bytes and a sum.

The request ``22 00 00 22`` returns the distance in cm (reply ``22 H L SUM``); the value FF FF is invalid. The request
``11 00 00 11`` returns the temperature; logs of 0.2.0 may contain replies to it, which are skipped.
"""

from __future__ import annotations

from acquisition.decoders.family import Family, Poll
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.sum_frames import SumFrames
from acquisition.readings import NAN, Reading

_DISTANCE, _TEMPERATURE = 0x22, 0x11
_INVALID = 0xFFFF
_FARTHEST_CM = 1000


def _plausible(frame: bytes) -> bool:
    value = frame[1] << 8 | frame[2]
    # A temperature has twelve bits, and its upper four are all 1 below zero.
    possible = value <= _FARTHEST_CM if frame[0] == _DISTANCE else value >> 12 in (0x0, 0xF)
    return possible or value == _INVALID


class Urm37Decoder(FramedDecoder):
    """Decodes replies."""

    def __init__(self, temperature_every: int = 0) -> None:
        super().__init__(SumFrames(4, bytes([_DISTANCE, _TEMPERATURE]), _plausible))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a distance reply."""
        if frame[0] == _TEMPERATURE:
            return None
        cm = frame[1] << 8 | frame[2]
        # The transducer cannot measure a distance of 0, so the value 0 means no target, like FF FF.
        return Reading(host_ns, distance_m=NAN if cm in (0, _INVALID) else cm / 100)


FAMILY = Family(
    name="urm37",
    title="URM37 (SEN0001) replies of command, two bytes, sum",
    baud=9600,
    rate_hz=10.0,
    resolution_m=1e-2,
    range_m=(0.02, 8.0),
    limits="Steps of 1 cm and 10 Hz: enough to see an oscillation of 10 cm, not to measure its damping.",
    decoder=Urm37Decoder,
    poll=Poll(request=bytes([_DISTANCE, 0, 0, _DISTANCE]), interval_s=0.1, timeout_s=0.25, reply_bytes=4),
    past_options=("temperature_every",),
    source="DFRobot SEN0001 (URM37): communication protocol",
)
