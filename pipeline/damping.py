"""Damping: fit every law to the amplitudes, reject those the record contradicts, name those it admits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.demodulate import Demodulated
from pipeline.errors import AnalysisError
from pipeline.estimate import Estimate, Joint
from pipeline.laws import LAWS, Law
from pipeline.regression import Scatter, chi2_quantile, covariance_of, scatter
from pipeline.track import F8

__all__ = ["Damping", "LawFit", "Params", "fit_damping"]

TINY = 1e-100  # stands for zero where something is divided by an uncertainty
BARE_MENTION = 2.0  # difference of BIC below which evidence is none


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`fit_damping`.

    Parameters
    ----------
    rejection : float
        Probability at which chi-square rejects a law that is true.
    evidence : float
        A law whose BIC exceeds the best by more than this is not admissible; 6 is "strong" [1]_.
    laws : tuple of str
        Names of the laws to try, from :data:`pipeline.laws.LAWS`.

    References
    ----------
    .. [1] R. E. Kass, A. E. Raftery, "Bayes factors", J. Am. Stat. Assoc. 90 (1995) 773,
       doi:10.1080/01621459.1995.10476572.
    """

    rejection: float = 1e-3
    evidence: float = 6.0
    laws: tuple[str, ...] = tuple(LAWS)


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """One law on one record.

    Parameters
    ----------
    law : Law
    joint : Joint
        Parameters, the amplitude at the first sample used in front.
    reduced_chi2 : float
        Against noise and excess scatter.
    dof : float
        Degrees of freedom after correlation between points.
    bic : float
        Bayesian information criterion, up to a constant that all laws share.
    converged : bool
    rejection : {"", "misfit", "negative", "not converged"}
        Why the law is rejected, if it is: chi-square is improbable, a coefficient is negative beyond three standard
        uncertainties, or the fit did not converge.
    """

    law: Law
    joint: Joint
    reduced_chi2: float
    dof: float
    bic: float
    converged: bool
    rejection: Literal["", "misfit", "negative", "not converged"]

    @property
    def rejected(self) -> bool:
        """Whether the record contradicts the law."""
        return self.rejection != ""

    @property
    def name(self) -> str:
        """The law's name."""
        return self.law.name

    def amplitude(self, t: F8) -> F8:
        """Return (n,) float64, m, at times since the first sample used, s."""
        return self.law.amplitude(t, self.joint.values)

    def u_amplitude(self, t: F8) -> F8:
        """Return the standard uncertainty of :meth:`amplitude`, (n,) float64, m."""
        jacobian = self.law.jacobian(t, self.joint.values)
        variance = np.einsum("ni,ij,nj->n", jacobian, self.joint.covariance, jacobian)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def damping_rate(self) -> Estimate:
        """Logarithmic rate of the amplitude at the first sample, :math:`-\\dot A/A`, 1/s."""
        values = self.joint.values

        def rate(theta: F8) -> float:
            return float(self.law.rate(theta[:1], theta)[0] / theta[0])

        steps = 1e-6 * np.maximum(np.abs(values), 1e-9)
        gradient = np.array([(rate(values + d) - rate(values - d)) for d in np.diag(steps)]) / (2 * steps)
        variance = float(gradient @ self.joint.covariance @ gradient)
        return Estimate(rate(values), math.sqrt(max(variance, 0.0)), "1/s")


@dataclass(frozen=True, slots=True, eq=False)
class Damping:
    """What the amplitudes say about damping.

    Parameters
    ----------
    t0 : float
        Time of the first sample used, s; laws count from here.
    fits : mapping of str to LawFit
        Every law tried that had points enough.
    selected : str
        The admissible law of lowest BIC; of all laws where every one is rejected. Where BIC differs by less than 2
        ("not worth more than a bare mention") the law with fewer parameters, then the one listed first.
    admissible : tuple of str
        Laws the record does not contradict and whose evidence is within reach of the best, best first.
    scatter : Scatter
        Of the amplitudes about a smooth curve.
    """

    t0: float
    fits: Mapping[str, LawFit]
    selected: str
    admissible: tuple[str, ...]
    scatter: Scatter

    @property
    def best(self) -> LawFit:
        """The selected law's fit."""
        return self.fits[self.selected]

    @property
    def settled(self) -> bool:
        """Whether the selected law is the only admissible one, so that its coefficients mean something."""
        return self.admissible == (self.selected,)

    def averaged(self, values: Mapping[str, Estimate]) -> Estimate:
        """Return the selected law's value of a quantity, its uncertainty widened by what admissible laws differ.

        Parameters
        ----------
        values : mapping of law name to Estimate

        Notes
        -----
        :math:`u^2 = u_s^2 + \\sum_i w_i (x_i - x_s)^2` with weights :math:`w_i \\propto e^{-\\Delta\\mathrm{BIC}_i/2}`.
        """
        chosen = values[self.selected]
        names = self.admissible or (self.selected,)
        weights = np.exp([-0.5 * (self.fits[name].bic - self.best.bic) for name in names])
        spread = np.array([(values[name].value - chosen.value) ** 2 for name in names])
        variance = chosen.u**2 + float(np.sum(weights * spread) / np.sum(weights))
        return Estimate(chosen.value, math.sqrt(variance), chosen.unit)


