"""Tuning: the frequency and decay that a window's basis must have, from the windows' own phases and amplitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.oscillation.windows import Solution, Windows, basis_of
from pipeline.track import F8

__all__ = ["Tuning", "retune", "unwrap"]

KNOWN = 3.3  # standard uncertainties by which an amplitude must exceed 0 for its phase to mean something
GREATEST = 0.05  # share of the frequency beyond which a detuning or a decay is a failed fit


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """How the basis turns and decays.

    Parameters
    ----------
    angular_frequency : float, rad/s
        Of the whole record.
    detuning : (w,) float64, rad/s
        What each window turns faster.
    decay : (w,) float64, 1/s
        Logarithmic decay in each window.
    phase, amplitude : (w,) float64, rad, m, or None
        Smooth curves through those of all windows that noise lets know their phase, at every window's centre.
    """

    angular_frequency: float
    detuning: F8
    decay: F8
    phase: F8 | None = None
    amplitude: F8 | None = None

    @classmethod
    def constant(cls, angular_frequency: float, windows: int) -> Tuning:
        """Return one frequency and no decay."""
        return cls(angular_frequency, np.zeros(windows), np.zeros(windows))

    def basis(self, windows: Windows) -> F8:
        """Return the basis of all windows, (w, 4, l)."""
        return basis_of(windows, self.angular_frequency + self.detuning, self.decay)

    def decayed(self, windows: Windows, basis: F8) -> F8:
        """Return a basis without decay with this tuning's put in; its frequency stays."""
        fall = np.exp(-self.decay[:, None] * windows.tau)
        basis[:, 1] *= fall
        basis[:, 2] *= fall
        return basis


def retune(windows: Windows, solution: Solution, tuning: Tuning, *, degree: int = 3) -> Tuning:
    """Return the tuning that phases and amplitudes of a fit show.

    Parameters
    ----------
    windows : Windows
    solution : Solution
    tuning : Tuning
        Of the fit.
    degree : int
        Of the polynomials in time through logarithms of amplitudes and through phases, fewer where windows are few.
        Drag makes the decay vary along a record, amplitude the frequency.
    """
    omega = tuning.angular_frequency
    if np.count_nonzero(solution.good) < 3:
        return _retune_short(windows, tuning)
    z = solution.coefficients[:, 1] + 1j * solution.coefficients[:, 2]
    size = np.abs(z)
    good = solution.good & (size > KNOWN * _u_amplitude(windows, solution))
    if np.count_nonzero(good) < 3:
        good = solution.good
    count = int(np.count_nonzero(good))
    t, weight = windows.centre[good], np.maximum(size[good], 1e-6 * np.max(size[good]) + windows.tiny)
    phase = unwrap(np.angle(z[good]), t, omega) - omega * (t - t[0])
    span = float(np.ptp(t))
    x = 2.0 * (t - t[0]) / span - 1.0
    degree = min(degree, max(1, count // 6))
    curves = np.polynomial.chebyshev.chebfit(x, np.stack([np.log(weight), phase], axis=1), degree, w=weight)
    slopes = np.polynomial.chebyshev.chebder(curves) * 2.0 / span
    place = 2.0 * (windows.centre - t[0]) / span - 1.0
    inside = np.clip(place, -1.0, 1.0)
    growth, turning = np.polynomial.chebyshev.chebval(inside, slopes)
    level, smooth = np.polynomial.chebyshev.chebval(inside, curves)
    # Beyond the windows that know their phase both go on as they were there.
    beyond = 0.5 * span * (place - inside)
    mean = float(np.average(turning[good], weights=weight**2))
    bound = GREATEST * omega
    return Tuning(
        omega + mean,
        np.clip(turning - mean, -bound, bound),
        np.clip(-growth, -bound, bound),
        smooth + turning * beyond + omega * (windows.centre - t[0]),
        np.exp(level + np.minimum(growth, 0.0) * beyond),
    )


def _u_amplitude(windows: Windows, solution: Solution) -> F8:
    """Standard uncertainty of each window's amplitude, m, at the noise that is typical of the record."""
    counts = np.maximum(windows.usable.sum(axis=1), 4.0)
    squares = np.sum(windows.usable * solution.residual**2, axis=1) / (counts - 3.0)
    typical = float(np.median(squares[solution.good]))
    return np.asarray(np.sqrt(0.5 * typical * (solution.inverse[:, 1, 1] + solution.inverse[:, 2, 2])))


def _retune_short(windows: Windows, tuning: Tuning, rounds: int = 12) -> Tuning:
    """The same for a record of one or two windows: Gauss-Newton on all its samples together.

    The spectrum of so few periods places the frequency to a tenth of itself only, too far off for one window's phase.
    """
    inside = windows.usable > 0
    t = (windows.tau + windows.centre[:, None])[inside]
    y = windows.y[inside]
    tau = t - t.mean()
    omega, rate = tuning.angular_frequency, 0.0
    for _ in range(rounds):
        fall = np.exp(-rate * tau)
        cosine, sine = fall * np.cos(omega * tau), fall * np.sin(omega * tau)
        linear = np.stack([np.ones_like(tau), cosine, -sine], axis=1)
        _, a, b = np.linalg.lstsq(linear, y, rcond=None)[0]
        by_omega, by_rate = -tau * (a * sine + b * cosine), -tau * (a * cosine - b * sine)
        full = np.concatenate([linear, by_omega[:, None], by_rate[:, None]], axis=1)
        step = np.linalg.lstsq(full, y, rcond=None)[0]
        # A fifth of itself a round at most: the start is off, not wrong.
        omega += float(np.clip(step[3], -0.2 * omega, 0.2 * omega))
        rate = float(np.clip(rate + step[4], -0.2 * omega, 0.2 * omega))
        if abs(step[3]) < 1e-9 * omega:
            break
    return Tuning(omega, np.zeros_like(tuning.detuning), np.full_like(tuning.decay, rate))


def unwrap(angle: F8, t: F8, omega: float) -> F8:
    """Total phase: the angle plus the turns that ``omega`` says lie between the windows."""
    rotating = omega * (t - t[0])
    return np.asarray(np.unwrap(angle - rotating) + rotating)
