"""FF H L SUM: the waterproof modules of many names that send four bytes by themselves.

A02YYUW, ME007YS, A01NYUB, DYP-A01/A02/ME007, and the JSN-SR04T in its serial mode: 0xFF, distance in mm as high and
low byte, sum. ``FF 07 A1 A7`` is 1953 mm. 0 says no target, and so do FFFD (none in range) and FFFE (disturbed by
another sensor) of the newer DYP modules.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from acquisition.decoders.family import Family
from acquisition.decoders.rows import NAN, rows
from acquisition.decoders.sum_frames import SumFrames, with_sum
from acquisition.readings import Readings

__all__ = ["FAMILY", "FfhlsDecoder", "FfhlsEncoder"]

FARTHEST_MM = 10_000
"""No module of the family reaches it; keeps 0xFF out of H, which makes the header unmistakable."""

_NO_TARGET = (0, 0xFFFD, 0xFFFE)


def _value(frame: bytes) -> int:
    return frame[1] << 8 | frame[2]


def _plausible(frame: bytes) -> bool:
    return _value(frame) <= FARTHEST_MM or _value(frame) in _NO_TARGET


class FfhlsDecoder:
    """Decodes FF H L SUM."""

    def __init__(self) -> None:
        self._frames = SumFrames(4, b"\xff", _plausible)

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what was no reading."""
        return MappingProxyType(self._frames.faults)

    @property
    def pending(self) -> int:
        """Bytes held until the frame they began is whole."""
        return self._frames.pending

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the distances whose frames these bytes complete."""
        values = [frame[1] << 8 | frame[2] for frame in self._frames.split(data)]
        return rows(host_ns, distance_m=[NAN if mm in _NO_TARGET else mm / 1000 for mm in values])

    def flush(self) -> None:
        """Forget a half-received frame."""
        self._frames.flush()


class FfhlsEncoder:
    """Writes FF H L SUM."""

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one frame; it carries the distance alone, to 1 mm."""
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
