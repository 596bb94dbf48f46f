"""Steps: jumps of the rest position, told from smooth drift, and placed to the sample."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.estimate import Estimate
from pipeline.numerics.linear_model import LinearModel
from pipeline.numerics.regression import correlation_length, solve_weighted
from pipeline.numerics.robust import mad_sigma, median
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.modes import Carrier
from pipeline.track import F8, UNUSABLE

__all__ = ["Params", "Step", "find_steps", "staircase", "weighed"]

DEGREES = (0, 1, 2, 4, 6, 9, 12)  # of the smooth drift that steps compete with
SUDDEN = 4.0  # fall of chi-square by which a jump must beat a glide
POSSIBLE_DRAW = 5.1  # standard deviation of a jump's place over (noise/height)^2, samples: root of 26


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_steps`.

    Parameters
    ----------
    false_alarm : float
        Probability that a rest position that does not jump shows a step.
    most : int
        Steps in a record; where there seem to be more, the rest wanders and is followed by its drift alone.
    apart : int
        Fewest windows between steps, and before the first and after the last.
    """

    false_alarm: float = 0.005
    most: int = 12
    apart: int = 3


@dataclass(frozen=True, slots=True)
class Step:
    """One jump of the rest position.

    Parameters
    ----------
    time : Estimate
        s.
    height : Estimate
        From before to after, m.
    false_alarm : float
        Probability that a rest position that does not jump shows as much anywhere in the record.
    """

    time: Estimate
    height: Estimate
    false_alarm: float


def find_steps(conditioned: Conditioned, demodulated: Demodulated, params: Params | None = None) -> tuple[Step, ...]:
    """Find the jumps of the rest position, in order of time.

    Parameters
    ----------
    conditioned : Conditioned
        Its samples place each jump.
    demodulated : Demodulated
        Its windows show whether there are any.
    params : Params, optional

    Returns
    -------
    tuple of Step

    Notes
    -----
    Polynomials of several degrees compete, each with the steps that it needs besides: a step is added where it lowers
    chi-square most, as long as that fall, over the residuals' correlation length, is more than noise would show
    anywhere (Bonferroni's bound on all windows); the BIC chooses among them, a step counting two parameters. So a
    smooth drift is no staircase. What the samples show as a glide over a period or more is no step either. The
    uncertainty of a place is that of a maximum of a random walk's likelihood [1]_.

    References
    ----------
    .. [1] Y.-C. Yao, "Approximating the distribution of the maximum likelihood estimate of the change-point",
       Ann. Statist. 15 (1987) 1321, doi:10.1214/aos/1176350509.
    """
    params = params or Params()
    rest = _Windows.of(demodulated)
    if rest.t.size < 2 * params.apart + 2 or not rest.suspicious(params):
        return ()
    coarse = rest.staircase(params)
    if not coarse:
        return ()
    used = (demodulated.flags & UNUSABLE) == 0
    t = conditioned.track.t[used]
    still = conditioned.track.y[used] - Carrier.through(demodulated, float(t[0]), float(t[-1])).swing(t)
    placed = (_place(t, still, rest, index, coarse, params.apart) for index in coarse)
    return tuple(step for step in placed if step is not None)


def staircase(steps: tuple[Step, ...], t: F8) -> F8:
    """Return the sum of the steps at times t (n,), m: 0 before the first."""
    total = np.zeros(t.size)
    for step in steps:
        total += step.height.value * (t >= step.time.value)
    return total


