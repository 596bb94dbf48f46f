"""Robust statistics: standard deviations of normal distributions, estimated from medians."""

from __future__ import annotations

from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.levels import normal_quantile
from pipeline.track import F8

# The median absolute value of normal deviates, over their standard deviation: P. J. Rousseeuw, C. Croux, J. Am. Stat.
# Assoc. 88 (1993) 1273.
_MAD = normal_quantile(0.5)
# Relative standard uncertainty of a standard deviation from the median of n normal deviates, times the root of n: the
# efficiency is 37 %. It is also the relative change per share of outliers.
U_OF_MAD = 0.25 / (NormalDist().pdf(_MAD) * _MAD)


def median(x: NDArray[np.number[Any]]) -> float:
    """Return the median of (n,) numbers without NaN, for 160 values in a tenth of the time of ``numpy.median``."""
    half = x.size // 2
    ordered = np.partition(x, half)
    upper = float(ordered[half])
    return upper if x.size % 2 else 0.5 * (float(ordered[:half].max()) + upper)


def mad_sigma(deviation: F8) -> float:
    """Return the standard deviation of a normal distribution with the median absolute value of (n,) deviations.

    >>> round(mad_sigma(np.array([-0.3, 0.1, 0.2])), 3)
    0.297
    """
    return median(np.abs(deviation)) / _MAD
