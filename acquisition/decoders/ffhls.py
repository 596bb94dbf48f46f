"""FF H L SUM: frames of four bytes that waterproof modules of many names send without requests.

The modules are the A02YYUW, ME007YS, A01NYUB, DYP-A01/A02/ME007, and the JSN-SR04T in its serial mode. A frame consists
of 0xFF, the high and low byte of the distance in mm, and the sum of these three bytes: ``FF 07 A1 A7`` is 1953 mm. The
value 0 means no target, as do the codes FFFD (no target in range) and FFFE (disturbed by another sensor) of the newer
DYP modules.
"""

from __future__ import annotations

from acquisition.decoders.family import Family
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.sum_frames import SumFrames
from acquisition.readings import NAN, Reading

FARTHEST_MM = 10_000
"""Maximum distance of a valid frame, mm: beyond the range of every module, but with a high byte other than 0xFF."""

_NO_TARGET = (0, 0xFFFD, 0xFFFE)


def _plausible(frame: bytes) -> bool:
    mm = frame[1] << 8 | frame[2]
    return mm <= FARTHEST_MM or mm in _NO_TARGET


class FfhlsDecoder(FramedDecoder):
    """Decodes FF H L SUM."""

    def __init__(self) -> None:
        super().__init__(SumFrames(4, b"\xff", _plausible))

    def reading(self, host_ns: int, frame: bytes) -> Reading:
        """Return the reading of a frame."""
        mm = frame[1] << 8 | frame[2]
        return Reading(host_ns, distance_m=NAN if mm in _NO_TARGET else mm / 1000)


FAMILY = Family(
    name="ffhls",
    title="FF-H-L-SUM frames (A02YYUW, ME007YS, A01NYUB, DYP modules, JSN-SR04T in serial mode)",
    baud=9600,
    rate_hz=10.0,
    resolution_m=1e-3,
    range_m=(0.03, 4.5),
    limits="10 Hz at most, and only with the module's pin set to real-time output: the processed output is averaged.",
    decoder=FfhlsDecoder,
    source="DFRobot SEN0311 (A02YYUW), SEN0312 (ME007YS), SEN0313 (A01NYUB): UART output; DYP-A22 data sheet",
)
