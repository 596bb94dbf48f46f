"""Fits of a linearly damped motion, at any strength of damping, from starts that a record itself gives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.motion.overdamped.decay_model import Decay, Exponentials, basis
from pipeline.numerics import least_squares
from pipeline.track import F8

__all__ = ["DecayFit", "best_decay", "critical_decay", "lone_exponential"]

# A hundredth of a standard uncertainty is left. One attempt is enough: starts are many.
ROUGH = least_squares.Params(precision=0.1, steps=10, again=False)
FINE = least_squares.Params(precision=0.01, steps=40, again=False)
FINISHED = 2  # of the starts, the best, also where ten steps were too few


class Curve(Protocol):
    """What :func:`_fit` fits."""

    def evaluate(self, theta: F8) -> tuple[F8, F8]:
        """Return values (n,) and derivatives (n, p)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class DecayFit:
    """Where a fit of (o, a, v, ln g, ln w) ended.

    Parameters
    ----------
    theta : (5,) float64
        Critical, (4,): without the last.
    covariance : (5, 5) or (4, 4) float64
    chi2 : float
    noise : float
        Of a sample, m.
    """

    theta: F8
    covariance: F8
    chi2: float
    noise: float

    @property
    def critical(self) -> bool:
        """Whether w is g^2."""
        return self.theta.size == 4

    @property
    def rate(self) -> float:
        """g, 1/s."""
        return math.exp(self.theta[3])

    @property
    def stiffness(self) -> float:
        """w, the square of the undamped frequency, rad^2/s^2."""
        return self.rate**2 if self.critical else math.exp(self.theta[4])

    @property
    def square(self) -> float:
        """q = g^2 - w, 1/s^2."""
        return self.rate**2 - self.stiffness

    @property
    def slowest(self) -> float:
        """The rate at which the motion ends, 1/s: of two the slower."""
        # g - sqrt(q) would lose digits.
        return self.stiffness / (self.rate + math.sqrt(self.square)) if self.square > 0.0 else self.rate

    def position(self, tau: F8) -> F8:
        """Return the displacement, (n,), m, at times since the start, s."""
        return Decay(tau, critical=self.critical).evaluate(self.theta)[0]


def best_decay(tau: F8, y: F8, noise: float, rate_hz: float) -> DecayFit | None:
    """Return the best of the fits from a grid of starts; None where none converged.

    Parameters
    ----------
    tau, y : (n,) float64
        Times since the first sample, s, and distances, m.
    noise : float
        Of a sample, m.
    rate_hz : float
        Samples per second.
    """
    starts = np.concatenate([_two_rates(tau, y, noise, rate_hz), _grid(tau, y, rate_hz)])
    ends = sorted((_fit(Decay(tau), y, noise, start, ROUGH) for start in starts), key=lambda end: end.cost)
    # Two rates of which the record knows one make a valley without a floor; on its side there may be a minimum.
    tried = ends[:FINISHED] + [end for end in ends[FINISHED:] if end.converged]
    fits = (_decay(tau, y, noise, end.values) for end in tried)
    return next((fit for fit in fits if fit is not None), None)


def critical_decay(tau: F8, y: F8, near: DecayFit) -> DecayFit | None:
    """Return the critically damped motion near another; None where it was not found."""
    return _decay(tau, y, near.noise, near.theta[:4])


def lone_exponential(tau: F8, y: F8, noise: float, start: F8) -> least_squares.Fit:
    """Fit (o, p, ln r) of :math:`o + p e^{-rt}`."""
    return _fit(Exponentials(tau), y, noise, start)


def _decay(tau: F8, y: F8, noise: float, start: F8) -> DecayFit | None:
    end = _fit(Decay(tau, critical=start.size == 4), y, noise, start)
    return DecayFit(end.values, end.covariance, end.cost, noise) if end.converged else None


def _fit(curve: Curve, y: F8, noise: float, start: F8, options: least_squares.Params = FINE) -> least_squares.Fit:
    def both(theta: F8) -> tuple[F8, F8]:
        value, slope = curve.evaluate(theta)
        return (value - y) / noise, slope / noise

    residuals, jacobian = least_squares.evaluated_once(both)
    return least_squares.minimise(residuals, start, jacobian, options)


