"""FF H L SUM: the waterproof modules of many names that send four bytes by themselves.

A02YYUW, ME007YS, A01NYUB, DYP-A01/A02/ME007, and the JSN-SR04T in its serial mode: 0xFF, distance in mm as high and
low byte, sum. ``FF 07 A1 A7`` is 1953 mm. 0 means no target, as do FFFD (none in range) and FFFE (disturbed by another
sensor) of the newer DYP modules.
"""

from __future__ import annotations

import math

from acquisition.decoders.family import Family
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.sum_frames import SumFrames, with_sum
from acquisition.readings import NAN, Reading

__all__ = ["FAMILY", "FfhlsDecoder", "FfhlsEncoder"]

FARTHEST_MM = 10_000
"""Beyond the range of every module of the family. So H is never 0xFF, and the header is unambiguous."""

_NO_TARGET = (0, 0xFFFD, 0xFFFE)


def _value(frame: bytes) -> int:
    return frame[1] << 8 | frame[2]


def _plausible(frame: bytes) -> bool:
    return _value(frame) <= FARTHEST_MM or _value(frame) in _NO_TARGET


class FfhlsDecoder(FramedDecoder):
    """Decodes FF H L SUM."""

    def __init__(self) -> None:
        super().__init__(SumFrames(4, b"\xff", _plausible))

    def reading(self, host_ns: int, frame: bytes) -> Reading:
        """Return a frame's distance."""
        mm = _value(frame)
        return Reading(host_ns, distance_m=NAN if mm in _NO_TARGET else mm / 1000)


class FfhlsEncoder:
    """Writes FF H L SUM."""

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one frame; it contains only the distance, to 1 mm."""
        mm = 0 if math.isnan(distance_m) else round(distance_m * 1000)
        return with_sum(b"\xff" + (mm if 0 <= mm <= FARTHEST_MM else 0).to_bytes(2, "big"))


FAMILY = Family(
    name="ffhls",
    title="FF-H-L-SUM frames (A02YYUW, ME007YS, A01NYUB, DYP modules, JSN-SR04T in serial mode)",
    baud=9600,
    rate_hz=10.0,
    resolution_m=1e-3,
    range_m=(0.03, 4.5),
    limits="10 Hz at most, and only with the module's pin set to real-time output: the processed output is averaged.",
    decoder=FfhlsDecoder,
    encoder=FfhlsEncoder,
    source="DFRobot SEN0311 (A02YYUW), SEN0312 (ME007YS), SEN0313 (A01NYUB): UART output; DYP-A22 data sheet",
)
