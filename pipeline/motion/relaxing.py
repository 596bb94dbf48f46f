"""The free motion of a linearly damped bob at any strength of damping, as a model of samples.

The motion solves :math:`\\ddot x + 2g\\dot x + w x = 0` about a rest position o and starts from x = a with velocity v.
Its parameters are (o, a, v, ln g, ln w), so that g and w remain positive. With strong damping only w/2g is determined,
and in these parameters the resulting valley of chi-square is straight. With :math:`q = s^2 = g^2 - w` the motion is
:math:`e^{-gt}(a\\cosh st + (v + ga)\\sinh(st)/s)`: it oscillates for q < 0, is critically damped for q = 0 and has the
two rates :math:`g \\mp \\sqrt q` for q > 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.motion.fit import Rows
from pipeline.numerics import least_squares
from pipeline.numerics.least_squares import Fit
from pipeline.numerics.regression import covariance_of
from pipeline.track import F8

FAR = 20.0  # maximum change of the logarithm of a rate in the fit of a single exponential
DIFFERENCE = 1e-5  # relative change of a rate in difference quotients

Shape = Callable[[F8, F8], F8]


@dataclass(frozen=True, slots=True)
class Relaxing:
    """A model that is linear in its first parameters; the others are logarithms of rates."""

    shape: Shape  # columns (n, k) of the linear parameters at times (n,), for the logarithms
    names: tuple[str, ...]
    linear: int

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the positions (n,) at t, and a function that gives their derivatives (n, p)."""
        linear, logarithms = values[: self.linear], values[self.linear :]
        columns = self.shape(t, logarithms)

        def slopes() -> F8:
            moved = [
                (self.shape(t, logarithms + step) - self.shape(t, logarithms - step)) @ linear / (2.0 * DIFFERENCE)
                for step in DIFFERENCE * np.eye(logarithms.size)
            ]
            return np.column_stack([columns, *moved])

        return columns @ linear, slopes

    def fit(self, rows: Rows, logarithms: F8) -> Fit:
        """Fit the logarithms to the residuals that remain with the best linear parameters.

        In the valley of strong damping a search among all parameters does not reach the minimum.
        """

        def residuals(at: F8) -> F8:
            columns = self.shape(rows.t, at)
            if not np.all(np.isfinite(columns)):
                return np.full(rows.t.size, np.nan)
            base = np.linalg.qr(columns)[0]
            return np.asarray((rows.y - base @ (base.T @ rows.y)) / rows.u)

        end = least_squares.minimise(residuals, logarithms)
        columns = np.nan_to_num(self.shape(rows.t, end.values))
        return replace(end, values=np.concatenate([np.linalg.lstsq(columns, rows.y, rcond=None)[0], end.values]))


def exponential(t: F8, logarithms: F8) -> F8:
    """Return the columns (n, 2) of a constant and a single exponential for the parameter (ln r,)."""
    with np.errstate(all="ignore"):
        return np.stack([np.ones(t.size), np.exp(-np.exp(logarithms[0]) * t)], axis=1)


def damped(t: F8, logarithms: F8) -> F8:
    """Return the columns (n, 3) of (o, a, v) for (ln g, ln w), or (ln g,) with critical damping.

    For positive q both functions are sums of two decaying exponentials, so that nothing overflows. For negative q
    they are replaced by cosine and sine. For small arguments :math:`\\sinh(st)/s` is :math:`t + q t^3/6`.
    """
    with np.errstate(all="ignore"):
        rate = np.exp(logarithms[0])
        stiffness = np.exp(logarithms[1]) if logarithms.size == 2 else rate**2
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


FREE = Relaxing(damped, ("rest", "displacement", "velocity", "ln_rate", "ln_stiffness"), 3)
CRITICAL = Relaxing(damped, ("rest", "displacement", "velocity", "ln_rate"), 3)
LONE = Relaxing(exponential, ("rest", "displacement", "ln_rate"), 2)


