"""Simulated records for the trade, and the Cramér-Rao bounds of what is in them; shares no code with any estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["HOSTILE", "Truth", "bounds", "record"]

F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """A free oscillation in white noise, :math:`y = o + A(t)\\cos(2\\pi f t + \\varphi)`, and what spoils it.

    With linear drag :math:`A(t) = A e^{-\\gamma t}`; with quadratic drag too, :math:`dA/dt = -\\gamma A - \\beta A^2`,
    the amplitude is :math:`A e^{-\\gamma t} / (1 + \\beta A (1 - e^{-\\gamma t}) / \\gamma)`.

    Parameters
    ----------
    seconds, rate_hz : float
    noise_m : float
        Standard deviation of one distance, m.
    frequency_hz, amplitude_m, damping_per_s, offset_m : float
    echoes : float
        Share of samples that are false echoes: anywhere up to 2 m.
    quadratic_per_m_s : float
        Quadratic drag, 1/(m s).
    clip_m : float
        Displacement beyond which crests are cut off, m.
    drift_m : float
        By how much the rest position moves within the record, m.
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
        """Logarithmic rate of the amplitude at the start, 1/s."""
        return self.damping_per_s + self.quadratic_per_m_s * self.amplitude_m

    @property
    def times(self) -> F8:
        """Sample times, (n,) float64, s."""
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
"""Kinds of records that are not so simple, by name, and the simple one to compare with."""


def record(truth: Truth, rng: np.random.Generator) -> F8:
    """Return one record at ``truth.times``, (n,) float64, m; its phase is drawn too."""
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
    """Return the least standard deviations of any unbiased estimate (Cramér-Rao), by name, in SI units.

    Returns
    -------
    dict
        frequency (Hz), amplitude at t = 0 (m), damping_rate (1/s), all unknown, with phase and offset. A method that
        takes an undamped motion for granted knows more, and may fall below the amplitude's bound.

    Notes
    -----
    The inverse Fisher information of (A, f, phase, o, gamma) in white noise, averaged over the phase. A false echo
    gives no information.
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
