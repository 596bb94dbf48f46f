"""Simulated records for the trade and the Cramér-Rao bounds of their parameters; shares no code with any estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["HOSTILE", "Truth", "bounds", "record"]

F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """A free oscillation in white noise, :math:`y = o + A(t)\\cos(2\\pi f t + \\varphi)`, and its disturbances.

    With linear drag :math:`A(t) = A e^{-\\gamma t}`; with additional quadratic drag,
    :math:`dA/dt = -\\gamma A - \\beta A^2`,
    the amplitude is :math:`A e^{-\\gamma t} / (1 + \\beta A (1 - e^{-\\gamma t}) / \\gamma)`.

    Parameters
    ----------
    seconds, rate_hz : float
    noise_m : float
        Standard deviation of one distance, m.
    frequency_hz, amplitude_m, damping_per_s, offset_m : float
    echoes : float
        Fraction of samples that are false echoes, at random distances up to 2 m.
    quadratic_per_m_s : float
        Quadratic drag, 1/(m s).
    clip_m : float
        Displacement beyond which crests are cut off, m.
    drift_m : float
        Change of the rest position within the record, m.
    sideways_m : float
        Amplitude of a second mode at six tenths of the frequency, m.
    quantum_m : float
        Smallest step of a distance, m; 0 for none.
    """

    seconds: float = 120.0
    rate_hz: float = 100.0
    noise_m: float = 3e-4
    frequency_hz: float = 1.3183
    amplitude_m: float = 0.05
    damping_per_s: float = 0.01463
    offset_m: float = 0.22
    echoes: float = 0.0
    quadratic_per_m_s: float = 0.0
    clip_m: float = math.inf
    drift_m: float = 0.0
    sideways_m: float = 0.0
    quantum_m: float = 0.0

    @property
    def damping_rate(self) -> float:
        """Damping rate at the start, -(dA/dt)/A, 1/s."""
        return self.damping_per_s + self.quadratic_per_m_s * self.amplitude_m

    @property
    def times(self) -> F8:
        """Sample times in s, (n,) float64."""
        return np.arange(round(self.seconds * self.rate_hz)) / self.rate_hz


HOSTILE = {
    "clean, one exponential": Truth(seconds=60.0),
    "1.6 periods": Truth(seconds=1.2),
    "3 periods": Truth(seconds=2.3),
    "-10 dB": Truth(seconds=60.0, noise_m=0.05 / math.sqrt(2.0) * 10**0.5),
    "5 % false echoes": Truth(seconds=60.0, echoes=0.05),
    "20 % false echoes": Truth(seconds=60.0, echoes=0.2),
    "crests clipped at 80 %": Truth(seconds=60.0, clip_m=0.04),
    "quantised to 1 mm": Truth(seconds=60.0, quantum_m=1e-3),
    "rest drifts by 2 mm": Truth(seconds=60.0, drift_m=2e-3),
    "sideways mode of 1 mm": Truth(seconds=60.0, sideways_m=1e-3),
    "linear and quadratic drag": Truth(seconds=60.0, damping_per_s=0.0073, quadratic_per_m_s=0.235),
}
"""Difficult kinds of records, by name, and a simple one for comparison."""


def record(truth: Truth, rng: np.random.Generator) -> F8:
    """Return the distances of one record at ``truth.times`` in m, (n,) float64, with a random phase."""
    t = truth.times
    decay = np.exp(-truth.damping_per_s * t)
    integral_s = t if truth.damping_per_s == 0 else (1.0 - decay) / truth.damping_per_s
    decay = decay / (1.0 + truth.quadratic_per_m_s * truth.amplitude_m * integral_s)
    angle = 2 * math.pi * truth.frequency_hz * t
    y = truth.offset_m + truth.amplitude_m * decay * np.cos(angle + rng.uniform(-math.pi, math.pi))
    y = y + truth.noise_m * rng.standard_normal(t.size)
    if truth.sideways_m:
        y = y + truth.sideways_m * np.cos(0.6 * angle + rng.uniform(-math.pi, math.pi))
    y = np.minimum(y, truth.offset_m + truth.clip_m)
    y = y + truth.drift_m * np.sin(0.5 * math.pi * t / t[-1])
    if truth.quantum_m:
        y = np.round(y / truth.quantum_m) * truth.quantum_m
    false = rng.random(t.size) < truth.echoes
    y[false] = rng.uniform(0.0, 2.0, np.count_nonzero(false))
    return np.asarray(y)


def bounds(truth: Truth) -> dict[str, float]:
    """Return the minimum standard deviations of unbiased estimates (Cramér-Rao), by name, in SI units.

    Returns
    -------
    dict
        Bounds of frequency (Hz), amplitude at t = 0 (m) and damping_rate (1/s) where all three, the phase and the
        offset are unknown. A method that assumes an undamped motion has more information, and may fall below the
        amplitude's bound.

    Notes
    -----
    The variances are those of the inverse Fisher information of (A, f, phase, o, gamma) in white noise, averaged over
    the phase. A false echo gives no information.
    """
    t, size = truth.times, truth.amplitude_m
    decay = np.exp(-truth.damping_per_s * t)
    variances = []
    for phase in np.linspace(-math.pi, math.pi, 9)[:-1]:
        angle = 2 * math.pi * truth.frequency_hz * t + phase
        cosine, sine = decay * np.cos(angle), decay * np.sin(angle)
        columns = [cosine, -2 * math.pi * size * t * sine, -size * sine, np.ones(t.size), -size * t * cosine]
        design = np.stack(columns, axis=1)
        norms = np.linalg.norm(design, axis=0)  # makes columns of different units comparable
        variances.append(np.diag(np.linalg.inv((design / norms).T @ (design / norms))) / norms**2)
    u = truth.noise_m / math.sqrt(1.0 - truth.echoes) * np.sqrt(np.mean(variances, axis=0))
    return {"frequency": float(u[1]), "amplitude": float(u[0]), "damping_rate": float(u[4])}
