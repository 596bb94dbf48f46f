"""Robust statistics: medians, and what they say of a normal spread."""

from __future__ import annotations

import numpy as np

from pipeline.track import F8

__all__ = ["MAD_TO_SIGMA", "median", "median_size"]

MAD_TO_SIGMA = 1.482602218505602  # 1 / Phi^-1(3/4)


def median(values: F8) -> float:
    """Return the median of finite values (n,), n at least 1.

    Examples
    --------
    >>> median(np.array([3.0, 1.0, 2.0])), median(np.array([4.0, 1.0, 2.0, 3.0]))
    (2.0, 2.5)
    """
    return _middle(values.copy())


def median_size(values: F8, count: int | None = None) -> float:
    """Return the median of the absolute values of finite values (n,), n at least 1.

    Parameters
    ----------
    values : (n,) float64
    count : int, optional
        How many of them are finite, at least 1, where not all are; the others, infinite or NaN, are left out.

    Examples
    --------
    >>> median_size(np.array([-3.0, 1.0, 2.0]))
    2.0
    >>> median_size(np.array([-3.0, np.nan, 1.0, 2.0, np.nan]), 3)
    2.0
    """
    return _middle(np.abs(values), count)


def _middle(values: F8, count: int | None = None) -> float:
    """The median of values that may be reordered; what is not finite sorts last."""
    count = values.size if count is None else count
    half = count // 2
    values.partition(half)
    upper = float(values[half])
    return upper if count % 2 else 0.5 * (float(values[:half].max()) + upper)
