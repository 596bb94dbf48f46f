"""Change points: jumps in a series of windows, found by a test with a stated false-alarm probability."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_LINE, normal_quantile
from pipeline.numerics.robust import mad_sigma
from pipeline.track import F8

I8 = NDArray[np.int64]
# Numbers of points in an interval, in ascending order. Lengths that double lose less than a tenth of the power
# between two lengths [1]_. Fewer than 8 points leave no degrees of freedom. Over more than 32 periods, drag and drift
# are no longer cubic.
LENGTHS = (10, 18, 32)
# Share of the intervals whose scatter is taken as typical: a jump lies in at most two thirds of them (see `_scatter`),
# so the rest is free of it with a probability of one.
UNDISTURBED = 1 / 3


def find_changes(t: F8, y: F8, u: F8) -> list[int]:
    """Return the first points after the jumps of a series of several components, in order of time.

    In an interval of L points each component is a polynomial with a jump at point k,
    :math:`y_j = p(t_j) + h\\,[j \\ge k]`, where p is a cubic, or a parabola in the shortest intervals. A jump in all m
    components together lowers chi-square by G(k) to X(k), with :math:`\\nu` remaining degrees of freedom:

    .. math:: F = \\frac{G/m}{\\max(1, X/\\nu)\\,\\lambda}, \\qquad \\lambda = \\frac{1 + \\rho}{1 - \\rho},

    with the correlation :math:`\\rho \\ge 0` of neighbouring residuals. So points with more scatter than stated, with
    correlation, or with a curve that p cannot follow carry less weight. F is compared with the quantile of the F
    distribution with m and :math:`\\nu/\\lambda` degrees of freedom, at :data:`FALSE_ALARM` over the number of tests.
    This is Bonferroni's bound for normal noise of unknown variance; it is conservative where the variance is known.

    The intervals are seeded [1]_: intervals of each length begin a quarter of this length apart. The series is split at
    the strongest jump of the shortest length that shows any (narrowest over threshold [2]_). A short interval contains
    at most one jump, and the polynomial is nearly exact there. Then the search continues in both parts.

    .. [1] S. Kovacs, P. Buehlmann, H. Li, A. Munk, "Seeded binary segmentation", Biometrika 110 (2023) 249,
       doi:10.1093/biomet/asac052.
    .. [2] R. Baranowski, Y. Chen, P. Fryzlewicz, "Narrowest-over-threshold detection of multiple change points",
       J. R. Statist. Soc. B 81 (2019) 649, doi:10.1111/rssb.12322.

    >>> t = np.arange(40.0)
    >>> y = 1e-3 * t + np.where(t < 25.0, 0.0, 1.0) + 0.1 * np.random.default_rng(1).standard_normal(40)
    >>> find_changes(t, y[None], np.full((1, 40), 0.1))
    [25]
    """
    scatter = _scatter(t, y, u)
    trials = sum(length * _starts(t.size, length).size for length in LENGTHS if length <= t.size)
    found = set[int]()
    parts = [(0, t.size)]
    while parts:
        first, stop = parts.pop()
        for length in LENGTHS:
            if length > stop - first:
                break
            after = _strongest(t[first:stop], y[:, first:stop], scatter[length][:, first:stop], length, trials)
            if after is not None:
                found.add(first + after)
                parts += [(first, first + after), (first + after, stop)]
                break
    # Two jumps with a single point between them are one jump, whose side of the point is arbitrary.
    return sorted(index for index in found if index + 1 not in found)


def lone_points(y: F8, u: F8, false_alarm: float) -> NDArray[np.bool_]:
    """Return (n,) bool: True for single outliers, caused by clusters of echoes or by a jump within a window.

    Such a point lies far from interpolations between its neighbours and from extrapolations of the two points before or
    after it. The first and last two points are never outliers. The maximum of n normal deviations in two components
    exceeds :math:`\\sqrt{2 \\ln(n/\\alpha)}` with probability :math:`\\alpha`. A mean of two neighbours adds half the
    variance.
    """
    if y.shape[1] < 5:
        return np.zeros(y.shape[1], np.bool_)
    before2, before, here, after, after2 = (y[:, k : y.shape[1] - 4 + k] for k in range(5))
    expected = (0.5 * (before + after), 0.5 * (before2 + after2), 2.0 * before - before2, 2.0 * after - after2)
    off = np.min([np.abs(here - each) for each in expected], axis=0)
    usual = np.maximum(math.sqrt(1.5) * u[:, 2:-2], [[mad_sigma(each)] for each in off])
    far = math.sqrt(2.0 * math.log(y.shape[1] / false_alarm))
    found = np.concatenate([[False, False], np.any(off > far * usual, axis=0), [False, False]])
    # Several in succession are no outliers, but a curve.
    beside = np.convolve(found, [1.0, 0.0, 1.0], "same") > 0.0
    return found & ~beside


def _starts(size: int, length: int) -> I8:
    """Return the first points of the intervals of a length: a quarter of it apart, and one at the end."""
    return np.unique(np.append(np.arange(0, size - length + 1, length // 4), size - length))


def _strongest(t: F8, y: F8, u: F8, length: int, trials: int) -> int | None:
    """Return the first point after the strongest jump in an interval of one length; None if none is significant."""
    from scipy.special import fdtrc, fdtri

    starts = _starts(t.size, length)
    rows = starts[:, None] + np.arange(length)
    x = t[rows]
    powers = _powers((x - x.mean(axis=1, keepdims=True)) / (0.5 * (x[:, -1:] - x[:, :1])))
    weight = 1.0 / u[:, rows]  # (m, intervals, length)
    m, dof = len(y), len(y) * (length - powers.shape[2] - 1)
    weighted = weight * y[:, rows]
    basis = np.linalg.qr(weight[..., None] * powers)[0]
    left = weighted - (basis @ (basis.swapaxes(2, 3) @ weighted[..., None]))[..., 0]
    gain = _gains(weight, basis, left)
    after = np.maximum(np.sum(left**2, axis=(0, 2))[:, None] - gain, 0.0)
    statistic = np.where(_allowed(starts, length, t.size), gain / m, 0.0) / np.maximum(1.0, after / dof)
    highest, chance = np.max(statistic, axis=1), FALSE_ALARM / trials
    # No quantile of F is below that of chi-square.
    if m * float(highest.max()) < normal_quantile(1.0 - chance) ** 2:
        return None
    best, found = 0.0, None
    for i in np.flatnonzero(highest > fdtri(m, dof, 1.0 - chance)).tolist():
        k = int(np.argmax(statistic[i]))
        design = np.column_stack([powers[i], np.arange(length) >= k])
        fits = zip(weight[:, i, :, None] * design, weighted[:, i], strict=True)
        reach = _correlation(np.array([each - w @ np.linalg.lstsq(w, each, rcond=None)[0] for w, each in fits]))
        corrected = float(highest[i]) / reach
        if corrected > best and fdtrc(m, dof / reach, corrected) < chance:
            best, found = corrected, int(starts[i]) + k
    return found


def _scatter(t: F8, y: F8, u: F8) -> dict[int, F8]:
    """Return, by interval length, (m, n): u plus the typical misfit of a polynomial, added in quadrature.

    A series that fluctuates throughout, for example with a second mode, has no jump, although its fluctuations have a
    maximum. A jump lies in L/(n - L) of the intervals of length L: in at most two thirds of them if the series has at
    least 2.5 L points. A shorter series takes the excess of the next shorter length.
    """
    excess = np.zeros((len(y), 1))
    found = {}
    for length in LENGTHS:
        if t.size >= 2.5 * length:
            rows = _starts(t.size, length)[:, None] + np.arange(length)
            x = t[rows] - t[rows].mean(axis=1, keepdims=True)
            powers = _powers(x / np.max(np.abs(x)))
            fitted = powers @ np.linalg.pinv(powers)
            free = length - powers.shape[2]
            left = y[:, rows] - np.einsum("ijk,mik->mij", fitted, y[:, rows])
            noise = np.sum(u[:, rows] ** 2 * (1.0 - np.diagonal(fitted, axis1=1, axis2=2)), axis=2)
            beyond = (np.sum(left**2, axis=2) - noise) / free
            excess = np.sqrt(np.maximum(np.quantile(beyond, UNDISTURBED, axis=1), 0.0))[:, None]
        found[length] = np.hypot(u, excess)
    return found


def _powers(x: F8) -> F8:
    """Return (intervals, length, degree + 1): powers of the times of intervals, up to cubes in all but short ones."""
    return np.asarray(x[..., None] ** np.arange(4 if x.shape[1] > LENGTHS[0] else 3))


def _gains(weight: F8, basis: F8, left: F8) -> F8:
    """Return (intervals, length): the amount by which a jump before each point lowers chi-square.

    Cumulative sums from the end give the scalar products of each step with the residuals and with the basis.
    """
    total = _from_end(weight**2)
    own = total - np.sum(_from_end(weight[..., None] * basis) ** 2, axis=3)
    # A step that the polynomial can represent to rounding is no jump.
    own = np.where(own > 1e-9 * total[:, :, :1], own, np.inf)
    return np.asarray(np.sum(_from_end(weight * left) ** 2 / own, axis=0))


def _from_end(values: F8) -> F8:
    return np.asarray(np.cumsum(values[:, :, ::-1], axis=2)[:, :, ::-1])


def _allowed(starts: I8, length: int, size: int) -> NDArray[np.bool_]:
    """Return (intervals, length): whether to test a jump before a point.

    Two bad windows at an interval's end are no jump, unless it is an end of the series.
    """
    k, apart = np.arange(length), min(FEWEST_FOR_LINE, length // 4)
    first = np.where(starts == 0, 1, apart)[:, None]
    last = np.where(starts + length == size, length - 1, length - apart)[:, None]
    return np.asarray((k >= first) & (k <= last))


def _correlation(residual: F8) -> float:
    """Return the number of points that count as one, from the correlation of neighbouring residuals (m, length)."""
    rho = float(np.sum(residual[:, 1:] * residual[:, :-1])) / max(float(np.sum(residual**2)), 1e-300)
    return (1.0 + rho) / (1.0 - rho) if rho > 0.0 else 1.0
