"""Residuals: the difference of every sample from its window's fit, as input of the checks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.select import Damping
from pipeline.motion.averaged import Phase
from pipeline.samples.condition import Conditioned
from pipeline.track import F8, UNUSABLE
from pipeline.windows.demodulate import Demodulated
from pipeline.windows.disturbances import Disturbances

FEWEST = 64  # minimum number of samples: four in each of the sixteen parts in which harmonics are compared


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Residuals of the windows' fits.

    Parameters
    ----------
    values : (k,) float64, m
        Residuals of the samples used; they still contain the harmonics that the model includes.
    phase : (k,) float64, rad
        Phase of the oscillation at these samples.
    used : (n,) bool
        Whether each sample of the record was used.
    noise_m, amplitude_m : float
        Standard deviation of one sample, and mean amplitude.
    interval_s, seconds : float
        Mean time between samples, and time from the first to the last sample used.
    radians_per_sample : float
        Increase of the phase from sample to sample.
    samples_per_window : int
    relative : (k,) float64 or None
        Amplitude of the oscillation at these samples over that at the first of them; None if this cannot be calculated.
    """

    values: F8
    phase: F8
    used: NDArray[np.bool_]
    noise_m: float
    amplitude_m: float
    interval_s: float
    seconds: float
    radians_per_sample: float
    samples_per_window: int
    relative: F8 | None = None

    @property
    def on_grid(self) -> F8:
        """The residuals of all samples, (n,) float64, m; 0 for samples that were not used."""
        whole = np.zeros(self.used.size)
        whole[self.used] = self.values
        return whole

    def less(self, taken_m: F8) -> Residuals:
        """Return the residuals after subtraction of a signal (k,), m."""
        return replace(self, values=self.values - taken_m)


def residuals_of(
    conditioned: Conditioned, demodulated: Demodulated, disturbances: Disturbances, damping: Damping, phase: Phase
) -> Residuals | None:
    """Return the residuals of a run; None if it has too few samples for the checks.

    Parameters
    ----------
    conditioned, demodulated, disturbances, phase
        Outputs of the stages with the same names.
    """
    t = conditioned.track.t
    used = ((demodulated.flags & UNUSABLE) == 0) & np.isfinite(demodulated.residual)
    rows = np.flatnonzero(used)
    seconds = float(t[rows[-1]] - t[rows[0]]) if rows.size else 0.0
    if rows.size < FEWEST or seconds <= 0.0:
        return None
    values = demodulated.residual[rows]
    locked = tuple(mode for mode in disturbances.sideways.modes if mode.kind == "harmonic")
    if disturbances.modelled and locked:
        values = values + replace(disturbances.sideways, modes=locked).position(t[rows])
    step = seconds / int(rows[-1] - rows[0])
    size = np.abs(damping.best.amplitude(np.maximum(t[rows] - phase.t0, 0.0)))
    falls = bool(np.isfinite(size).all() and size[0] > 0.0)
    return Residuals(
        values,
        phase.total(t[rows]),
        used,
        demodulated.noise_m,
        float(np.mean(np.abs(demodulated.amplitude))),
        step,
        seconds,
        phase.angular_frequency.value * step,
        rows.size // demodulated.t.size,
        size / size[0] if falls else None,
    )
