"""Fit several damping laws to the same points at once: one Levenberg-Marquardt, many rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.laws import Drag, Law
from pipeline.laws.drag import guesses, jacobians_of
from pipeline.track import F8

__all__ = ["Fitted", "Model", "covariance_or_infinite", "fit_laws", "minimise"]

STEPS = 60
SLOTS = 4  # parameters of the richest law of drag


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Where the fit of one law ended.

    Parameters
    ----------
    theta : (p,) float64
    covariance : (p, p) float64
        :math:`(J^T J)^{-1}` from the points' standard uncertainties.
    chi2 : float
    converged : bool
    tried : str
        What was tried, for a fit that did not converge.
    """

    theta: F8
    covariance: F8
    chi2: float
    converged: bool
    tried: str


class Model(Protocol):
    """What :func:`minimise` fits: k rows of parameters, each with a curve of its own through the same points.

    ``free`` is (k, p) bool: which parameters a row has.
    """

    free: NDArray[np.bool_]

    def evaluate(self, rows: NDArray[np.int64], theta: F8) -> tuple[F8, F8]:
        """Return values (r, n) of some rows and their derivatives (r, p, n); theta is (r, p)."""
        ...


class _Batch:
    """Amplitudes and derivatives of several laws, each row one law; laws of drag share one evaluation."""

    def __init__(self, laws: Sequence[Law], t: F8) -> None:
        self.laws, self.t = laws, t
        self.width = max(SLOTS, *(len(law.parameters) for law in laws))
        self.drag = np.array([isinstance(law, Drag) for law in laws])
        self.free = np.zeros((len(laws), self.width), np.bool_)
        self.slots: list[list[int]] = []
        for row, law in enumerate(laws):
            slots = list(law.slots) if isinstance(law, Drag) else list(range(len(law.parameters)))
            self.free[row, slots] = True
            self.slots.append(slots)

    def guess(self, y: F8) -> F8:
        """Return start values, (k, width)."""
        theta = np.zeros(self.free.shape)
        drags = np.flatnonzero(self.drag)
        if drags.size:
            theta[drags, :SLOTS] = guesses(self.t, y, [law for law in self.laws if isinstance(law, Drag)])
        for row in np.flatnonzero(~self.drag):
            theta[row, self.slots[row]] = self.laws[row].guess(self.t, y)
        return theta

    def evaluate(self, rows: NDArray[np.int64], theta: F8) -> tuple[F8, F8]:
        """Return amplitudes (k, n) and their derivatives (k, width, n) of some rows."""
        drags = self.drag[rows]
        if drags.all() and self.width == SLOTS:
            return jacobians_of(self.t, theta)
        amplitude = np.empty((rows.size, self.t.size))
        jacobian = np.zeros((rows.size, self.width, self.t.size))
        if drags.any():
            amplitude[drags], jacobian[drags, :SLOTS] = jacobians_of(self.t, theta[drags, :SLOTS])
        for k in np.flatnonzero(~drags):
            law, slots = self.laws[int(rows[k])], self.slots[int(rows[k])]
            amplitude[k] = law.amplitude(self.t, theta[k, slots])
            jacobian[k, slots] = law.jacobian(self.t, theta[k, slots]).T
        return amplitude, jacobian


def fit_laws(laws: Sequence[Law], t: F8, y: F8, u: F8) -> list[Fitted]:
    """Fit each law to the points by weighted least squares.

    Parameters
    ----------
    laws : sequence of Law
        Each with no more parameters than there are points.
    t, y, u : (n,) float64
        Times in s in ascending order, amplitudes and their standard uncertainties in m.

    Returns
    -------
    list of Fitted
        In the order of ``laws``; not finite where a law's numbers ran out of range.

    Notes
    -----
    Levenberg and Marquardt's method with analytic derivatives, at most sixty steps, on amplitudes in units of their
    root mean square, so that no power of a metre disturbs it. A row leaves the batch when it has converged: when what
    is left of its step is a thousandth of a standard uncertainty (which a bad fit has larger).
    """
    length = float(np.sqrt(np.mean(y * y))) or 1.0
    # Lengths near the smallest number would leave no room for their squares.
    batch = _Batch(laws, t)
    scaled, weight = y / length, length / u
    theta, steps, converged = minimise(batch, scaled, weight, batch.guess(scaled))
    fitted = []
    for row, law in enumerate(laws):
        values = law.rescaled(theta[row, batch.slots[row]], 1.0 / length)
        with np.errstate(all="ignore"):
            residual = (y - law.amplitude(t, values)) / u
            chi2 = float(residual @ residual)
            covariance = covariance_or_infinite(law.jacobian(t, values) / u[:, None])
        note = "" if converged[row] else f"{int(steps[row])} steps of Levenberg-Marquardt from the law's own guess"
        fitted.append(Fitted(values, covariance, chi2, bool(converged[row]), note))
    return fitted


