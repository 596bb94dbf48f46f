"""Least squares: the one general fitter, for residuals that are not linear in their parameters.

It takes a function that returns residuals and, where it is known in closed form, their Jacobian. It gives the
parameters, their covariance, and whether they are a minimum at all: a fit that ran out of steps, left the numbers'
range, or ended where the data no longer determine a parameter says so, and what was tried.
``tests/reference/test_nist.py`` holds it to the 54 starts of NIST's nonlinear reference data;
``docs/decisions/0007-general-fitter.md`` says why it is not scipy's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pipeline.track import F8

__all__ = ["Fit", "Params", "minimise"]

EPS = float(np.finfo(np.float64).eps)
CENTRAL_STEP = EPS ** (1.0 / 3.0)  # a central difference errs least here
NORMAL_LIMIT = 1e-8  # least eigenvalue for which normal equations are exact enough; the largest is p at most
CANYON = 1e-3  # least eigenvalue below which the way to the minimum bends
LOST = 1e-10  # share of its largest derivative under which a parameter has no influence any more
DEPENDENT = 1e-10  # singular value, relative to the largest, at which two parameters are one to a central difference
GREATEST_DAMPING = 1e16
CAUTIOUS_DAMPING = 1e4
STALLED = 1e-3  # in standard uncertainties: what is left where rounding allows no further step


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`minimise`.

    Parameters
    ----------
    precision : float
        Stop where the step still to be taken is this share of the parameters' standard uncertainties, as the
        residuals show them. 1e-3 leaves an estimate its noise; 1e-8 is for reference values.
    steps : int
        Most Jacobians to evaluate in one attempt; a second, cautious one follows a first that failed.
    damping : float
        At the start, relative to the scaled normal matrix: small for a guess that is near.
    again : bool
        Whether a first attempt that failed is followed by a cautious one; not needed where starts are many.
    """

    precision: float = 1e-4
    steps: int = 200
    damping: float = 1e-4
    again: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Where a fit ended.

    Parameters
    ----------
    values : (p,) float64
    covariance : (p, p) float64
        :math:`(J^T J)^{-1}`, for residuals in units of their standard uncertainties; times ``cost / (n - p)`` where
        these are known up to a factor. NaN where the data do not determine the parameters.
    residual : (n,) float64
        At ``values``.
    cost : float
        Sum of squared residuals.
    converged : bool
    tried : str
        What was done and how it ended, in words for a finding.
    steps : int
        Jacobians evaluated, of all attempts.
    """

    values: F8
    covariance: F8
    residual: F8
    cost: float
    converged: bool
    tried: str
    steps: int


def minimise(
    residuals: Callable[[F8], F8],
    start: ArrayLike,
    jacobian: Callable[[F8], F8] | None = None,
    params: Params | None = None,
) -> Fit:
    """Find the parameters that make the sum of squared residuals least.

    Parameters
    ----------
    residuals : callable
        (p,) float64 to (n,) float64: model less data over the standard uncertainty. May return what is not finite
        where the model has no value; such steps are not taken.
    start : (p,) array_like
    jacobian : callable, optional
        (p,) to (n, p): derivatives of the residuals. Left out, central differences, good to some ten digits.
    params : Params, optional

    Returns
    -------
    Fit
        Look at ``converged`` before its numbers are used.

    Raises
    ------
    ValueError
        If there are fewer residuals than parameters, or none: no data determine them, which the caller knows before.

    Notes
    -----
    Levenberg and Marquardt's method with Nielsen's damping [2]_. Columns are scaled by the largest norm that each has
    shown (Moré [1]_), so that units do not matter. The damped step solves normal equations while these are
    well-conditioned, else comes from the singular values of the Jacobian. In narrow canyons, half the step's second
    derivative along itself is added (geodesic acceleration [3]_). The end is Bates and Watts' relative offset [4]_:
    the length of the step's projection against that of the residuals, which no unit and no scale of the parameters
    changes; or the rounding error of the residuals.

    An attempt that ends where a parameter has lost its influence (the far side of a plateau) is repeated from the
    start with steps a hundredth as long.

    References
    ----------
    .. [1] J. J. Moré, "The Levenberg-Marquardt algorithm: implementation and theory", LNM 630 (1978) 105,
       doi:10.1007/BFb0067700.
    .. [2] H. B. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05, Technical University of Denmark.
    .. [3] M. K. Transtrum, J. P. Sethna, arXiv:1201.5885.
    .. [4] D. M. Bates, D. G. Watts, "A relative offset orthogonality convergence criterion for nonlinear least
       squares", Technometrics 23 (1981) 179, doi:10.1080/00401706.1981.10486257.

    Examples
    --------
    >>> t = np.linspace(0, 5, 50)
    >>> fit = minimise(lambda b: b[0] * np.exp(-b[1] * t) - 3.0 * np.exp(-0.7 * t), [1.0, 0.0])
    >>> fit.converged, fit.values.round(9)
    (True, array([3. , 0.7]))
    """
    params = params or Params()
    theta = np.array(start, np.float64, ndmin=1)
    with np.errstate(all="ignore"):
        residual = np.asarray(residuals(theta), np.float64)
        if residual.size < theta.size or theta.size == 0:
            raise ValueError(f"a fit needs as many residuals as parameters, got {residual.size} for {theta.size}")
        search = _Search(residuals, jacobian or _central(residuals), params)
        first = search.attempt(theta, residual, params.damping)
        if first.converged or not params.again or not np.all(np.isfinite(residual)):
            return first
        second = search.attempt(theta, residual, CAUTIOUS_DAMPING)
    better = second if second.converged or second.cost < first.cost else first
    tried = f"{first.tried}; again with short steps: {second.tried}"
    return Fit(
        better.values,
        better.covariance,
        better.residual,
        better.cost,
        better.converged,
        tried,
        first.steps + second.steps,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Local:
    """The problem about one point, in scaled parameters: eigenvalues, -vectors and the gradient along these."""

    slope: F8
    scale: F8
    values: F8
    vectors: F8
    downhill: F8

    @classmethod
    def of(cls, slope: F8, residual: F8, scale: F8) -> _Local:
        """Decompose a Jacobian."""
        values, vectors = np.linalg.eigh(slope.T @ slope / np.outer(scale, scale))
        if values[0] > NORMAL_LIMIT:
            return cls(slope, scale, values, vectors, -vectors.T @ (slope.T @ residual / scale))
        q, r = np.linalg.qr(slope / scale)
        left, singular, right = np.linalg.svd(r)
        downhill = -singular * (left.T @ (q.T @ residual))
        return cls(slope, scale, singular[::-1] ** 2, right[::-1].T, downhill[::-1])

    @property
    def offset(self) -> float:
        """Length of the undamped step's projection, in units of the residuals."""
        seen = self.values > (DEPENDENT**2) * self.values[-1]
        return math.sqrt(float(np.sum(self.downhill[seen] ** 2 / self.values[seen])))

    def step(self, damping: float) -> F8:
        """Return the damped step, (p,), in scaled parameters."""
        return np.asarray(self.vectors @ (self.downhill / (self.values + damping)))

    def determined(self, norms: F8) -> bool:
        """Whether the data tell the parameters apart, each in units of its own derivative's norm."""
        if self.values[0] > NORMAL_LIMIT:
            return True
        singular = np.linalg.svd(np.linalg.qr(self.slope / norms, mode="r"), compute_uv=False)
        return bool(singular[-1] > DEPENDENT * singular[0])

    def covariance(self) -> F8:
        """Return the inverse of the normal matrix, (p, p)."""
        root = self.vectors / np.sqrt(self.values) / self.scale[:, None]
        return np.asarray(root @ root.T)

    def expected(self, step: F8) -> float:
        """Return how much the cost should fall over a step in scaled parameters."""
        along = self.vectors.T @ step
        return float(2.0 * (along @ self.downhill) - (along**2) @ self.values)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The functions of one problem."""

    residuals: Callable[[F8], F8]
    jacobian: Callable[[F8], F8]
    params: Params

    def attempt(self, theta: F8, residual: F8, damping: float) -> Fit:
        """Go downhill from one start with one initial damping."""
        cost, growth, steps = _power(residual), 2.0, 0
        largest, count = np.zeros(theta.size), theta.size
        nothing = np.full((count, count), np.nan)
        while steps < self.params.steps:
            slope = self.jacobian(theta)
            steps += 1
            norms = np.sqrt(np.einsum("ni,ni->i", slope, slope))
            if not (math.isfinite(cost) and np.all(np.isfinite(norms))):
                ended = f"no finite value or derivative at {_shown(theta)}"
                return Fit(theta, nothing, residual, cost, False, ended, steps)
            largest = np.maximum(largest, norms)
            local = _Local.of(slope, residual, np.where(largest > 0, largest, 1.0))
            left, enough = local.offset, self._enough(theta, residual, cost, norms)
            found = None if left <= enough else self._downhill(theta, residual, cost, local, damping, growth)
            if found is not None:
                theta, residual, cost, damping, growth = found
                continue
            converged = left <= max(1.0, STALLED / self.params.precision) * enough
            ended = f"{'a minimum' if converged else 'no way further down'} after {steps} steps"
            lost = [str(i + 1) for i in np.flatnonzero(norms <= LOST * largest)]
            if lost:
                ended += f", but there the data do not determine parameter {', '.join(lost)}: {_shown(theta)}"
            elif not local.determined(norms):
                ended += f", but there parameters depend on each other: {_shown(theta)}"
            else:
                return Fit(theta, local.covariance(), residual, cost, converged, ended, steps)
            return Fit(theta, nothing, residual, cost, False, ended, steps)
        return Fit(theta, nothing, residual, cost, False, f"no minimum in {steps} steps", steps)

    def _enough(self, theta: F8, residual: F8, cost: float, norms: F8) -> float:
        """Return the offset at which to stop: a share of the noise that the residuals show, or their rounding."""
        noise = math.sqrt(cost * theta.size / max(residual.size - theta.size, 1))
        return max(self.params.precision * noise, 8.0 * EPS * float(np.linalg.norm(norms * theta)))

    def _downhill(
        self, theta: F8, residual: F8, cost: float, local: _Local, damping: float, growth: float
    ) -> tuple[F8, F8, float, float, float] | None:
        """Try shorter and shorter steps until one lowers the cost; None where rounding swallows them first."""
        while damping < GREATEST_DAMPING:
            step = local.step(damping)
            expected = local.expected(step)
            if local.values[0] < CANYON:
                step = self._bent(theta, residual, local, step, damping)
            trial = theta + step / local.scale
            trial_residual = np.asarray(self.residuals(trial), np.float64)
            trial_cost = _power(trial_residual)
            if trial_cost < cost:
                gain = min((cost - trial_cost) / max(expected, 1e-300), 1e3)
                damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3), EPS)
                return trial, trial_residual, trial_cost, damping, 2.0
            if expected <= EPS * cost or np.array_equal(trial, theta):
                return None
            damping, growth = damping * growth, 2.0 * growth
        return None

    def _bent(self, theta: F8, residual: F8, local: _Local, step: F8, damping: float) -> F8:
        """Add half the second derivative along the step, where it is small enough to be believed."""
        part = 0.1
        along = step / local.scale
        there = np.asarray(self.residuals(theta + part * along), np.float64)
        second = 2.0 / part * ((there - residual) / part - local.slope @ along)
        if not np.all(np.isfinite(second)):
            return step
        right = (local.slope / local.scale).T @ second
        bend = -0.5 * local.vectors @ ((local.vectors.T @ right) / (local.values + damping))
        return step + bend if np.linalg.norm(bend) <= 0.375 * np.linalg.norm(step) else step


def _central(residuals: Callable[[F8], F8]) -> Callable[[F8], F8]:
    """Return the Jacobian by central differences; the step is relative, and absolute about zero."""

    def jacobian(theta: F8) -> F8:
        columns = []
        for i, value in enumerate(theta):
            above, below = theta.copy(), theta.copy()
            step = CENTRAL_STEP * max(abs(value), CENTRAL_STEP)
            above[i] += step
            below[i] -= step
            columns.append((residuals(above) - residuals(below)) / (above[i] - below[i]))
        return np.stack(columns, axis=1)

    return jacobian


def _power(residual: F8) -> float:
    """Return the sum of squares, infinite where it is no number."""
    power = float(residual @ residual)
    return power if math.isfinite(power) else math.inf


def _shown(theta: F8) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in theta) + ")"
