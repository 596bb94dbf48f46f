"""Simulated records for the trade, and the Cramér-Rao bounds of what is in them; shares no code with any estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Truth", "bounds", "record"]

F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """A free oscillation with linear drag, in white noise: :math:`y = o + A e^{-\\gamma t}\\cos(2\\pi f t + \\varphi)`.

    Parameters
    ----------
    seconds, rate_hz : float
    noise_m : float
        Standard deviation of one distance, m.
    frequency_hz, amplitude_m, damping_per_s, offset_m : float
    echoes : float
        Share of samples that are false echoes: anywhere up to 2 m.
    """

    seconds: float = 120.0
    rate_hz: float = 100.0
    noise_m: float = 3e-4
    frequency_hz: float = 1.3183
    amplitude_m: float = 0.05
    damping_per_s: float = 0.01463
    offset_m: float = 0.22
    echoes: float = 0.0

    @property
    def times(self) -> F8:
        """Sample times, (n,) float64, s."""
        return np.arange(round(self.seconds * self.rate_hz)) / self.rate_hz


def record(truth: Truth, rng: np.random.Generator) -> F8:
    """Return one record at ``truth.times``, (n,) float64, m; its phase is drawn too."""
    t = truth.times
    phase = rng.uniform(-math.pi, math.pi)
    swing = truth.amplitude_m * np.exp(-truth.damping_per_s * t) * np.cos(2 * math.pi * truth.frequency_hz * t + phase)
    y = truth.offset_m + swing + truth.noise_m * rng.standard_normal(t.size)
    false = rng.random(t.size) < truth.echoes
    y[false] = rng.uniform(0.0, 2.0, np.count_nonzero(false))
    return np.asarray(y)


def bounds(truth: Truth) -> dict[str, float]:
    """Return the least standard deviations of any unbiased estimate, by name, in SI units.

    Parameters
    ----------
    truth : Truth

    Returns
    -------
    dict
        frequency (Hz), amplitude at t = 0 (m), damping_rate (1/s), all unknown, with phase and offset. A method that
        takes an undamped motion for granted knows more, and may fall below the amplitude's bound.

    Notes
    -----
    The inverse Fisher information of (o, A, phase, f, gamma) in white noise, averaged over the phase. False echoes
    are counted out: samples that are one tell nothing.
    """
    t = truth.times
    decay = np.exp(-truth.damping_per_s * t)
    variances = []
    for phase in np.linspace(-math.pi, math.pi, 9)[:-1]:
        angle = 2 * math.pi * truth.frequency_hz * t + phase
        cosine, sine = decay * np.cos(angle), decay * np.sin(angle)
        columns = [cosine, -2 * math.pi * truth.amplitude_m * t * sine, -truth.amplitude_m * sine, np.ones(t.size)]
        columns.append(-truth.amplitude_m * t * cosine)
        design = np.stack(columns, axis=1)
        norms = np.linalg.norm(design, axis=0)
        inverse = np.linalg.inv((design / norms).T @ (design / norms))
        variances.append(np.diag(inverse) / norms**2)
    u = truth.noise_m / math.sqrt(1.0 - truth.echoes) * np.sqrt(np.mean(variances, axis=0))
    return {"frequency": float(u[1]), "amplitude": float(u[0]), "damping_rate": float(u[4])}
