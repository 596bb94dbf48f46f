"""The inverse of a normal matrix of up to three parameters; numpy's, made for large ones, takes twice as long."""

from __future__ import annotations

import numpy as np

from pipeline.track import F8

__all__ = ["inverse_of"]

_UNIT = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def inverse_of(normal: F8) -> F8 | None:
    """Return the inverse (p, p) of a positive definite matrix (p, p), p at most 3; None where it is not one.

    Parameters
    ----------
    normal : (p, p) float64
        Sums of products of derivatives.

    Notes
    -----
    Elimination without pivots, :math:`LDL^T`: safe for positive definite matrices, and its error is the rounding times
    the condition of the matrix scaled to a unit diagonal, whatever units the parameters have [1]_.

    References
    ----------
    .. [1] J. W. Demmel, "On floating point errors in Cholesky", LAPACK Working Note 14 (1989).

    Examples
    --------
    >>> inverse_of(np.array([[2.0, 1.0], [1.0, 1.0]]))
    array([[ 1., -1.],
           [-1.,  2.]])
    """
    p = len(normal)
    whole = [row + unit[p:] for row, unit in zip(normal.tolist(), _UNIT[:p], strict=True)] + _UNIT[p:]
    (a, b, c), (_, d, e), (_, _, f) = whole
    if not a > 0.0:
        return None
    second, third = b / a, c / a
    d, e, f = d - second * b, e - second * c, f - third * c
    if not d > 0.0:
        return None
    last = e / d
    f -= last * e
    if not f > 0.0:
        return None
    corner = third - second * last
    cc = 1.0 / f
    bc, bb = -last * cc, 1.0 / d + last * last * cc
    ac = -corner * cc
    ab = -second / d - corner * bc
    aa = 1.0 / a - second * ab - third * ac
    return np.array([[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]])[:p, :p]
