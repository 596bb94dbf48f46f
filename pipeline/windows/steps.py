"""Steps: jumps of the rest position, distinguished from smooth drift and located to the sample."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length, solve_weighted
from pipeline.numerics.robust import mad_sigma, median
from pipeline.samples.condition import Conditioned
from pipeline.track import F8, UNUSABLE
from pipeline.windows import change_points
from pipeline.windows.change_points import find_changes, lone_points
from pipeline.windows.demodulate import FINEST, Demodulated
from pipeline.windows.modes import Carrier

__all__ = ["Params", "Step", "find_steps", "staircase", "weighed"]

POSSIBLE_DRAW = 5.1  # standard deviation of a jump's position over (noise/height)^2, samples: sqrt(26) [Yao 1987]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_steps`.

    Parameters
    ----------
    changes : pipeline.windows.change_points.Params
        Options of the search for jumps.
    sudden : float
        Chi-square difference by which a jump must fit better than a gradual change: the 95 % quantile for one degree of
        freedom.
    """

    changes: change_points.Params = field(default_factory=change_points.Params)
    sudden: float = 3.84


@dataclass(frozen=True, slots=True)
class Step:
    """One jump of the rest position.

    Parameters
    ----------
    time : Estimate
        Time of the jump, s.
    height : Estimate
        Change from before to after the jump, m.
    false_alarm : float
        Probability that a rest position without jumps shows one as significant anywhere in the record.
    """

    time: Estimate
    height: Estimate
    false_alarm: float


def find_steps(conditioned: Conditioned, demodulated: Demodulated, params: Params | None = None) -> tuple[Step, ...]:
    """Find the jumps of the rest position, in order of time.

    Parameters
    ----------
    conditioned : Conditioned
        Its samples locate each jump.
    demodulated : Demodulated
        Its windows show whether there are any jumps.
    params : Params, optional

    Returns
    -------
    tuple of Step

    Notes
    -----
    :func:`pipeline.windows.change_points.find_changes` searches the rest positions of the windows. A change that the
    samples show as gradual, over a period or more, is not a step. The uncertainty of a step's time is that of the
    maximum-likelihood estimate of a change point [1]_.

    References
    ----------
    .. [1] Y.-C. Yao, "Approximating the distribution of the maximum likelihood estimate of the change-point",
       Ann. Statist. 15 (1987) 1321, doi:10.1214/aos/1176350509.
    """
    params = params or Params()
    rest = _Windows.of(demodulated, params.changes.false_alarm)
    changes = find_changes(rest.t, rest.y[None], np.full((1, rest.t.size), rest.u), params.changes)
    if not changes:
        return ()
    used = (demodulated.flags & UNUSABLE) == 0
    t = conditioned.track.t[used]
    still = conditioned.track.y[used] - Carrier.through(demodulated, float(t[0]), float(t[-1])).swing(t)
    chances = {change.index: change.false_alarm for change in changes}
    placed = (_place(t, still, rest, index, chances, params) for index in chances)
    return tuple(step for step in placed if step is not None)


def staircase(steps: tuple[Step, ...], t: F8) -> F8:
    """Return the sum of the steps at times t (n,), m: 0 before the first."""
    total = np.zeros(t.size)
    for step in steps:
        total += step.height.value * (t >= step.time.value)
    return total


def weighed(steps: tuple[Step, ...], demodulated: Demodulated) -> tuple[tuple[Step, ...], Demodulated]:
    """Fit the heights of all steps together to windows from which the steps have been subtracted.

    Returns
    -------
    steps : tuple of Step
    demodulated : Demodulated
        The windows, with rest positions corrected for the changes of the heights.

    Notes
    -----
    Windows that contain a step have a valid rest position only after the subtraction. A straight line is fitted at the
    same time, so that a drift does not pass for a step's height.
    """
    rest = _Windows.of(demodulated, change_points.Params().false_alarm)
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
    """Rest positions of the windows, without single outliers, and their uncertainty.

    ``u`` includes the differences between neighbours, so that beats do not count as steps.
    """

    t: F8
    y: F8
    u: float

    @classmethod
    def of(cls, demodulated: Demodulated, false_alarm: float) -> _Windows:
        offset = demodulated.offset
        apart = mad_sigma(np.diff(offset)) / math.sqrt(2.0) if offset.size > 1 else 0.0
        stated = median(np.sqrt(demodulated.covariance[:, 2, 2]))
        u = max(stated, apart, FINEST * float(np.max(np.abs(demodulated.amplitude))), 1e-100)
        kept = ~lone_points(offset[None], np.full((1, offset.size), u), false_alarm)
        return cls(demodulated.t[kept], offset[kept], u)

    @property
    def spacing(self) -> float:
        """Time between windows, s."""
        return median(np.diff(self.t))


def _place(t: F8, still: F8, rest: _Windows, index: int, chances: dict[int, float], params: Params) -> Step | None:
    """Locate a jump of the rest position to the sample, near where the windows show it; None if it is gradual."""
    apart, edges = params.changes.apart, [0, *chances, rest.t.size]
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
    # Clipped, because outliers would attract the position of the jump.
    middle, apart_m = float(np.median(y)), float(np.median(y[: cuts[0]]) - np.median(y[cuts[-1] :]))
    reach = 4.0 * noise + 0.5 * abs(apart_m)
    y = np.clip(y, middle - reach, middle + reach)
    gain = _gains(np.cumsum(y - y.mean()), cuts)
    cut = int(cuts[int(np.argmax(gain))])
    ramp = _best_ramp(seconds, y, 0.5 * (seconds[cut - 1] + seconds[cut]), rest.spacing)
    left = y - np.where(np.arange(y.size) < cut, y[:cut].mean(), y[cut:].mean())
    if gain.max() - ramp < params.sudden * float(np.var(left)) * correlation_length(left):
        return None
    height = float(np.median(y[cut:]) - np.median(y[:cut]))
    doubt = POSSIBLE_DRAW * (noise / height) ** 2 if height else y.size
    u_time = float(np.median(np.diff(seconds))) * math.hypot(0.5, min(doubt, 0.5 * y.size))
    # Uncertainty of a difference of medians.
    u_height = 1.25 * rest.u * math.sqrt(1.0 / max(index - first, 1) + 1.0 / max(last - index + 1, 1))
    when = 0.5 * float(seconds[cut - 1] + seconds[cut])
    return Step(Estimate(when, u_time, "s"), Estimate(height, u_height, "m"), chances[index])


def _gains(sums: F8, cuts: NDArray[np.int64]) -> F8:
    """Return the reduction of the sum of squares by a jump at each cut, from the values' cumulative sums."""
    before, n = cuts.astype(np.float64), float(sums.size)
    return np.asarray(sums[cuts - 1] ** 2 * n / (before * (n - before)))


def _best_ramp(t: F8, y: F8, centre: float, period: float) -> float:
    """Return the reduction of the sum of squares by the best of several ramps, one period or longer, around a time."""
    centred, best = y - y.mean(), 0.0
    for width in (period, 2.0 * period, 4.0 * period, 8.0 * period, 2.0 * float(np.ptp(t))):
        for shift in np.linspace(-0.75, 0.75, 7):
            ramp = np.clip((t - centre - shift * period) / width + 0.5, 0.0, 1.0)
            ramp -= ramp.mean()
            power = float(ramp @ ramp)
            best = max(best, float(ramp @ centred) ** 2 / power if power > 0 else 0.0)
    return best