def fit_damping(demodulated: Demodulated, t0: float, params: Params | None = None) -> Damping:
    """Fit the damping laws to the windows' amplitudes.

    Parameters
    ----------
    demodulated : Demodulated
    t0 : float
        Time of the first sample used, s.
    params : Params, optional

    Returns
    -------
    Damping

    Raises
    ------
    AnalysisError
        If no law can be fitted at all.

    Notes
    -----
    Real amplitudes scatter more than their noise says (beats with a sideways mode, clusters of false echoes).
    The excess is measured against a smooth curve that no law restricts, so that a wrong law cannot hide its misfit
    in it. Points that are correlated count as fewer: chi-square, BIC and degrees of freedom are divided and the
    covariance is multiplied by the correlation length.
    """
    params = params or Params()
    t, amplitude = demodulated.t - t0, demodulated.amplitude
    noise = np.sqrt(demodulated.covariance[:, 0, 0])
    if t.size < 3:
        # One or two points show no law: what the amplitude lost since the start is then its uncertainty.
        noise = np.hypot(noise, amplitude * demodulated.decay * t)
    # Perfect data still carry rounding: without a floor chi-square would divide by nothing.
    spread = scatter(t, amplitude, np.maximum(noise, 1e-12 * float(np.max(amplitude)) + TINY))
    fits: dict[str, LawFit] = {}
    for name in params.laws:
        law = LAWS[name]
        if np.count_nonzero(spread.kept) >= len(law.parameters):
            fit = _fit(law, t, amplitude, spread, params)
            if fit is not None:
                fits[name] = fit
    if not fits:
        raise AnalysisError("no damping law could be fitted to the amplitudes; see the counts of flagged samples")
    allowed = [name for name in fits if not fits[name].rejected] or list(fits)
    least = min(fits[name].bic for name in allowed)
    ties = [name for name in allowed if fits[name].bic - least < BARE_MENTION]
    selected = min(ties, key=lambda name: (len(fits[name].joint.names), list(fits).index(name)))
    order = sorted(allowed, key=lambda name: (name != selected, fits[name].bic))
    admissible = tuple(name for name in order if not fits[name].rejected and fits[name].bic - least <= params.evidence)
    return Damping(t0, fits, selected, admissible, spread)


def _fit(law: Law, t: F8, amplitude: F8, spread: Scatter, params: Params) -> LawFit | None:
    """Fit one law; None where its numbers run out of range, which no law with a chance does."""
    t, y, u = t[spread.kept], amplitude[spread.kept], spread.u[spread.kept]
    theta, converged = _levenberg_marquardt(law, t, y, u, law.guess(t, y))
    with np.errstate(all="ignore"):
        residual = (y - law.amplitude(t, theta)) / u
        jacobian = law.jacobian(t, theta) / u[:, None]
    top = float(np.max(y))
    # A growth that outruns the record by e^20 is a fit gone astray.
    growing = np.any(-law.rate(y, theta) * (t[-1] - t[0]) > 20.0 * top)
    absurd = growing or not 1e-3 * top <= theta[0] <= 1e3 * top
    if absurd or not (np.all(np.isfinite(residual)) and np.all(np.isfinite(jacobian))):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        covariance = spread.correlation * covariance_of(jacobian)[0]
    if not np.all(np.isfinite(covariance)):
        return None
    chi2 = float(residual @ residual)
    count = len(law.parameters)
    free = y.size - count
    dof = max(free / spread.correlation, 1.0) if free > 0 else 0.0
    reduced = chi2 / free if free > 0 else math.nan
    bic = chi2 / spread.correlation + count * math.log(max(y.size / spread.correlation, 2.0))
    joint = Joint(law.parameters, theta, covariance, law.units)
    rejection: Literal["", "misfit", "negative", "not converged"] = ""
    if dof > 0 and reduced * dof > chi2_quantile(1.0 - params.rejection, dof):
        rejection = "misfit"
    elif np.any(theta < -3.0 * np.sqrt(np.diag(covariance))):
        rejection = "negative"
    elif not converged:
        rejection = "not converged"
    return LawFit(law, joint, reduced, dof, bic, converged, rejection)


def _levenberg_marquardt(law: Law, t: F8, y: F8, u: F8, theta: F8) -> tuple[F8, bool]:
    """Minimise chi-square; analytic Jacobian, at most fifty steps."""

    def cost(trial: F8) -> tuple[F8, float]:
        with np.errstate(all="ignore"):
            residual = (y - law.amplitude(t, trial)) / u
            value = float(residual @ residual)
        return residual, value if math.isfinite(value) else math.inf

    residual, chi2 = cost(theta)
    damping = 1e-5
    for _ in range(50):
        with np.errstate(all="ignore"):
            jacobian = law.jacobian(t, theta) / u[:, None]
        if not np.all(np.isfinite(jacobian)):
            break
        scale = np.maximum(np.sqrt(np.sum(jacobian**2, axis=0)), 1e-300)
        scaled = jacobian / scale
        normal, right = scaled.T @ scaled, scaled.T @ residual
        try:
            step = np.linalg.solve(normal + damping * np.eye(theta.size), right)
        except np.linalg.LinAlgError:
            break
        trial = theta + step / scale
        trial_residual, trial_chi2 = cost(trial)
        gain = chi2 - trial_chi2
        if gain >= 0:
            theta, residual, chi2 = trial, trial_residual, trial_chi2
            # A thousandth of a standard uncertainty (which a bad fit has larger): what is left is its square.
            if float(step @ step) <= 1e-6 * max(1.0, chi2 / y.size) or gain <= 1e-12 * chi2:
                return theta, True
            damping = max(damping * 0.1, 1e-12)
        else:
            if float(step @ step) <= 1e-10:
                return theta, True
            damping *= 10.0
            if damping > 1e10:
                break
    return theta, False
