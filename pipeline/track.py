"""The input of the pipeline: a track is one run as plain arrays, in SI units."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import TrackError
from pipeline.units import RECORDED_UNITS

F8 = NDArray[np.float64]
U8 = NDArray[np.uint8]
C16 = NDArray[np.complex128]
Bools = NDArray[np.bool_]


class Quality(enum.IntFlag):
    """Reasons to distrust a sample; the bits of ``quality`` in the run file.

    The bits are those of ``acquisition.Flag``, which the pipeline may not import (a test keeps them equal), and one
    that only the analysis sets: ``OUTSIDE``, for samples outside the part with one free oscillation.
    """

    MISSING = 1
    FALSE_ECHO = 2
    CLIPPED = 4
    DUPLICATE_TIME = 8
    NON_MONOTONIC_TIME = 16
    MALFORMED = 32
    GAP_BEFORE = 64
    OUTSIDE = 128


UNUSABLE = ~np.uint8(Quality.GAP_BEFORE)
"""The bits that exclude a sample from fits: all but ``GAP_BEFORE``, which does not affect the sample itself."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One run as arrays; names that end in ``_m``, here and in the stages, are in ``unit``."""

    t: F8  # (n,) s, since the start of the run
    y: F8  # (n,) distance from the sensor in m, or another quantity in ``unit``; NaN where unmeasured
    flags: U8  # (n,) sums of the :class:`Quality` bits known before the analysis
    rate_hz: float  # nominal sampling rate
    sigma_m: float | None = None  # standard deviation of one distance; None if it must be estimated from the record
    quantum_m: float | None = None  # resolution of the distances
    stated_error_m: float | None = None  # from the error column of the file
    clock: str = "nominal"  # or "device" or "host"
    kind: str = "replay"  # or "live" or "simulated"
    velocity: F8 | None = None  # (n,) m/s, from the recording
    # Relative amount by which the sensor's clock runs faster than the host's; None if the two were not compared.
    rate_error: float | None = None
    u_rate_error: float | None = None
    clock_limit: float | None = None  # maximum relative rate error of the sensor's clock
    u_clock: float | None = None  # relative standard uncertainty of the clock's rate, from a bound that was stated
    clock_rate: tuple[float, float] | None = None  # stated relative rate error of the clock (positive: fast), and its u
    # Samples that came in bursts after a stall, later than jitter explains; the comparison of the clocks excludes them.
    held_samples: int = 0
    longest_stall_s: float = 0.0
    u_rate: float = 0.0  # relative standard uncertainty of the rate of times that follow from arrivals
    misplaced_s: float = 0.0  # by which samples may be early or late up to the next one that was lost
    compared_s: float | None = None  # duration of the comparison of the clocks; None for the whole recording
    speed_of_sound_m_per_s: float | None = None  # with which echo times were converted to distances
    sonic: bool = False  # whether the distances are those of echoes, whose scale changes with the air
    u_scale: float = 0.0  # relative standard uncertainty of a calibrated scale; 0 without a calibration
    u_offset_m: float = 0.0  # standard uncertainty of a calibrated zero
    unit: str = "m"  # of :data:`pipeline.units.RECORDED_UNITS`
    trigger_s: float | None = None  # when the trigger saw the bob leave its rest and started the recording

    def __post_init__(self) -> None:
        if self.unit not in RECORDED_UNITS:
            known = ", ".join(f"{recorded.quantity} in {unit}" for unit, recorded in RECORDED_UNITS.items())
            raise TrackError(f"a track holds one of {known}, got the unit {self.unit}", "convert to SI first")
        for name in ("u_scale", "u_offset_m", "u_rate", "misplaced_s", "clock_limit", "compared_s"):
            if (value := getattr(self, name)) is not None and not (math.isfinite(value) and value >= 0.0):
                raise TrackError(f"{name} must be finite and not negative, got {value:g}", "leave it out")
        if self.speed_of_sound_m_per_s is not None:  # only echoes have one
            object.__setattr__(self, "sonic", True)

    def __len__(self) -> int:
        return int(self.t.size)

    def demand_length(self, what: str) -> None:
        """Raise an error if the track is no length, which ``what`` needs."""
        if self.unit != "m":
            quantity = RECORDED_UNITS[self.unit].quantity
            raise TrackError(f"{what} needs a length in m, got {quantity} in {self.unit}", "leave it out")

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        y: ArrayLike,
        *,
        rate_hz: float | None = None,
        flags: ArrayLike | None = None,
        sigma_m: float | None = None,
        quantum_m: float | None = None,
        kind: str = "replay",
        unit: str = "m",
    ) -> Track:
        """Make a track from array-like objects.

        >>> track = Track.from_arrays([0.0, 0.01, 0.02], [0.2, 0.21, float("nan")])
        >>> track.rate_hz, len(track)
        (100.0, 3)
        """
        t_s, y_m = np.array(t, np.float64), np.array(y, np.float64)
        if t_s.ndim != 1 or t_s.shape != y_m.shape:
            raise TrackError(f"t and y must be one-dimensional and of one length, got {t_s.shape} and {y_m.shape}")
        bits = np.zeros(t_s.size, np.uint8) if flags is None else np.array(flags, np.uint8)
        if bits.shape != t_s.shape:
            raise TrackError(f"flags must have the shape of t, {t_s.shape}, got {bits.shape}")
        if t_s.size < 2:
            raise TrackError(f"a track needs two samples at least, got {t_s.size}")
        # An infinite time is as unknown as NaN, but only NaN passes through differences and cosines without a warning.
        t_s[~np.isfinite(t_s)] = np.nan
        if rate_hz is None:
            with np.errstate(over="ignore"):
                steps = np.diff(t_s)
                steps = steps[np.isfinite(steps) & (steps > 0)]
                rate_hz = float(np.round(1.0 / np.median(steps), 6)) if steps.size else None
            if rate_hz is None:
                raise TrackError(
                    "time never increases, so the rate is unknown", "give the samples in the order of their times"
                )
        for name, value in (("rate_hz", rate_hz), ("sigma_m", sigma_m), ("quantum_m", quantum_m)):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise TrackError(
                    f"{name} must be positive and finite, got {value}", "leave it out where it is not known"
                )
        return cls(t_s, y_m, bits, float(rate_hz), sigma_m, quantum_m, kind=kind, unit=unit)
