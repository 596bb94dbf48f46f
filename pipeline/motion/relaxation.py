"""Relaxation motion: records in which damping ends the motion before it completes more than a few cycles.

The model is the free motion of a linearly damped bob at any strength of damping,
:math:`\\ddot x + 2g\\dot x + w x = 0` about a rest position o, from x = a with velocity v. Its parameters are
(o, a, v, ln g, ln w), so that g and w remain positive. With strong damping only w/2g is determined, and in these
parameters the resulting valley of chi-square is straight. With :math:`q = s^2 = g^2 - w` the motion is
:math:`e^{-gt}(a\\cosh st + (v + ga)\\sinh(st)/s)`: it oscillates for q < 0, is critically damped for q = 0 and has the
two rates :math:`g \\mp \\sqrt q` for q > 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.motion.fit import Rows, allowed
from pipeline.motion.fitted import ClosedMotion
from pipeline.notice import Refusal
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.least_squares import CENTRAL_STEP, Fit
from pipeline.numerics.levels import FEWEST_FOR_CURVE, LARGEST, NEGLIGIBLE, STRONG, VERY_STRONG
from pipeline.numerics.regression import correlation_length, covariance_of
from pipeline.samples.condition import Samples
from pipeline.track import F8, Quality

Shape = Callable[[F8, F8], F8]


@dataclass(frozen=True, slots=True)
class Relaxing:
    """A model that is linear in its first parameters; the others are logarithms of rates."""

    shape: Shape  # columns (n, k) of the linear parameters at times (n,), for the logarithms
    linear: int

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the positions (n,) at t, and a function that gives their derivatives (n, p)."""
        linear, logarithms = values[: self.linear], values[self.linear :]
        columns = self.shape(t, logarithms)

        def slopes() -> F8:
            moved = [
                (self.shape(t, logarithms + step) - self.shape(t, logarithms - step)) @ linear / (2.0 * CENTRAL_STEP)
                for step in CENTRAL_STEP * np.eye(logarithms.size)
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


DAMPED = Relaxing(damped, 3)
LONE = Relaxing(exponential, 2)


@dataclass(frozen=True, slots=True, eq=False)
class Decay:
    """A fit of the motion: with critical damping, w = g^2, there are four parameters, without ln w."""

    values: F8
    covariance: F8
    chi2: float

    @property
    def rate(self) -> float:
        """The damping rate g, 1/s."""
        return math.exp(self.values[3])

    @property
    def stiffness(self) -> float:
        """The square w of the undamped angular frequency, rad^2/s^2."""
        return self.rate**2 if self.values.size == 4 else math.exp(self.values[4])

    @property
    def square(self) -> float:
        """The difference q = g^2 - w, 1/s^2."""
        return self.rate**2 - self.stiffness

    @property
    def slowest(self) -> float:
        """The rate at which the motion ends, 1/s; the slower one if there are two."""
        # Computing g - sqrt(q) would lose digits.
        return self.stiffness / (self.rate + math.sqrt(self.square)) if self.square > 0.0 else self.rate


def best_decay(rows: Rows, starts: F8) -> Decay | None:
    """Return the best of the fits from start values (k, 2), or (k, 1) with critical damping; None if none converged."""
    # If the record determines only one of two rates, chi-square has an open valley, possibly with a minimum beside it.
    minima = [end for start in starts if (end := DAMPED.fit(rows, start)).converged]
    if not minima:
        return None
    end = min(minima, key=lambda end: end.cost)
    return Decay(end.values, covariance_of(rows.residuals(DAMPED)(end.values)[1]()), end.cost)


def lone_exponential(rows: Rows, rate: float) -> tuple[float, float]:
    """Fit :math:`o + p e^{-rt}` from a start value of the rate (in 1/s), and return r and chi-square.

    If the record shows no such rate the search diverges; r is limited by :data:`LARGEST`.
    """
    end, most = LONE.fit(rows, np.array([math.log(rate)])), math.log(LARGEST)
    return math.exp(min(max(float(end.values[-1]), -most), most)), end.cost


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


DampingKind = Literal["overdamped", "critical", "strong"]

# Approximate number of block means by which a record may show a motion: white noise does with a probability of 6 %
# (chi-square), and is then fitted in vain.
BLOCK_MEANS = 300
# Minimum damping ratio of a strongly damped oscillation; below it the cycles are analysed instead. By the formulas of
# averaging, which are of first order, their error is its square, 0.25 %. With 0.1, drag of a ratio of 0.08 loses its
# laws, as measured by `python -m tests.golden --only drag-strong-0.08`.
LEAST_DAMPING = 0.05


NO_RELAXATION = Refusal("no_relaxation")
# Names of the parameters; with critical damping there is no ln w.
DECAY_PARAMETERS = ("rest", "displacement", "velocity", "log_rate", "log_stiffness")


@dataclass(frozen=True, slots=True, eq=False)
class Relaxation(ClosedMotion):
    """A motion that relaxes with two rates or with one, or an oscillation whose damping ratio is large."""

    kind: DampingKind  # the parameters are o, a, v, ln g and ln w

    def position(self, t: F8) -> F8:
        """Return the values (n,) at times t (n,) from the start on."""
        return DAMPED.at(t - self.start_s, self.joint.values)[0]

    @property
    def damping_ratio(self) -> Estimate:
        """The damping ratio g/omega0."""
        if self.kind == "critical":
            return Estimate(1.0, 0.0)
        ratio = math.exp(float(self.joint["log_rate"].value) - 0.5 * float(self.joint["log_stiffness"].value))
        slope = np.array([1.0, -0.5])
        return Estimate(ratio, ratio * math.sqrt(float(slope @ self.joint.covariance[3:, 3:] @ slope)))


def find_relaxation(samples: Samples) -> Relaxation | Refusal:
    """Fit the free motion of a linearly damped bob and classify its damping.

    Refused are a single exponential, which a drift can resemble, and noise, a drift, a step, a ramp or a weakly damped
    oscillation.

    A relaxation must leave no more than noise, also in its moving part alone, and end within the record (:math:`gT >
    2`). The evidence for it against a single exponential must be strong. Critical damping and the free fit are compared
    by BIC. If a record begins before the release, the fit begins where the displacement begins to fall.
    """
    used = samples.used
    t, y = samples.track.t[used], samples.track.y[used]
    if t.size < 2 * FEWEST_FOR_CURVE:
        return NO_RELAXATION
    noise = max(samples.noise_of_reading, 1e-4 * float(np.ptp(y)))
    if not (noise > 0.0 and _moves(y, noise)):
        return NO_RELAXATION
    for first in _starts(y, noise):
        found = _follow(t[first:], y[first:], noise, samples)
        if found != NO_RELAXATION:
            return found
    return NO_RELAXATION


def _moves(y: F8, noise: float) -> bool:
    """Return whether block means of the record vary enough for a relaxation to explain the variation."""
    size = max(1, y.size // BLOCK_MEANS)
    values = y[: y.size // size * size].reshape(-1, size).mean(axis=1)
    excess = float(np.sum((values - values.mean()) ** 2)) * size / noise**2 - values.size
    return bool(excess > VERY_STRONG + 5.0 * math.log(values.size))


def _starts(y: F8, noise: float) -> Iterator[int]:
    """Yield the rows at which the motion may begin: the first sample, then the release of a held displacement.

    A bob that before that comes nearer to rest than half of the displacement swings, and moves freely from the first
    sample.
    """
    yield 0
    away = y - float(np.median(y[-max(y.size // 10, 5) :]))
    level = float(np.median(away[: max(y.size // 50, 5)]))
    away = away * math.copysign(1.0, level)
    held = np.flatnonzero(away >= abs(level) - 3.0 * noise)
    if held.size and 5 < held[-1] < y.size - 20 and np.mean(away[: held[-1]] < 0.5 * abs(level)) < NEGLIGIBLE:
        yield int(held[-1])


def _follow(t: F8, y: F8, noise: float, samples: Samples) -> Relaxation | Refusal:
    every = np.ones(t.size, np.bool_)
    rows, track = Rows(t - t[0], y, every, every, noise), samples.track
    found = best_decay(rows, _grid(rows, track.rate_hz))
    if found is None or not found.rate * rows.t[-1] > 2.0 or _misses(rows, found):
        return NO_RELAXATION
    choice = _kind(rows, found, 0.5 * track.rate_hz)
    if isinstance(choice, Refusal):
        return choice
    kind, found = choice
    # A residual larger than the noise increases the uncertainties, and so does one whose neighbours are correlated.
    correlation = correlation_length(rows.left(DAMPED, found.values))
    count = max(t.size - found.values.size, 1)
    covariance = found.covariance * max(1.0, found.chi2 / count) * correlation
    spread, dof = math.sqrt(found.chi2 / count) * noise, max(count / correlation, 1.0)
    units = (track.unit, track.unit, f"{track.unit}/s", "", "")
    before, since = samples.track.t < t[0], samples.track.t - t[0]
    residual = np.where(before, np.nan, track.y - DAMPED.at(np.where(since > 0.0, since, 0.0), found.values)[0])
    result = Relaxation(
        kind=kind,
        joint=Joint(DECAY_PARAMETERS[: found.values.size], found.values, covariance, units[: found.values.size]),
        dof=dof,
        noise=Estimate(spread, spread / math.sqrt(2.0 * dof), track.unit),
        start_s=float(t[0]),
        residual=residual,
        flags=samples.flags | np.where(before, np.uint8(Quality.OUTSIDE), np.uint8(0)),
    )
    return NO_RELAXATION if kind == "strong" and result.damping_ratio.value < LEAST_DAMPING else result


def _misses(rows: Rows, found: Decay) -> bool:
    """Return whether the residual is too large over the whole record or over its moving part."""
    squares = rows.left(DAMPED, found.values) ** 2
    count = max(int(np.searchsorted(rows.t, 4.0 / found.slowest)), 12)
    return max(float(np.mean(squares)), float(np.mean(squares[:count]))) > allowed(rows.u, _scatter(rows, found)) ** 2


def _scatter(rows: Rows, found: Decay) -> float:
    """Return the median scatter of the samples about such a motion, fitted to each turn of a radian frequency alone.

    Neighbouring samples differ by less than their noise if the sensor averages them. It is 0 if a turn has too few.
    """
    size = int(2.0 * math.pi * rows.t.size / max(float(rows.t[-1]) * math.sqrt(found.stiffness), 1e-300))
    if not 2 * FEWEST_FOR_CURVE <= size <= rows.t.size:
        return 0.0
    blocks = rows.y[: rows.y.size // size * size].reshape(-1, size).T
    base = np.linalg.qr(damped(rows.t[:size] - rows.t[0], found.values[3:]))[0]
    squares = np.sum((blocks - base @ (base.T @ blocks)) ** 2, axis=0)
    return math.sqrt(float(np.median(squares)) / (size - 3))


def _kind(rows: Rows, fit: Decay, fastest: float) -> tuple[DampingKind, Decay] | Refusal:
    """Return the kind of damping with the lowest BIC and its fit, unless a single exponential suffices.

    None of them does if the motion ends at a rate above ``fastest`` (in 1/s), that is between two samples, like a step.
    """
    price = math.log(rows.t.size)
    rate, left = lone_exponential(rows, fit.slowest)
    one = best_decay(rows, fit.values[None, 3:4])
    critical = math.inf if one is None else one.chi2 + 4.0 * price
    free = fit.chi2 + 5.0 * price
    if min(critical, free) > left + 3.0 * price - STRONG:
        if rate > fastest:
            return NO_RELAXATION
        return Refusal("exponential", {"rate": rate})
    if one is not None and critical <= free:
        return ("critical", one) if one.rate <= fastest else NO_RELAXATION
    if fit.slowest > fastest:
        return NO_RELAXATION
    return ("overdamped" if fit.square > 0.0 else "strong"), fit
