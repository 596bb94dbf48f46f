"""Shapes that a relaxation could be mistaken for: drifts, steps and ramps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.track import F8

__all__ = ["other_shapes"]


def other_shapes(t: F8, y: F8) -> Iterator[tuple[float, int]]:
    """Fit polynomials to the third degree, every step and every ramp.

    Parameters
    ----------
    t, y : (n,) float64
        Ascending times from 0, s, and distances, m.

    Yields
    ------
    left : float
        Squares that a shape leaves, m^2; of the steps, and of each degree, the best.
    count : int
        Its parameters.
    """
    x = 2.0 * t / t[-1] - 1.0
    for degree in range(4):
        yield _left(np.polynomial.legendre.legvander(x, degree), y), degree + 1
    n = t.size
    splits = np.arange(3, n - 3)
    total, squares = np.cumsum(y), float(y @ y)
    before, after = total[splits - 1] ** 2 / splits, (total[-1] - total[splits - 1]) ** 2 / (n - splits)
    yield squares - float(np.max(before + after)), 3
    knots = np.linspace(t[0], t[-1], 26)
    for i, first in enumerate(knots[:-1]):
        for last in knots[i + 1 :]:
            ramp = np.clip((t - first) / (last - first), 0.0, 1.0)
            yield _left(np.stack([np.ones(n), ramp], axis=1), y), 4


def _left(design: F8, y: F8) -> float:
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    residual: F8 = y - design @ values
    return float(np.sum(residual**2))