def weighed(steps: tuple[Step, ...], demodulated: Demodulated) -> tuple[tuple[Step, ...], Demodulated]:
    """Fit the heights of all steps together, to windows from which the steps were taken out.

    Returns
    -------
    steps : tuple of Step
    demodulated : Demodulated
        With its rest positions less what the heights changed.

    Notes
    -----
    Only now do the windows that hold a step know their rest position. A line is fitted along, so that a drift does not
    pass for height.
    """
    rest = _Windows.of(demodulated)
    after = np.array([rest.t >= step.time.value for step in steps], np.float64)
    x = (rest.t - rest.t.mean()) / float(np.ptp(rest.t))
    design = np.stack([np.ones_like(x), x, *after], axis=1)
    line = solve_weighted(design, rest.y, np.full(rest.t.size, rest.u))
    widened = math.sqrt(correlation_length(line.residual) * max(1.0, line.chi2 / max(x.size - design.shape[1], 1)))
    more, u = line.values[2:], widened * np.sqrt(np.diag(line.covariance)[2:])
    better = tuple(
        replace(step, height=Estimate(step.height.value + float(d), float(s), "m"))
        for step, d, s in zip(steps, more, u, strict=True)
    )
    change = staircase(better, demodulated.t) - staircase(steps, demodulated.t)
    return better, replace(demodulated, offset=demodulated.offset - change)


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """Rest positions of the windows, over their uncertainty.

    ``u`` holds what neighbours differ, so that beats do not count as steps; single windows far off are left out.
    """

    t: F8
    y: F8
    u: float

    @classmethod
    def of(cls, demodulated: Demodulated) -> _Windows:
        t, offset = demodulated.t, demodulated.offset
        if t.size < 5:
            return cls(t, offset, 1.0)
        around = offset[np.clip(np.arange(t.size)[:, None] + np.arange(-2, 3), 0, t.size - 1)]
        away = np.abs(offset - np.sort(around, axis=1)[:, 2])  # a tenth of the time of numpy's median
        kept = away <= 8.0 * max(mad_sigma(away), 1e-300)
        t, offset = t[kept], offset[kept]
        stated = median(np.sqrt(demodulated.covariance[kept, 2, 2]))
        apart = mad_sigma(np.diff(offset)) / math.sqrt(2.0)
        return cls(t, offset, max(stated, apart, 1e-15 * float(np.max(np.abs(offset))) + 1e-100))

    @property
    def spacing(self) -> float:
        """Time between windows, s."""
        return median(np.diff(self.t))

    @property
    def deviations(self) -> F8:
        """Rest positions about their mean, over their uncertainty."""
        return np.asarray((self.y - self.y.mean()) / self.u)

    def threshold(self, params: Params, dof: float = math.inf) -> float:
        """Fall of chi-square that noise shows anywhere with the probability of a false alarm.

        Student's quantile where the noise is known from what few windows leave.
        """
        from scipy.special import ndtri, stdtrit

        probability = 1.0 - params.false_alarm / (2.0 * self.t.size)
        return float(ndtri(probability) if math.isinf(dof) else stdtrit(dof, probability)) ** 2

    def suspicious(self, params: Params) -> bool:
        """Whether one step in a constant would be worth a look."""
        constant = np.full((self.t.size, 1), 1.0 / math.sqrt(self.t.size))
        return _best_step(self.deviations, constant, params.apart)[1] > self.threshold(params)

    def staircase(self, params: Params) -> dict[int, float]:
        """First window after each step, and the probability that noise shows as much."""
        powers = np.polynomial.legendre.legvander(
            2.0 * (self.t - self.t[0]) / (self.t[-1] - self.t[0]) - 1.0, DEGREES[-1]
        )
        trials = [self.grow(powers[:, : degree + 1], params) for degree in DEGREES if degree <= self.t.size // 6]
        # One correlation length for all: that of the model that leaves least.
        length = correlation_length(min(trials, key=lambda trial: trial.chi2).left)
        price = math.log(self.t.size)
        best = min(trials, key=lambda trial: trial.chi2 / length + (trial.degree + 1 + 2 * len(trial.steps)) * price)
        if len(best.steps) > params.most:
            return {}
        chances = [min(1.0, self.t.size * math.erfc(math.sqrt(0.5 * fall / length))) for fall in best.falls]
        return dict(sorted(zip(best.steps, chances, strict=True)))

    def grow(self, powers: F8, params: Params) -> _Staircase:
        """Add steps to a polynomial in ``powers`` (w, degree + 1) as long as each counts.

        Residuals of too few steps are correlated by those that are missing. So steps are added as if noise were white,
        and the first number of them is kept at which every one stands against the correlation of what is left.
        """
        model = LinearModel(self.deviations, powers)
        degree = powers.shape[1] - 1
        kept = now = _Staircase(degree, [], model.left, [])
        while len(now.steps) <= params.most:
            index, gain = _best_step(model.left, model.basis, params.apart, now.steps)
            if index < 0 or gain <= self.threshold(params):
                break
            model.add(model.terms((np.arange(self.t.size) >= index).astype(np.float64)[:, None]))
            now = _Staircase(degree, [*now.steps, index], model.left, model.falls()[degree + 1 :].tolist())
            if self.all_count(now, params):
                kept = now
            elif kept.steps:
                break
        return kept

    def all_count(self, trial: _Staircase, params: Params) -> bool:
        """Whether each of the steps, the others given, is more than noise as correlated as what is left."""
        dof = max(self.t.size - trial.degree - 1 - 2.0 * len(trial.steps), 1.0)
        length = correlation_length(trial.left)
        least = length * max(1.0, trial.chi2 / dof) * self.threshold(params, max(dof / length, 2.0))
        return min(trial.falls) > least


@dataclass(frozen=True, slots=True, eq=False)
class _Staircase:
    """A polynomial with steps: first windows after each, what they leave over its uncertainty (w,), and by how much
    each, the others given, lowers chi-square."""

    degree: int
    steps: list[int]
    left: F8
    falls: list[float]

    @property
    def chi2(self) -> float:
        return float(self.left @ self.left)


def _best_step(left: F8, basis: F8, apart: int, taken: list[int] | None = None) -> tuple[int, float]:
    """First window of the step that lowers chi-square most beyond the basis, and by how much; -1 where none fits.

    Sums from the end give every step's projections at once.
    """
    size = left.size
    along = np.cumsum(left[::-1])[::-1]
    inside = np.cumsum(basis[::-1], axis=0)[::-1]
    length = np.arange(size, 0, -1) - np.einsum("wp,wp->w", inside, inside)
    possible = length > 0.05
    possible[:apart], possible[size - apart + 1 :] = False, False
    for index in taken or ():
        possible[max(index - apart + 1, 0) : index + apart] = False
    gain = np.where(possible, along**2 / np.where(possible, length, 1.0), -1.0)
    best = int(np.argmax(gain))
    return (best, float(gain[best])) if possible[best] else (-1, 0.0)


def _place(t: F8, still: F8, rest: _Windows, index: int, coarse: dict[int, float], apart: int) -> Step | None:
    """Find the sample at which the rest position jumps, near where the windows see it; None where it glides."""
    edges = [0, *coarse, rest.t.size]
    here = edges.index(index)
    first, last = max(edges[here - 1], index - 2 * apart), min(edges[here + 1], index + 2 * apart) - 1
    span = (t >= rest.t[first]) & (t <= rest.t[last])
    seconds, y = t[span], still[span]
    near = (seconds > rest.t[max(index - 2, first)]) & (seconds <= rest.t[min(index + 1, last)])
    cuts = np.flatnonzero(near)
    cuts = cuts[(cuts >= 5) & (cuts <= y.size - 5)]
    if not cuts.size:
        return None
    noise = mad_sigma(np.diff(y)) / math.sqrt(2.0)
    # Heavy tails would draw the place towards themselves.
    middle, apart_m = float(np.median(y)), float(np.median(y[: cuts[0]]) - np.median(y[cuts[-1] :]))
    reach = 4.0 * noise + 0.5 * abs(apart_m)
    y = np.clip(y, middle - reach, middle + reach)
    gain = _gains(np.cumsum(y - y.mean()), cuts)
    cut = int(cuts[int(np.argmax(gain))])
    ramp = _best_ramp(seconds, y, 0.5 * (seconds[cut - 1] + seconds[cut]), rest.spacing)
    left = y - np.where(np.arange(y.size) < cut, y[:cut].mean(), y[cut:].mean())
    if gain.max() - ramp < SUDDEN * float(np.var(left)) * correlation_length(left):
        return None
    height = float(np.median(y[cut:]) - np.median(y[:cut]))
    doubt = POSSIBLE_DRAW * (noise / height) ** 2 if height else y.size
    u_time = float(np.median(np.diff(seconds))) * math.hypot(0.5, min(doubt, 0.5 * y.size))
    # Of a difference of medians.
    u_height = 1.25 * rest.u * math.sqrt(1.0 / max(index - first, 1) + 1.0 / max(last - index + 1, 1))
    when = 0.5 * float(seconds[cut - 1] + seconds[cut])
    return Step(Estimate(when, u_time, "s"), Estimate(height, u_height, "m"), coarse[index])


def _gains(sums: F8, cuts: NDArray[np.int64]) -> F8:
    """Fall of the sum of squares that a jump at each sample brings, of values whose sums from the start are given."""
    before, n = cuts.astype(np.float64), float(sums.size)
    return np.asarray(sums[cuts - 1] ** 2 * n / (before * (n - before)))


def _best_ramp(t: F8, y: F8, centre: float, period: float) -> float:
    """The same for the best of several ramps, a period long to all of the span, around a time."""
    centred, best = y - y.mean(), 0.0
    for width in (period, 2.0 * period, 4.0 * period, 8.0 * period, 2.0 * float(np.ptp(t))):
        for shift in np.linspace(-0.75, 0.75, 7):
            ramp = np.clip((t - centre - shift * period) / width + 0.5, 0.0, 1.0)
            ramp -= ramp.mean()
            power = float(ramp @ ramp)
            best = max(best, float(ramp @ centred) ** 2 / power if power > 0 else 0.0)
    return best
