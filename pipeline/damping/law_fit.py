"""Fit several damping laws to the same points at once: one Levenberg-Marquardt, many rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.laws import Drag, Law
from pipeline.damping.laws.drag import guesses, jacobians_of
from pipeline.track import F8

__all__ = ["Fitted", "covariance_or_infinite", "fit_laws"]

STEPS = 40
PATIENCE, IDLE = 10, 0.01  # steps after which a fit that gains less than this in chi-square a step is given up
# Gain in chi-square that a hundredth of a standard uncertainty brings: steps shrink quadratically, so far less is left.
NEGLIGIBLE = 1e-4
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


class _Batch:
    """Amplitudes and derivatives of several laws, each row one law; laws of drag share one evaluation.

    ``free`` is (k, width) bool: which parameters a row has.
    """

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
        for row in np.flatnonzero(~self.drag).tolist():
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
        for k, row in enumerate(rows.tolist()):
            if drags[k]:
                continue
            slots = self.slots[row]
            amplitude[k], by = self.laws[row].both(self.t, theta[k, slots])
            jacobian[k, slots] = by.T
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
    Levenberg and Marquardt's method with analytic derivatives, at most forty steps, on amplitudes in units of their
    root mean square, so that no power of a metre disturbs it. A row leaves the batch when it has converged: when its
    step was a hundredth of a standard uncertainty (which a bad fit has larger), in whatever direction.
    """
    length = float(np.sqrt(np.mean(y * y))) or 1.0
    batch = _Batch(laws, t)
    scaled, weight = y / length, length / u
    end = _minimise(batch, scaled, weight, batch.guess(scaled))
    covariances = _covariances(end.jacobian, batch.free)
    fitted = []
    for row, law in enumerate(laws):
        slots = batch.slots[row]
        theta = end.theta[row, slots]
        values = law.rescaled(theta, 1.0 / length)
        covariance = _rescaled_covariance(law, theta, covariances[row][slots][:, slots], length)
        note = (
            "" if end.converged[row] else f"{int(end.steps[row])} steps of Levenberg-Marquardt from the law's own guess"
        )
        fitted.append(Fitted(values, covariance, float(end.chi2[row]), bool(end.converged[row]), note))
    return fitted


def _covariances(jacobian: F8, free: NDArray[np.bool_]) -> F8:
    """Return the rows' covariances (k, p, p), infinite where the points do not determine every parameter."""
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.einsum("kpn,kpn->kp", jacobian, jacobian))
        scale[~free] = 1.0
        normal = (jacobian @ jacobian.transpose(0, 2, 1)) / (scale[:, :, None] * scale[:, None, :])
        normal += np.eye(free.shape[1]) * ~free[:, :, None]
        sound = np.isfinite(normal).all(axis=(1, 2)) & scale.all(axis=1)
        normal[~sound] = np.eye(free.shape[1])
        # Where the determinant is that small the inverse would lose half of its digits: see below.
        sound &= np.linalg.det(normal) > 1e-8
        normal[~sound] = np.eye(free.shape[1])
        found = np.linalg.inv(normal) / (scale[:, :, None] * scale[:, None, :])
    for row in np.flatnonzero(~sound).tolist():
        slots = np.flatnonzero(free[row])
        found[row][np.ix_(slots, slots)] = covariance_or_infinite(jacobian[row, slots])
    return np.asarray(found)


def _rescaled_covariance(law: Law, theta: F8, covariance: F8, length: float) -> F8:
    """The covariance that belongs to ``law.rescaled(theta, 1 / length)``."""
    if isinstance(law, Drag):
        factor = law.rescaled(np.ones(theta.size), 1.0 / length)
        return np.asarray(covariance * np.outer(factor, factor))
    steps = 1e-5 * np.maximum(np.abs(theta), 1e-3)
    with np.errstate(all="ignore"):
        by = np.stack(
            [
                (law.rescaled(theta + d, 1.0 / length) - law.rescaled(theta - d, 1.0 / length)) / (2.0 * step)
                for d, step in zip(np.diag(steps), steps, strict=True)
            ],
            axis=1,
        )
        return np.asarray(by @ covariance @ by.T)


