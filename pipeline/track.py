"""The pipeline's border: a track is one run as plain arrays, in SI units."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import TrackError

__all__ = ["F8", "U8", "UNITS", "Quality", "Track"]

F8 = NDArray[np.float64]
U8 = NDArray[np.uint8]

UNITS = {
    "length": "m",
    "angle": "rad",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "acceleration": "m/s^2",
    "force": "N",
    "voltage": "V",
    "number": "1",
}
"""What a track may be of, and the one SI unit that it is then in: `acquisition.block.UNITS`, held equal by a test."""


class Quality(enum.IntFlag):
    """Why a sample may not be taken at face value; the bits of the run file's ``quality``.

    The table of ``acquisition.Flag``, which the pipeline may not import (a test holds them equal), and one more that
    the analysis alone sets: ``OUTSIDE`` the part in which one free oscillation runs.
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
"""Any of these bits keeps a sample out of a fit; a gap before a sample says nothing against it."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One run as arrays.

    Parameters
    ----------
    t : (n,) float64, s
        Time since the start of the run.
    y : (n,) float64
        Distance from the sensor in m, or another quantity in its ``unit``; NaN where unmeasured. What is called ``_m``
        here and in the stages is in that unit.
    flags : (n,) uint8
        Sums of :class:`Quality` bits known before any analysis.
    rate_hz : float
        Nominal samples per second, Hz.
    sigma_m : float or None
        Standard deviation of one distance, m, where somebody knows it; None: estimated from the record.
    quantum_m : float or None
        Smallest step of a distance, m.
    stated_error_m : float or None
        The error column of the file, m, if there is one.
    clock : str
        "nominal", "device" or "host".
    kind : str
        "live", "replay" or "simulated".
    velocity : (n,) float64, m/s, or None
        The velocity that the recording states.
    rate_error, u_rate_error : float or None
        By what share the sensor's clock runs faster than the host's, and the standard uncertainty; None where nobody
        compared the two.
    clock_limit : float or None
        By what share the sensor's clock may be off at most; None where nobody says.
    held_samples : int
        Samples that came later than any jitter explains, in bursts behind a silence: the comparison leaves them out.
    longest_stall_s : float
        By which the latest of them came late, s.
    compared_s : float or None
        Over how long the clocks were compared, s; None: from the first sample to the last.
    speed_of_sound_m_per_s : float or None
        That made distances of echo times, m/s; None where it is not known.
    u_scale : float
        Relative standard uncertainty of the distances' scale from a calibration; 0 where none was made.
    u_offset_m : float
        Standard uncertainty of their zero from a calibration, m; 0 where none was made.
    quantity, unit : str
        What ``y`` holds, of :data:`UNITS`. Only what :meth:`demand_length` guards needs a length.
    trigger_s : float or None
        Moment at which the bob was seen to leave its rest, which began the recording, s; None where nothing waited.

    Raises
    ------
    TrackError
        If the quantity is not of the table, or in another unit.
    """

    t: F8
    y: F8
    flags: U8
    rate_hz: float
    sigma_m: float | None = None
    quantum_m: float | None = None
    stated_error_m: float | None = None
    clock: str = "nominal"
    kind: str = "replay"
    velocity: F8 | None = None
    rate_error: float | None = None
    u_rate_error: float | None = None
    clock_limit: float | None = None
    held_samples: int = 0
    longest_stall_s: float = 0.0
    compared_s: float | None = None
    speed_of_sound_m_per_s: float | None = None
    u_scale: float = 0.0
    u_offset_m: float = 0.0
    quantity: str = "length"
    unit: str = "m"
    trigger_s: float | None = None

    def __post_init__(self) -> None:
        if UNITS.get(self.quantity) != self.unit:
            known = ", ".join(f"{quantity} in {unit}" for quantity, unit in UNITS.items())
            raise TrackError(f"a track holds one of {known}, got {self.quantity} in {self.unit}; convert to SI first")

    def __len__(self) -> int:
        return int(self.t.size)

    def demand_length(self, what: str) -> None:
        """Refuse what is no length where ``what`` needs one.

        Raises
        ------
        TrackError
        """
        if self.quantity != "length":
            raise TrackError(f"{what} needs a length in m, got {self.quantity} in {self.unit}; leave it out")

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
        quantity: str = "length",
        unit: str = "m",
    ) -> Track:
        """Make a track of anything array-like.

        Parameters
        ----------
        t : (n,) array_like, s
            NaN, or infinite, where unknown.
        y : (n,) array_like, m
            NaN where unmeasured.
        rate_hz : float, optional
            Samples per second; left out, it is the reciprocal of the median time step.
        flags : (n,) array_like of int, optional
        sigma_m, quantum_m : float, optional
            As the attributes.
        kind : str
            "live", "replay" or "simulated".
        quantity, unit : str
            What ``y`` holds.

        Raises
        ------
        TrackError
            If the arrays are not one-dimensional or of different lengths, if fewer than two samples are
            there, if the rate, sigma_m or quantum_m is not positive and finite, or if the quantity is none of
            :data:`UNITS`.

        Examples
        --------
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
        if rate_hz is None:
            steps = np.diff(t_s)
            steps = steps[np.isfinite(steps) & (steps > 0)]
            if not steps.size:
                raise TrackError("time never increases, so the rate is unknown: give rate_hz")
            rate_hz = float(np.round(1.0 / np.median(steps), 6))
        # An infinite time is as unknown as one that is no number; only the latter passes through a cosine in silence.
        t_s[~np.isfinite(t_s)] = np.nan
        for name, value in (("rate_hz", rate_hz), ("sigma_m", sigma_m), ("quantum_m", quantum_m)):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise TrackError(f"{name} must be positive and finite, got {value}; leave it out where it is not known")
        return cls(t_s, y_m, bits, float(rate_hz), sigma_m, quantum_m, kind=kind, quantity=quantity, unit=unit)