@dataclass(frozen=True, slots=True, eq=False)
class Decay:
    """A fit of the motion: with critical damping, w = g^2, there are four parameters, without ln w."""

    values: F8
    covariance: F8
    chi2: float

    @property
    def critical(self) -> bool:
        """Whether the fit assumes critical damping."""
        return self.values.size == 4

    @property
    def rate(self) -> float:
        """The damping rate g, 1/s."""
        return math.exp(self.values[3])

    @property
    def stiffness(self) -> float:
        """The square w of the undamped angular frequency, rad^2/s^2."""
        return self.rate**2 if self.critical else math.exp(self.values[4])

    @property
    def square(self) -> float:
        """The difference q = g^2 - w, 1/s^2."""
        return self.rate**2 - self.stiffness

    @property
    def slowest(self) -> float:
        """The rate at which the motion ends, 1/s; the slower one if there are two."""
        # Computing g - sqrt(q) would lose digits.
        return self.stiffness / (self.rate + math.sqrt(self.square)) if self.square > 0.0 else self.rate


def best_decay(rows: Rows, rate_hz: float) -> Decay | None:
    """Return the best of the fits from a grid of start values; None if no fit converged."""
    ends = [FREE.fit(rows, start) for start in _grid(rows, rate_hz)]
    # If the record determines only one of two rates, chi-square has an open valley, possibly with a minimum beside it.
    minima = [end for end in ends if end.converged]
    return _described(FREE, rows, min(minima, key=lambda end: end.cost)) if minima else None


def critical_decay(rows: Rows, near: Decay) -> Decay | None:
    """Return the critically damped fit started from another fit; None if it did not converge."""
    end = CRITICAL.fit(rows, near.values[3:4])
    return _described(CRITICAL, rows, end) if end.converged else None


def lone_exponential(rows: Rows, rate: float) -> tuple[float, float]:
    """Fit :math:`o + p e^{-rt}` from a start value of the rate (in 1/s), and return r and chi-square.

    If the record shows no such rate the search diverges. The rate returned is therefore limited to a factor of e to
    the power :data:`FAR` above or below the start value.
    """
    start = math.log(rate)
    end = LONE.fit(rows, np.array([start]))
    return math.exp(min(max(float(end.values[-1]), start - FAR), start + FAR)), end.cost


def _described(model: Relaxing, rows: Rows, end: Fit) -> Decay:
    return Decay(end.values, covariance_of(rows.residuals(model)(end.values)[1]()), end.cost)


def _grid(rows: Rows, rate_hz: float) -> F8:
    """Return start values (k, 2) of (ln g, ln w): the best oscillations, pairs of close rates and of distinct rates.

    The grid is evaluated on samples that are thinned with time, each weighted by the number of samples it represents.
    In pairs of distinct rates the slower rate is that of the single exponential fitted to the record, because there
    may be a minimum beside the valley of chi-square.
    """
    tau, y = rows.t, rows.y
    few = np.unique(np.concatenate([np.arange(min(60, tau.size)), np.geomspace(1, tau.size, 240).astype(int) - 1]))
    share = np.sqrt(np.gradient(few.astype(np.float64)))[:, None]

    def best(shape: Shape, logarithms: F8, keep: int = 2) -> F8:
        base = np.linalg.qr(np.array([shape(tau[few], each) * share for each in logarithms]))[0]
        explained = np.sum((base.transpose(0, 2, 1) @ (y[few] * share[:, 0])) ** 2, axis=1)
        return np.asarray(logarithms[np.argsort(-explained)[:keep]])

    rates = np.geomspace(1.0 / tau[-1], 0.5 * rate_hz, 24)
    ((start,),) = best(exponential, np.log(rates)[:, None], 1)
    slow, _ = lone_exponential(rows, math.exp(start))
    fast = np.geomspace(1.5 * slow, max(rate_hz, 3.0 * slow), 24)
    near = np.array([(g, g * g * (1.0 - x)) for g in rates for x in (0.04, 0.3)])
    turning = np.array([(g, g * g * (1.0 + x * x)) for g in rates for x in (0.4, 1.0, 2.0, 4.0, 8.0, 16.0)])
    apart = np.stack([0.5 * (slow + fast), slow * fast], axis=1)
    return np.concatenate([best(damped, np.log(kind)) for kind in (apart, near, turning)])
