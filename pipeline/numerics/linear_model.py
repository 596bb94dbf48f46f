"""A linear model that grows by columns: fits of a search that adds one term after another to a long record.

``numpy.linalg.lstsq`` or ``qr`` of all columns at each trial took 0.1 s of the 0.13 s of a two-minute recording's
analysis. Here the columns known so far are kept as an orthonormal basis, so that a trial costs its own columns only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.track import F8

__all__ = ["LinearModel", "Terms"]


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """Columns that may enter a model, as it sees them.

    Parameters
    ----------
    along : (p, k) float64
        Their projections on the model's basis.
    q : (n, k) float64
        Orthonormal columns of what lies beyond the basis.
    r : (k, k) float64
        Upper triangular: columns = basis @ along + q @ r.
    share : (k,) float64
        Of what the model leaves, along q: its squares sum to the fall of chi-square that the terms bring.
    """

    along: F8
    q: F8
    r: F8
    share: F8

    def first(self, count: int) -> Terms:
        """Return the first ``count`` of the terms alone."""
        return Terms(self.along[:, :count], self.q[:, :count], self.r[:count, :count], self.share[:count])

    @property
    def fall(self) -> float:
        """By how much the terms lower chi-square."""
        return float(self.share @ self.share)

    def fitted(self) -> tuple[F8, F8]:
        """Return the terms' coefficients (k,) and their cofactors (k, k): covariance for data of unit variance."""
        inverse = np.linalg.pinv(self.r)
        return inverse @ self.share, inverse @ inverse.T


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
        self.basis = np.empty((data.size, 0))
        self.left = data
        self._factor, self._share = np.empty((0, 0)), np.empty(0)
        self.add(self.terms(columns))

    def terms(self, columns: F8) -> Terms:
        """Return what columns (n, k) would add."""
        along = self.basis.T @ columns
        q, r = np.linalg.qr(columns - self.basis @ along)
        return Terms(along, q, r, q.T @ self.left)

    def add(self, terms: Terms) -> None:
        """Take terms in, made by :meth:`terms` of the model as it is."""
        # A second projection takes out what rounding left of the basis where columns nearly lie in it.
        more = self.basis.T @ terms.q
        q, r = np.linalg.qr(terms.q - self.basis @ more)
        share = q.T @ self.left
        corner = np.zeros((q.shape[1], self.basis.shape[1]))
        self._factor = np.block([[self._factor, terms.along + more @ terms.r], [corner, r @ terms.r]])
        self._share = np.concatenate([self._share, share])
        self.basis = np.concatenate([self.basis, q], axis=1)
        self.left = self.left - q @ share

    def coefficients(self) -> F8:
        """Return the coefficients (p,) of all columns in the order in which they came, fitted together."""
        return np.asarray(np.linalg.lstsq(self._factor, self._share, rcond=None)[0])