def _two_rates(tau: F8, y: F8, noise: float, rate_hz: float, keep: int = 2) -> F8:
    """Start values (keep, 5) or fewer: sums of two exponentials, found from the best single one."""
    rates = np.geomspace(1.0 / tau[-1], 0.5 * rate_hz, 40)
    falls = np.exp(-rates[:, None] * tau)
    level = float(y.mean())
    left, linear = _linear_best(np.stack([np.ones_like(falls), falls], axis=1), y - level)
    k = int(np.argmin(left))
    lone = lone_exponential(tau, y, noise, np.array([level + linear[k, 0], linear[k, 1], math.log(rates[k])]))
    slow = math.exp(lone.values[2])
    fast = np.geomspace(1.5 * slow, max(rate_hz, 3.0 * slow), 24)
    falls = np.exp(-fast[:, None] * tau)
    fall = np.broadcast_to(np.exp(-slow * tau), falls.shape)
    left, linear = _linear_best(np.stack([np.ones_like(falls), fall, falls], axis=1), y - level)
    best = np.argsort(left)[:keep]
    offset, first, second = linear[best].T
    starts = np.stack([level + offset, first, np.full(best.size, math.log(slow)), second, np.log(fast[best])], axis=1)
    ends = np.array([_fit(Exponentials(tau), y, noise, start, ROUGH).values for start in starts])
    offset, first, slows, second, fasts = ends.T
    with np.errstate(all="ignore"):
        slows, fasts = np.exp(slows), np.exp(fasts)
        speed = -first * slows - second * fasts
        theta = np.stack([offset, first + second, speed, np.log(0.5 * (slows + fasts)), np.log(slows * fasts)], axis=1)
    sound: F8 = theta[np.isfinite(theta).all(axis=1)]
    return sound


def _linear_best(design: F8, y: F8) -> tuple[F8, F8]:
    """Squares that each design (k, p, n) leaves, less those of y (n,), and the linear parameters (k, p)."""
    scale = np.sqrt(np.einsum("kpn,kpn->kp", design, design)) + 1e-300
    unit = design / scale[:, :, None]
    right = unit @ y
    normal = unit @ unit.transpose(0, 2, 1) + 1e-10 * np.eye(design.shape[1])
    linear = np.linalg.solve(normal, right[:, :, None])[..., 0]
    left = -np.einsum("kp,kp->k", linear, right)
    return left, linear / scale


def _grid(tau: F8, y: F8, rate_hz: float, keep: int = 2) -> F8:
    """Start values (2 keep, 5): the best of a grid of oscillations and of rates near each other.

    On samples thinned with growing time, which stand for as many as lie about them.
    """
    rows = np.unique(np.concatenate([np.arange(min(60, tau.size)), np.geomspace(1, tau.size, 240).astype(int) - 1]))
    t, share = tau[rows], np.sqrt(np.gradient(rows.astype(np.float64)))
    rates = np.geomspace(1.0 / tau[-1], 0.5 * rate_hz, 24)
    near = np.array([(g, g * g * (1.0 - x)) for g in rates for x in (0.04, 0.3)])
    turning = np.array([(g, g * g * (1.0 + x * x)) for g in rates for x in (0.4, 1.0, 2.0, 4.0, 8.0, 16.0)])
    rate, stiffness = np.concatenate([near, turning]).T
    cosine, sine = basis(t, rate[:, None], (rate * rate - stiffness)[:, None])
    level = float(y[rows].mean())
    design = np.stack([np.ones_like(cosine), cosine + rate[:, None] * sine, sine], axis=1) * share
    left, linear = _linear_best(design, (y[rows] - level) * share)
    linear[:, 0] += level
    order = np.argsort(left)
    best = np.concatenate([order[order < len(near)][:keep], order[order >= len(near)][:keep]])
    theta: F8 = np.concatenate([linear, np.log(np.stack([rate, stiffness], axis=1))], axis=1)[best]
    return theta
