"""The free motion of a linearly damped bob at any strength of damping, with start values taken from the record.

The search varies two parameters; rest position, displacement and velocity enter linearly and follow from these two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.numerics import least_squares
from pipeline.numerics.regression import covariance_of, solve_weighted
from pipeline.track import F8

FAR = 20.0  # maximum change of the logarithm of a rate in the fit of a single exponential
DIFFERENCE = 1e-5  # relative change of a rate in the difference quotients for the covariance

Shape = Callable[[F8, F8], F8]


@dataclass(frozen=True, slots=True, eq=False)
class DecayFit:
    """Result of a fit of (o, a, v, ln g, ln w).

    Parameters
    ----------
    theta : (5,) or (4,) float64
        The parameters; with critical damping there are four, without ln w.
    covariance : (5, 5) or (4, 4) float64
    chi2 : float
    noise : float
        Standard deviation of a sample, m.
    """

    theta: F8
    covariance: F8
    chi2: float
    noise: float

    @property
    def critical(self) -> bool:
        """Whether the fit assumes critical damping, w = g^2."""
        return self.theta.size == 4

    @property
    def rate(self) -> float:
        """The damping rate g, 1/s."""
        return math.exp(self.theta[3])

    @property
    def stiffness(self) -> float:
        """The square w of the undamped angular frequency, rad^2/s^2."""
        return self.rate**2 if self.critical else math.exp(self.theta[4])

    @property
    def square(self) -> float:
        """The difference q = g^2 - w, 1/s^2."""
        return self.rate**2 - self.stiffness

    @property
    def slowest(self) -> float:
        """The rate at which the motion ends, 1/s; the slower one if there are two."""
        # Computing g - sqrt(q) would lose digits.
        return self.stiffness / (self.rate + math.sqrt(self.square)) if self.square > 0.0 else self.rate

    def position(self, tau: F8) -> F8:
        """Return the distances (n,) in m at times ``tau`` since the start in s."""
        return np.asarray(_motion(tau, self.theta[3:]) @ self.theta[:3])


def best_decay(tau: F8, y: F8, noise: float, rate_hz: float) -> DecayFit | None:
    """Return the best of the fits from a grid of start values; None if no fit converged.

    Parameters
    ----------
    tau, y : (n,) float64
        Times since the first sample (in s) and distances (in m).
    noise : float
        Standard deviation of a sample, m.
    rate_hz : float
        Samples per second.

    Notes
    -----
    The motion solves :math:`\\ddot x + 2g\\dot x + w x = 0` about a rest position o and starts from x = a with
    velocity v. Its parameters are (o, a, v, ln g, ln w), so that g and w remain positive. With strong damping only
    w/2g is determined, and in these parameters the resulting valley of chi-square is straight.
    With :math:`q = s^2 = g^2 - w` the motion is
    :math:`e^{-gt}(a\\cosh st + (v + ga)\\sinh(st)/s)`: it oscillates for q < 0, is critically damped for q = 0 and
    has the two rates :math:`g \\mp \\sqrt q` for q > 0.
    """
    starts = _grid(tau, y, noise, rate_hz)
    ends = [_search(_motion, tau, y, noise, start) for start in starts]
    # If the record determines only one of two rates, chi-square has an open valley, possibly with a minimum beside it.
    minima = [end for end in ends if end.converged]
    return _described(tau, y, noise, min(minima, key=lambda end: end.cost)) if minima else None


def critical_decay(tau: F8, y: F8, near: DecayFit) -> DecayFit | None:
    """Return the critically damped fit started from another fit; None if it did not converge."""
    end = _search(_motion, tau, y, near.noise, near.theta[3:4])
    return _described(tau, y, near.noise, end) if end.converged else None


def lone_exponential(tau: F8, y: F8, noise: float, rate: float) -> tuple[float, float]:
    """Fit :math:`o + p e^{-rt}` from a start value of the rate (in 1/s), and return r and chi-square.

    If the record shows no such rate the search diverges. The rate returned is therefore limited to a factor of e to
    the power :data:`FAR` above or below the start value.
    """
    start = math.log(rate)
    end = _search(_exponential, tau, y, noise, np.array([start]))
    return math.exp(min(max(float(end.values[0]), start - FAR), start + FAR)), end.cost


def _described(tau: F8, y: F8, noise: float, end: least_squares.Fit) -> DecayFit:
    """Return the fit with its linear parameters and the covariance of all parameters."""
    design = _motion(tau, end.values)
    linear = solve_weighted(design, y, np.ones(y.size)).values
    moved = [
        (_motion(tau, end.values + step) - _motion(tau, end.values - step)) @ linear / (2.0 * DIFFERENCE)
        for step in DIFFERENCE * np.eye(end.values.size)
    ]
    covariance = covariance_of(np.column_stack([design, *moved]) / noise)
    return DecayFit(np.concatenate([linear, end.values]), covariance, end.cost, noise)


def _search(shape: Shape, t: F8, y: F8, noise: float, start: F8) -> least_squares.Fit:
    """Fit the nonlinear parameters to the residuals (n,) that remain with the best linear parameters."""

    def residuals(theta: F8) -> F8:
        design = shape(t, theta)
        if not np.all(np.isfinite(design)):
            return np.full(t.size, np.nan)
        base = np.linalg.qr(design)[0]
        return np.asarray((y - base @ (base.T @ y)) / noise)

    return least_squares.minimise(residuals, start)


def _grid(tau: F8, y: F8, noise: float, rate_hz: float) -> F8:
    """Return start values (k, 2) of (ln g, ln w): the best oscillations, pairs of close rates and of distinct rates.

    The grid is evaluated on samples that are thinned with time, each weighted by the number of samples it represents.
    In pairs of distinct rates the slower rate is that of the single exponential fitted to the record, because there
    may be a minimum beside the valley of chi-square.
    """
    rows = np.unique(np.concatenate([np.arange(min(60, tau.size)), np.geomspace(1, tau.size, 240).astype(int) - 1]))
    share = np.sqrt(np.gradient(rows.astype(np.float64)))[:, None]

    def best(shape: Shape, thetas: F8, keep: int = 2) -> F8:
        base = np.linalg.qr(np.array([shape(tau[rows], theta) * share for theta in thetas]))[0]
        explained = np.sum((base.transpose(0, 2, 1) @ (y[rows] * share[:, 0])) ** 2, axis=1)
        return np.asarray(thetas[np.argsort(-explained)[:keep]])

    rates = np.geomspace(1.0 / tau[-1], 0.5 * rate_hz, 24)
    ((start,),) = best(_exponential, np.log(rates)[:, None], 1)
    slow, _ = lone_exponential(tau, y, noise, math.exp(start))
    fast = np.geomspace(1.5 * slow, max(rate_hz, 3.0 * slow), 24)
    near = np.array([(g, g * g * (1.0 - x)) for g in rates for x in (0.04, 0.3)])
    turning = np.array([(g, g * g * (1.0 + x * x)) for g in rates for x in (0.4, 1.0, 2.0, 4.0, 8.0, 16.0)])
    apart = np.stack([0.5 * (slow + fast), slow * fast], axis=1)
    return np.concatenate([best(_motion, np.log(kind)) for kind in (apart, near, turning)])


def _exponential(t: F8, theta: F8) -> F8:
    """Return the columns (n, 2) of a constant and a single exponential for the parameter (ln r,)."""
    with np.errstate(all="ignore"):
        return np.stack([np.ones(t.size), np.exp(-np.exp(theta[0]) * t)], axis=1)


def _motion(t: F8, theta: F8) -> F8:
    """Return the derivatives (n, 3) of the distance by (o, a, v) for (ln g, ln w), or (ln g,) with critical damping.

    Notes
    -----
    For positive q both functions are sums of two decaying exponentials, so that nothing overflows. For negative q
    they are replaced by cosine and sine. For small arguments :math:`\\sinh(st)/s` is :math:`t + q t^3/6`.
    """
    with np.errstate(all="ignore"):
        rate = np.exp(theta[0])
        stiffness = np.exp(theta[1]) if theta.size == 2 else rate**2
        square = rate**2 - stiffness
        root = np.sqrt(abs(square))
        if square > 0.0:
            # Computing g - sqrt(q) would lose digits.
            slow, fast = np.exp(-stiffness / (rate + root) * t), np.exp(-(rate + root) * t)
            cosine, sine = 0.5 * (slow + fast), 0.5 * (slow - fast)
        else:
            fall = np.exp(-rate * t)
            cosine, sine = fall * np.cos(root * t), fall * np.sin(root * t)
        near = np.exp(-rate * t) * t * (1.0 + square * t * t / 6.0)
        sine = np.where(root * t < 1e-4, near, sine / root)
    return np.stack([np.ones(t.size), cosine + rate * sine, sine], axis=1)
