"""Robust statistics: what a median says of a normal spread."""

from __future__ import annotations

import numpy as np

from pipeline.track import F8

__all__ = ["MAD_TO_SIGMA", "mad_sigma"]

MAD_TO_SIGMA = 1.482602218505602  # 1 / Phi^-1(3/4)


def mad_sigma(deviation: F8) -> float:
    """Return the standard deviation of a normal distribution with the median absolute value of (n,) deviations.

    Examples
    --------
    >>> round(mad_sigma(np.array([-0.3, 0.1, 0.2])), 3)
    0.297
    """
    return MAD_TO_SIGMA * float(np.median(np.abs(deviation)))
