"""Tuning: the frequency and decay that a window's basis must have, from the windows' own phases and amplitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.numerics.least_squares import minimise
from pipeline.oscillation.windows import Solution, Windows
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
    turning : (w,) float64, rad/s
        Of each window.
    decay : (w,) float64, 1/s
        Logarithmic decay in each window.
    phase, amplitude : (w,) float64, rad, m, or None
        Smooth curves through those of all windows that noise lets know their phase, at every window's centre.
    """

    angular_frequency: float
    turning: F8
    decay: F8
    phase: F8 | None = None
    amplitude: F8 | None = None

    @classmethod
    def constant(cls, angular_frequency: float, windows: int, decay: float = 0.0) -> Tuning:
        """Return one frequency and one decay."""
        return cls(angular_frequency, np.full(windows, angular_frequency), np.full(windows, decay))


def retune(windows: Windows, solution: Solution, omega: float, *, degree: int = 3) -> Tuning:
    """Return the tuning that phases and amplitudes of a fit show.

    Parameters
    ----------
    windows : Windows
    solution : Solution
    omega : float, rad/s
        Of the fit.
    degree : int
        Of the polynomials in time through logarithms of amplitudes and through phases, fewer where windows are few.
        Drag makes the decay vary along a record, amplitude the frequency.
    """
    if np.count_nonzero(solution.good) < 3:
        return _retune_short(windows, omega)
    z = solution.coefficients[:, 1] + 1j * solution.coefficients[:, 2]
    size = np.abs(z)
    good = solution.good & (size > KNOWN * _u_amplitude(windows, solution))
    if np.count_nonzero(good) < 3:
        good = solution.good
    t, weight = windows.centre[good], np.maximum(size[good], 1e-6 * np.max(size[good]) + windows.tiny)
    phase = unwrap(np.angle(z[good]), t, omega) - omega * (t - t[0])
    span = float(np.ptp(t))
    place = 2.0 * (windows.centre - t[0]) / span - 1.0
    degree = min(degree, max(1, t.size // 6))
    chebyshev = np.polynomial.chebyshev
    curves = chebyshev.chebfit(place[good], np.stack([np.log(weight), phase], axis=1), degree, w=weight)
    inside = np.clip(place, -1.0, 1.0)
    level, smooth = chebyshev.chebval(inside, curves)
    growth, turning = chebyshev.chebval(inside, chebyshev.chebder(curves) * 2.0 / span)
    # Beyond the windows that know their phase both go on as they were there.
    beyond = 0.5 * span * (place - inside)
    mean = float(np.average(turning[good], weights=weight**2))
    bound = GREATEST * omega
    return Tuning(
        omega + mean,
        omega + mean + np.clip(turning - mean, -bound, bound),
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


def _retune_short(windows: Windows, omega: float) -> Tuning:
    """The same for a record of one or two windows, from all its samples together.

    The spectrum of so few periods places the frequency to a tenth of itself only, too far off for one window's phase.
    Frequency and decay are sought, rest position and amplitudes solved for at each trial (variable projection).
    """
    inside = windows.usable > 0
    t, y = (windows.tau + windows.centre[:, None])[inside], windows.y[inside]
    tau = t - t.mean()

    def left(trial: F8) -> F8:
        angle, fall = omega * trial[0] * tau, np.exp(-np.clip(trial[1], -0.2, 0.2) * omega * tau)
        columns = np.stack([np.ones_like(tau), fall * np.cos(angle), fall * np.sin(angle)], axis=1)
        return np.asarray(y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0])

    fit = minimise(left, [1.0, 0.0])
    turning, decay = fit.values if 0.5 < fit.values[0] < 2.0 else (1.0, 0.0)
    return Tuning.constant(omega * float(turning), len(windows.y), omega * float(np.clip(decay, -0.2, 0.2)))


def unwrap(angle: F8, t: F8, omega: float) -> F8:
    """Total phase: the angle plus the turns that ``omega`` says lie between the windows."""
    rotating = omega * (t - t[0])
    return np.asarray(np.unwrap(angle - rotating) + rotating)
