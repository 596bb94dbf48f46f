"""When to stop: intervals that cover whenever somebody stops, and how long until a wanted uncertainty is reached.

Somebody who watches an interval shrink and stops when it looks good has looked many times. An interval of two standard
uncertainties then misses far more often than one time in twenty; a confidence sequence covers at all times together.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.track import F8

__all__ = ["ALPHA", "more_seconds", "widening"]

ALPHA = 0.05
TIGHTEST = 0.12
"""Ratio of the mixture's information to the record's at which the sequence is tightest, for 95 %."""
FARTHEST = 50.0
"""The longest forecast, in multiples of the time recorded so far."""


def widening(u: float, wanted_u: float) -> float:
    """Return by how many u an interval reaches to both sides that covers 95 % whenever one stops.

    Parameters
    ----------
    u : float
        Standard uncertainty of the estimate now.
    wanted_u : float
        The one to record for, in the same unit and chosen before the recording: there the interval is tightest.

    Returns
    -------
    float
        3.0 at ``wanted_u``, more before and after.

    Notes
    -----
    The normal mixture of Robbins: with the information :math:`V = u^{-2}` and :math:`\\rho` fixed beforehand,
    :math:`|\\hat\\theta - \\theta| < u\\sqrt{(1 + \\rho/V)\\ln((1 + V/\\rho)/\\alpha^2)}` for all V together, with a
    probability of at least :math:`1 - \\alpha`. The increments of the estimate in V must be independent, as those of a
    phase's slope are.
    Howard, Ramdas, McAuliffe, Sekhon, Annals of Statistics 49 (2021) 1055, eq. 14.

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
        Now, and wanted.
    seconds : float
        Recorded so far.
    amplitude : callable
        Of times (n,) in s from the start: the fitted law, which is extrapolated.

    Returns
    -------
    float
        0 where it is reached; infinity where the swing dies out first, or it takes more than fifty times as long.

    Notes
    -----
    The information on the slope of the phase grows as :math:`J(t) = \\int A^2 (s - \\bar s)^2 ds` with
    :math:`\\bar s` the mean time by :math:`A^2`; u falls as :math:`J^{-1/2}`.

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
