"""How much longer to record until two laws of damping can be told from one another, as a range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.damping.law_fit import minimum_of
from pipeline.damping.select import Damping
from pipeline.damping.select import Params as DampingParams
from pipeline.track import F8

__all__ = ["Need", "seconds_to_tell"]

PAIR = ("linear", "quadratic")
POINTS = 120
"""The windows of a record, however many, are stood for by so many points of the same information."""
HORIZONS = 18
FARTHEST = 20.0
"""No need is foretold beyond so many times what has been recorded."""
LEVELS = (0.1, 0.5, 0.9)
LEAST_WINDOWS = 6


@dataclass(frozen=True, slots=True)
class Need:
    """When two laws can be told apart.

    Parameters
    ----------
    law, rival : str
        The one that fits better so far, and the other.
    told : bool
        Whether the evidence between them is strong already.
    low_s, median_s, high_s : float
        How much longer to record, s: within the first one time in ten, within the second half of the times, within the
        third nine times in ten; infinity where that is more than twenty times what has been recorded. 0 where told.
    """

    law: str
    rival: str
    told: bool
    low_s: float = 0.0
    median_s: float = 0.0
    high_s: float = 0.0


def seconds_to_tell(damping: Damping, end: float) -> Need | None:
    """Return how much longer to record to tell linear from quadratic drag; None where one of them was not fitted.

    Parameters
    ----------
    damping : Damping
    end : float
        Time of the last sample, s.

    Notes
    -----
    Let :math:`D` be the difference of the two laws' BIC and :math:`\\lambda(T)` the least chi-square that the rival
    leaves of a record of length T that follows the law exactly. For points that follow the law, D grows with
    :math:`\\lambda` as a Brownian motion of drift 1 and variance 4 (the log-likelihood ratio of two normal hypotheses),
    so that the :math:`\\lambda` still needed to reach the level of strong evidence, 6, follows the inverse Gaussian
    distribution of mean a and shape :math:`a^2/4`, a being what D lacks. That the law which fits better so far is the
    wrong one has the chance :math:`1/(1 + e^{D/2})`; D must then go all the way to -6, and its distribution enters with
    that weight. R. S. Chhikara, J. L. Folks, The Inverse Gaussian Distribution (1989), section 1.4.
    """
    fits = {name: damping.fits[name] for name in PAIR if name in damping.fits}
    kept = damping.scatter.kept
    if len(fits) < len(PAIR) or np.count_nonzero(kept) < LEAST_WINDOWS:
        return None
    law, rival = sorted(fits, key=lambda name: fits[name].bic)
    difference = fits[rival].bic - fits[law].bic
    level = DampingParams().evidence
    if difference >= level:
        return Need(law, rival, True)
    seconds = end - damping.t0
    horizons = seconds * np.geomspace(1.0, FARTHEST, HORIZONS)
    separation = _separation(damping, law, rival, horizons)
    gained = np.maximum.accumulate(separation - separation[0])
    chance = _chance(gained, difference, level)
    more = [_first(horizons, chance, wanted) - seconds for wanted in LEVELS]
    return Need(law, rival, False, *(max(each, 0.0) for each in more))


def _separation(damping: Damping, law: str, rival: str, horizons: F8) -> F8:
    """Return the least chi-square that a law leaves of curves of the other, as long as each horizon."""
    best, other = damping.fits[law], damping.fits[rival].law
    kept = np.flatnonzero(damping.scatter.kept)
    # One point stands for so many seconds at that uncertainty, however the horizon is divided into points.
    spacing = (horizons[0] / kept.size) * damping.scatter.correlation
    u = float(np.median(damping.scatter.u[kept]))
    found = np.empty(horizons.size)
    for number, horizon in enumerate(horizons):
        t = horizon * (np.arange(POINTS) + 0.5) / POINTS
        curve = best.amplitude(t)
        each = u * math.sqrt(spacing * POINTS / horizon)
        usable = np.isfinite(curve) & (curve > 0.0)
        if np.count_nonzero(usable) < LEAST_WINDOWS:
            found[number] = found[number - 1] if number else 0.0
            continue
        t, curve = t[usable], curve[usable]
        least = minimum_of(other, t, curve, np.full(t.size, each)).chi2
        found[number] = least if math.isfinite(least) else (found[number - 1] if number else 0.0)
    return found


def _chance(gained: F8, difference: float, level: float) -> F8:
    """Return with what chance the evidence is strong once the separation has grown by so much, (n,)."""
    from scipy.stats import invgauss

    def reached(lack: float) -> F8:
        return np.asarray(invgauss.cdf(gained, 4.0 / lack, scale=lack**2 / 4.0), np.float64)

    wrong = 1.0 / (1.0 + math.exp(difference / 2.0))
    return (1.0 - wrong) * reached(level - difference) + wrong * reached(level + difference)


def _first(horizons: F8, chance: F8, wanted: float) -> float:
    """Return when a chance is reached; infinity where it is not."""
    if chance[-1] < wanted:
        return math.inf
    return float(math.exp(np.interp(wanted, chance, np.log(horizons))))
