"""Whether both halves of a run have the same parameters, and what it means for their uncertainties if not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.damping.law_fit import LawFit
from pipeline.damping.select import Damping
from pipeline.motion.fitted import Oscillation
from pipeline.motion.kinds import Motion
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import CENTRAL_STEP
from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_CURVE
from pipeline.numerics.regression import Scatter, beyond, decompose
from pipeline.track import F8


class Difference(NamedTuple):
    """The difference of the parameters of both halves: chi-square and the number of parameters."""

    chi2: float
    parameters: int

    @property
    def factor(self) -> float:
        """The factor by which it exceeds that of the stated covariance; at least 1."""
        return max(1.0, self.chi2 / self.parameters) if self.parameters else 1.0


def difference(residual: F8, slopes: F8, correlation: float) -> Difference | None:
    """Compare the parameters of both halves of equal information; None if one has too few points.

    Residuals (n,) in the order of time, and derivatives (n, p) by the parameters, are in standard uncertainties.

    The determinants of :math:`J^T J` are equal for both halves; their difference increases with the size of the first
    one, so it is found by bisection. If all parameters may differ between the halves, chi-square falls by
    :math:`d^T (C_1 + C_2)^{-1} d` for the difference d of the parameters and their covariances C: by the part of the
    residual that lies in the derivatives of one half beyond those of the whole (G. C. Chow, Econometrica 28 (1960)
    591), to first order for a law that is not linear.
    """
    first, last = FEWEST_FOR_CURVE, residual.size - FEWEST_FOR_CURVE
    if last < first:
        return None
    scale = np.linalg.norm(slopes, axis=0)
    slopes = slopes[:, scale > 0.0] / scale[scale > 0.0]
    while first < last:
        middle = (first + last) // 2
        before, after = (np.linalg.slogdet(part.T @ part) for part in (slopes[:middle], slopes[middle:]))
        first, last = (middle + 1, last) if before < after else (first, middle)
    basis, _, _ = decompose(slopes)
    one_half = slopes.copy()
    one_half[:first] = 0.0
    other = beyond(basis, one_half)
    # The other half does not determine what it contributes less to than the errors of numerical derivatives.
    other = other[:, np.linalg.norm(other, axis=0) > CENTRAL_STEP]
    if not other.size:
        return None
    apart, _, _ = decompose(other, CENTRAL_STEP)
    part = apart.T @ beyond(basis, residual[:, None])[:, 0]
    return Difference(float(part @ part) / correlation, part.size)


def compare_halves(fitted: Motion) -> tuple[Motion, tuple[Notice, ...]]:
    """Return a fit whose covariances include that its halves differ, and the finding; the fit as it is if they agree.

    The halves are compared in one chi-square over the parameters of the damping law, of the phase, and of the rest
    position unless it drifts, with the scatter of the windows about smooth curves that know no law. At a probability of
    :data:`FALSE_ALARM` they differ, and each part's covariance is multiplied by its chi-square over its parameters.
    """
    from scipy.special import chdtrc

    if not isinstance(fitted, Oscillation) or fitted.method == "equation" or fitted.phase.walk is not None:
        return fitted, ()
    windows, damping, phase, rest = fitted.windows, fitted.damping, fitted.phase, fitted.rest
    of_law = _of_law(damping.best, damping, windows.t, windows.amplitude)
    turned = _different(phase.spread, windows.phase - phase.total(windows.t), phase.columns(windows.t))
    constant = None if rest.drifts else rest.spread
    at_rest = _different(constant, windows.offset - rest.mean.value, np.ones((windows.t.size, 1)))
    every = [one for one in (of_law, turned, at_rest) if one is not None]
    chi2, count = sum(one.chi2 for one in every), sum(one.parameters for one in every)
    if not every or not chdtrc(count, chi2) < FALSE_ALARM:
        return fitted, ()
    fits = {
        name: _widened(fit, _of_law(fit, damping, windows.t, windows.amplitude)) for name, fit in damping.fits.items()
    }
    if phase.bend is None:
        omega, start = (_wider(x, turned) for x in (phase.angular_frequency, phase.phase))
        phase = replace(phase, angular_frequency=omega, phase=start)
    elif phase.small_swings is not None:
        phase = replace(phase, small_swings=_wider(phase.small_swings, turned))
    fitted = replace(
        fitted,
        damping=replace(damping, fits=fits),
        phase=phase,
        rest=replace(rest, mean=_wider(rest.mean, at_rest)),
    )
    return fitted, (Notice("halves_differ", {"chi2": chi2, "parameters": count}),)


def _different(spread: Scatter | None, residual: F8, slopes: F8) -> Difference | None:
    if spread is None:
        return None
    kept, u = spread.kept, spread.u[spread.kept]
    return difference(residual[kept] / u, slopes[kept] / u[:, None], spread.correlation)


def _of_law(fit: LawFit, damping: Damping, t: F8, amplitude: F8) -> Difference | None:
    with np.errstate(all="ignore"):
        expected, slopes = fit.law.curve(t - damping.t0, fit.joint.values)
    finite = bool(np.isfinite(expected).all() and np.isfinite(slopes).all())
    return _different(damping.scatter, amplitude - expected, slopes) if finite else None


def _widened(fit: LawFit, apart: Difference | None) -> LawFit:
    """Return a fit whose covariance is larger by the factor of a difference, or as much as its misfit makes it."""
    factor = 1.0 if apart is None else max(1.0, apart.factor / fit.widening)
    return replace(fit, joint=replace(fit.joint, covariance=factor * fit.joint.covariance))


def _wider(x: Estimate, apart: Difference | None) -> Estimate:
    return x if apart is None else Estimate(x.value, x.u * math.sqrt(apart.factor), x.unit)