def covariance_or_infinite(jacobian: F8) -> F8:
    """Return :math:`(J J^T)^{-1}`.

    Parameters
    ----------
    jacobian : (p, n) float64
        Each column divided by its point's standard uncertainty.

    Returns
    -------
    (p, p) float64
        Infinite where the points do not determine every parameter: a pseudo-inverse would call it known.

    Notes
    -----
    By QR of rows scaled to unit length.
    """
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.einsum("pn,pn->p", jacobian, jacobian))
    unknown = np.full((scale.size, scale.size), np.inf)
    if not np.isfinite(scale).all() or not scale.all() or jacobian.shape[1] < scale.size:
        return unknown
    unit = jacobian / scale[:, None]
    r: F8 = np.asarray(np.linalg.qr(unit.T, mode="r"))
    if np.abs(np.diagonal(r)).min() <= 1e-13:
        return unknown
    triangle = np.linalg.inv(r) / scale[:, None]
    with np.errstate(over="ignore", invalid="ignore"):  # infinite where the points say nothing
        return np.asarray(triangle @ triangle.T)


@dataclass(frozen=True, slots=True, eq=False)
class _Minimum:
    """Where :func:`_minimise` ended.

    Parameters
    ----------
    theta : (k, p) float64
    chi2 : (k,) float64
    jacobian : (k, p, n) float64
        At theta, divided by the points' standard uncertainties; zero for parameters that a row has not.
    steps : (k,) int64
    converged : (k,) bool
    """

    theta: F8
    chi2: F8
    jacobian: F8
    steps: NDArray[np.int64]
    converged: NDArray[np.bool_]


def _minimise(model: _Batch, y: F8, weight: F8, theta: F8) -> _Minimum:
    """Minimise every row's chi-square by Levenberg and Marquardt's method.

    Parameters
    ----------
    model : _Batch
    y, weight : (n,) float64
        Points and reciprocals of their standard uncertainties.
    theta : (k, p) float64
        Start values.
    """
    count, width = theta.shape
    theta = theta.copy()
    identity = np.eye(width)
    active = np.arange(count)
    damping = np.full(count, 1e-6)
    steps, converged = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    with np.errstate(all="ignore"):
        residual, jacobian, chi2 = _linearised(model, active, theta, y, weight)
        while active.size:
            here, rest = jacobian[active], residual[active]
            norm = np.sqrt(np.einsum("kpn,kpn->kp", here, here))
            norm[norm == 0.0] = 1.0
            normal = (here @ here.transpose(0, 2, 1)) / (norm[:, :, None] * norm[:, None, :])
            right = (here @ rest[:, :, None])[:, :, 0] / norm
            sound = np.isfinite(right).all(axis=1) & np.isfinite(normal).all(axis=(1, 2))
            normal[~sound], right[~sound] = identity, 0.0
            # A parameter that a row has not keeps a row of zeros: one on its diagonal leaves it where it is.
            lever = damping[active, None] + ~model.free[active]
            step = np.linalg.solve(normal + identity * lever[:, None, :], right[:, :, None])[:, :, 0]
            steps[active] += 1
            trial = theta[active] + step / norm
            new_residual, new_jacobian, new_chi2 = _linearised(model, active, trial, y, weight)
            promised = np.einsum("kp,kp->k", step, right)
            gain = chi2[active] - new_chi2
            better = gain >= 0.0
            rows = active[better]
            theta[rows], chi2[rows] = trial[better], new_chi2[better]
            residual[rows], jacobian[rows] = new_residual[better], new_jacobian[better]
            # A small gain means the end only where no lever has shortened the step.
            negligible = np.where(damping[active] <= 1e-3, NEGLIGIBLE, 1e-10)
            level = promised <= negligible * np.maximum(1.0, chi2[active] / y.size)
            done = sound & np.where(better, level | (gain <= 1e-12 * chi2[active]), level)
            damping[active] *= np.where(better, 0.1, 10.0)
            np.maximum(damping, 1e-12, out=damping)
            converged[active[done]] = True
            # In a valley without a floor, where no gain counts, more steps find nothing.
            idle = better & (steps[active] >= PATIENCE) & (gain < IDLE * np.maximum(1.0, chi2[active] / y.size))
            active = active[~done & ~idle & sound & (damping[active] <= 1e10) & (steps[active] < STEPS)]
    return _Minimum(theta, chi2, jacobian, steps, converged)


def _linearised(model: _Batch, rows: NDArray[np.int64], theta: F8, y: F8, weight: F8) -> tuple[F8, F8, F8]:
    """Weighted residuals (k, n), derivatives of the law (k, width, n) with fixed parameters zero, and chi-square."""
    amplitude, jacobian = model.evaluate(rows, theta)
    residual = (y - amplitude) * weight
    jacobian *= weight
    jacobian *= model.free[rows][:, :, None]
    chi2 = np.einsum("kn,kn->k", residual, residual)
    chi2[~np.isfinite(chi2)] = np.inf
    return residual, jacobian, chi2
