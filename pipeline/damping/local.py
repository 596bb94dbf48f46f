"""The decay at the start of a record that no law describes: amplitude and damping rate from the first windows alone."""

from __future__ import annotations

import numpy as np

from pipeline.numerics.estimate import Joint
from pipeline.numerics.levels import FEWEST_FOR_CURVE, FEWEST_FOR_LINE
from pipeline.numerics.regression import Line, Scatter, solve_weighted
from pipeline.track import F8


def local_decay(t: F8, amplitude: F8, expected: F8, spread: Scatter, unit: str) -> Joint | None:
    """Return amplitude and damping rate at time 0 from windows at times t (w,); None with too few of them.

    A quadratic is fitted to the logarithm of the amplitudes until the ``expected`` ones (w,), of the nearest law, have
    fallen half-way in their logarithm. The uncertainty includes the change to two thirds of that length, and for the
    damping rate also the change to a straight line.
    """
    size = np.abs(expected)
    with np.errstate(invalid="ignore"):
        past = np.flatnonzero(~(size > np.sqrt(size[0] * size[-1])))
    count = max(int(past[0]) if past.size else t.size, FEWEST_FOR_CURVE)
    rows = np.flatnonzero(spread.kept & (amplitude > 0.0))[:count]
    fewer = rows[: max(2 * rows.size // 3, FEWEST_FOR_LINE)]
    if rows.size < FEWEST_FOR_LINE:
        return None

    def polynomial(part: np.ndarray, degree: int) -> Line:
        design = np.vander(t[part], degree + 1, increasing=True)
        return solve_weighted(design, np.log(amplitude[part]), spread.u[part] / amplitude[part])

    curve = polynomial(rows, 2)
    widened = spread.correlation * max(curve.chi2 / (rows.size - 3), 1.0)
    covariance = widened * curve.covariance[:2, :2]
    change = polynomial(fewer, 2).values[:2] - curve.values[:2]
    covariance = covariance + np.outer(change, change)
    covariance[1, 1] += (polynomial(rows, 1).values[1] - curve.values[1]) ** 2
    start = float(np.exp(curve.values[0]))
    turn = np.diag([start, -1.0])  # from the logarithm of the amplitude and its slope
    values = np.array([start, -curve.values[1]])
    return Joint(("amplitude", "damping_rate"), values, turn @ covariance @ turn, (unit, "1/s"))
