"""When to stop: the time until a wanted uncertainty is reached."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.track import F8

FARTHEST = 50.0
"""The longest forecast, in multiples of the time recorded so far."""


def more_seconds(u: float, wanted_u: float, seconds: float, amplitude: Callable[[F8], F8]) -> float:
    """Return how much longer to record until a period, or a frequency, has a wanted uncertainty.

    ``seconds`` is the duration so far. ``amplitude`` is the fitted law, which is extrapolated. The information on the
    slope of the phase grows as :math:`J(t) = \\int A^2 (s - \\bar s)^2 ds` where :math:`\\bar s` is the mean time
    weighted by :math:`A^2`; u falls as :math:`J^{-1/2}`. The result is infinite if the swing dies out first, or if the
    recording would have to last more than fifty times as long as now.

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
