"""Robust statistics: standard deviations of normal distributions, estimated from medians."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.track import F8

MAD_TO_SIGMA = 1.482602218505602  # 1 / Phi^-1(3/4): P. J. Rousseeuw, C. Croux, J. Am. Stat. Assoc. 88 (1993) 1273

# Relative standard uncertainty of that estimate from n normal deviates, times the root of n: its efficiency is 37 %,
# Rousseeuw and Croux (1993). It is also the relative change per share of outliers: 0.5/(2 phi(0.6745) 0.6745).
U_OF_MAD = 1.17


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
    return MAD_TO_SIGMA * median(np.abs(deviation))
