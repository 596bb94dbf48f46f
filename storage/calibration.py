"""What the header of a run file and a wire log may say of a calibration: the ranges in which one can be."""

from __future__ import annotations

from acquisition.live.calibration import RANGES
from storage.checked import Number, Table

__all__ = ["CALIBRATION_RULE"]

CALIBRATION_RULE = Table(
    may={
        "speed_of_sound_m_per_s": Number(100.001, 1999.999),  # the ends themselves are refused by a calibration
        **{name: Number(low, high) for name, (low, high) in RANGES.items()},
    }
)
