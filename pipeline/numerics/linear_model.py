"""A linear model that grows by columns: the fits of a search that adds one term after another to a long record.

``numpy.linalg.lstsq`` or ``qr`` of all columns at each trial took 0.1 s of the 0.13 s of a two-minute recording's
analysis. Here the columns known so far are kept as an orthonormal basis, so that a trial costs the sums of its own few
columns: the normal equations of what these hold beyond the basis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.track import F8

__all__ = ["LinearModel", "Terms"]

RIDGE = 1e-12  # of a column's square: far below what is measured, far above what rounding leaves of it


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """Columns C that may enter a model, and the normal equations of what they hold beyond its basis Q.

    Parameters
    ----------
    columns : (n, k) float64
    along : (p, k) float64
        :math:`Q^T C`.
    normal : (k, k) float64
        :math:`C^T C - (Q^T C)^T Q^T C`.
    right : (k,) float64
        :math:`C^T` times what the model leaves.
    """

    columns: F8
    along: F8
    normal: F8
    right: F8

    def only(self, which: slice | list[int]) -> Terms:
        """Return some of the terms."""
        return Terms(self.columns[:, which], self.along[:, which], self.normal[which][:, which], self.right[which])

    def fitted(self) -> tuple[F8, F8, float]:
        """Return the terms' coefficients (k,), their cofactors (k, k) and by how much they lower chi-square.

        Cofactors are the covariance for data of unit variance.
        """
        cofactors: F8 = np.asarray(np.linalg.inv(self.normal), np.float64)
        values = cofactors @ self.right
        return values, cofactors, float(values @ self.right)

    def falls(self) -> F8:
        """Return (k,): by how much the first, the first two, ... and all terms lower chi-square.

        Examples
        --------
        >>> x = np.arange(4.0)
        >>> terms = LinearModel(x**2, np.ones((4, 1))).terms(np.stack([x, x**2], axis=1))
        >>> terms.falls().round(6), round(terms.only([0]).fitted()[2], 6)
        (array([45., 49.]), 45.0)
        """
        return np.asarray(np.cumsum(np.linalg.solve(np.linalg.cholesky(self.normal), self.right) ** 2))


class LinearModel:
    """Data and the columns that were fitted to them so far.

    Parameters
    ----------
    data : (n,) float64
        Over their standard uncertainty, or times the root of their weight, as the columns.
    columns : (n, p) float64

    Attributes
    ----------
    basis : (n, p) float64
        Orthonormal.
    left : (n,) float64
        What the columns leave of the data.

    Examples
    --------
    >>> x = np.arange(4.0)
    >>> model = LinearModel(1.0 + 2.0 * x + 3.0 * x**2, np.stack([np.ones(4), x], axis=1))
    >>> model.add(model.terms(x[:, None] ** 2))
    >>> model.coefficients().round(9)
    array([1., 2., 3.])
    """

    def __init__(self, data: F8, columns: F8) -> None:
        self.basis, self._factor = np.linalg.qr(columns)
        self._share = self.basis.T @ data
        self.left = data - self.basis @ self._share

    def terms(self, columns: F8) -> Terms:
        """Return what columns (n, k) would add."""
        along, squares = self.basis.T @ columns, columns.T @ columns
        # A trace of ridge lets a column that the model holds already come out as nothing.
        normal = squares - along.T @ along
        normal.flat[:: normal.shape[0] + 1] += RIDGE * np.diagonal(squares) + 1e-300
        return Terms(columns, along, normal, columns.T @ self.left)

    def left_by(self, terms: Terms, values: F8) -> F8:
        """Return what the model leaves (n,) together with terms of coefficients (k,)."""
        return self.left - terms.columns @ values + self.basis @ (terms.along @ values)

    def add(self, terms: Terms) -> None:
        """Take terms in, made by :meth:`terms` of the model as it is."""
        beyond = terms.columns - self.basis @ terms.along
        # A second projection takes out what rounding left of the basis where columns nearly lie in it.
        more = self.basis.T @ beyond
        q, r = _orthonormal(beyond - self.basis @ more)
        share = q.T @ self.left
        before, factor = self._share.size, np.zeros((self._share.size + r.shape[0],) * 2)
        factor[:before, :before], factor[before:, before:] = self._factor, r
        factor[:before, before:] = terms.along + more
        self._factor = factor
        self._share = np.concatenate([self._share, share])
        self.basis = np.concatenate([self.basis, q], axis=1)
        self.left = self.left - q @ share

    def coefficients(self) -> F8:
        """Return the coefficients (p,) of all columns in the order in which they came, fitted together."""
        return np.asarray(np.linalg.solve(self._factor, self._share))

    def falls(self) -> F8:
        """Return by how much each column (p,), the others given, lowers chi-square."""
        inverse = np.linalg.inv(self._factor)
        return np.asarray((inverse @ self._share) ** 2 / np.sum(inverse**2, axis=1))


def _orthonormal(columns: F8) -> tuple[F8, F8]:
    """QR factors of columns (n, k); of a single one without LAPACK, which takes six times as long."""
    if columns.shape[1] > 1:
        q, r = np.linalg.qr(columns)
        return q, r
    length = np.linalg.norm(columns)
    return columns / length, np.full((1, 1), length)
