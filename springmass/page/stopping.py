"""When to stop: intervals valid at any stopping time, and the time until a wanted uncertainty is reached.

Somebody who watches an interval shrink and stops when it looks good has looked many times. An interval of two standard
uncertainties then misses the true value far more often than one time in twenty. A confidence sequence covers the true
value at all times simultaneously.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.track import F8

__all__ = ["ALPHA", "more_seconds", "widening"]

ALPHA = 0.05
TIGHTEST = 0.12
"""Ratio of the mixture's information to the record's at which a 95 % sequence is tightest."""
FARTHEST = 50.0
"""The longest forecast, in multiples of the time recorded so far."""


def widening(u: float, wanted_u: float) -> float:
    """Return the half-width in units of u of an interval with 95 % coverage at any stopping time.

    Parameters
    ----------
    u : float
        Standard uncertainty of the estimate now.
    wanted_u : float
        Standard uncertainty to reach, in the unit of ``u`` and chosen before the recording; the interval is tightest
        there.

    Returns
    -------
    float
        The factor: 3.0 at ``wanted_u``, and larger before and after.

    Notes
    -----
    The normal mixture of Robbins: with the information :math:`V = u^{-2}` and :math:`\\rho` fixed beforehand,
    :math:`|\\hat\\theta - \\theta| < u\\sqrt{(1 + \\rho/V)\\ln((1 + V/\\rho)/\\alpha^2)}` for all V simultaneously,
    with a probability of at least :math:`1 - \\alpha`. The increments of the estimate in V must be independent, as they
    are for the slope of a phase. Howard, Ramdas, McAuliffe, Sekhon, Annals of Statistics 49 (2021) 1055, eq. 14.

    Examples
    --------
    >>> [round(widening(u, 1e-5), 2) for u in (1e-4, 1e-5, 2e-6)]
    [8.88, 3.04, 3.37]
    """
    ratio = TIGHTEST * (u / wanted_u) ** 2
    return math.sqrt((1.0 + ratio) * math.log((1.0 + 1.0 / ratio) / ALPHA**2))


def more_seconds(u: float, wanted_u: float, seconds: float, amplitude: Callable[[F8], F8]) -> float:
    """Return how much longer to record until a period, or a frequency, has a wanted uncertainty.

    Parameters
    ----------
    u, wanted_u : float
        Standard uncertainty now, and the wanted one.
    seconds : float
        Duration of the recording so far.
    amplitude : callable
        The fitted law, which is extrapolated: it returns amplitudes at times (n,) in s from the start.

    Returns
    -------
    float
        Time in s: 0 if the wanted uncertainty is already reached; infinity if the swing dies out first, or if the
        recording would have to last more than fifty times as long as now.

    Notes
    -----
    The information on the slope of the phase grows as :math:`J(t) = \\int A^2 (s - \\bar s)^2 ds` where :math:`\\bar s`
    is the mean time weighted by :math:`A^2`; u falls as :math:`J^{-1/2}`.

    Examples
    --------
    A steady swing: u falls with the power 3/2 of the time.

    >>> round(more_seconds(8.0, 1.0, 10.0, lambda t: np.ones_like(t)))
    30
    """
    if u <= wanted_u:
        return 0.0
    times = seconds * np.geomspace(1e-3, FARTHEST, 4000)
    steps = np.diff(times, prepend=0.0)
    weight = amplitude(times) ** 2 * steps
    w, wt, wtt = np.cumsum(weight), np.cumsum(weight * times), np.cumsum(weight * times**2)
    information = wtt - wt**2 / w
    now = float(np.interp(seconds, times, information))
    reached = np.flatnonzero(information >= now * (u / wanted_u) ** 2)
    return float(times[reached[0]] - seconds) if reached.size else math.inf