def covariance_or_infinite(jacobian: F8) -> F8:
    """Return :math:`(J^T J)^{-1}` by QR of columns scaled to unit length.

    Parameters
    ----------
    jacobian : (n, p) float64
        Each row divided by its point's standard uncertainty.

    Returns
    -------
    (p, p) float64
        Infinite where the points do not determine every parameter: a pseudo-inverse would call it known.
    """
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.einsum("ni,ni->i", jacobian, jacobian))
    unknown = np.full((scale.size, scale.size), np.inf)
    if not np.isfinite(scale).all() or not scale.all():
        return unknown
    r: F8 = np.asarray(np.linalg.qr(jacobian / scale, mode="r"))
    if r.shape[0] < r.shape[1] or np.abs(np.diagonal(r)).min() <= 1e-13:
        return unknown
    inverse = np.linalg.inv(r) / scale[:, None]
    return np.asarray(inverse @ inverse.T)


def minimise(model: Model, y: F8, weight: F8, theta: F8) -> tuple[F8, NDArray[np.int64], NDArray[np.bool_]]:
    """Minimise every row's chi-square by Levenberg and Marquardt's method.

    Parameters
    ----------
    model : Model
    y, weight : (n,) float64
        Points and reciprocals of their standard uncertainties.
    theta : (k, p) float64
        Start values; changed in place.

    Returns
    -------
    theta : (k, p) float64
    steps : (k,) int64
        Taken by each row.
    converged : (k,) bool
    """
    count, width = theta.shape
    identity = np.eye(width)
    active = np.arange(count)
    damping = np.full(count, 1e-6)
    steps, converged = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    with np.errstate(all="ignore"):
        residual, jacobian, chi2 = _linearised(model, active, theta, y, weight)
        while active.size:
            fixed = ~model.free[active]
            norm = np.sqrt(np.einsum("kpn,kpn->kp", jacobian, jacobian))
            norm[fixed | (norm == 0.0)] = 1.0
            unit = jacobian / norm[:, :, None]
            normal = unit @ unit.transpose(0, 2, 1)
            right = (unit @ residual[:, :, None])[:, :, 0]
            pivot = identity * (damping[active, None] + fixed)[:, None, :]
            sound = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
            normal[~sound], right[~sound] = identity, 0.0
            step = np.linalg.solve(normal + pivot, right[:, :, None])[:, :, 0]
            steps[active] += 1
            trial = theta[active] + step / norm
            new_residual, new_jacobian, new_chi2 = _linearised(model, active, trial, y, weight)
            length = np.einsum("kp,kp->k", step, step)
            gain = chi2 - new_chi2
            better = gain >= 0.0
            theta[active[better]] = trial[better]
            residual[better], jacobian[better], chi2[better] = (
                new_residual[better],
                new_jacobian[better],
                new_chi2[better],
            )
            small = length <= 1e-6 * np.maximum(1.0, chi2 / y.size)
            done = sound & np.where(better, small | (gain <= 1e-12 * chi2), length <= 1e-10)
            damping[active] = np.where(better, np.maximum(0.1 * damping[active], 1e-12), 10.0 * damping[active])
            converged[active[done]] = True
            stay = ~done & sound & (damping[active] <= 1e10) & (steps[active] < STEPS)
            active = active[stay]
            residual, jacobian, chi2 = residual[stay], jacobian[stay], chi2[stay]
    return theta, steps, converged


def _linearised(model: Model, rows: NDArray[np.int64], theta: F8, y: F8, weight: F8) -> tuple[F8, F8, F8]:
    """Weighted residuals (k, n), derivatives of the law (k, width, n) with fixed parameters zero, and chi-square."""
    amplitude, jacobian = model.evaluate(rows, theta)
    residual = (y - amplitude) * weight
    jacobian *= weight
    jacobian[~model.free[rows]] = 0.0
    chi2 = np.einsum("kn,kn->k", residual, residual)
    chi2[~np.isfinite(chi2)] = np.inf
    return residual, jacobian, chi2
