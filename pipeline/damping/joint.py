"""Joint damping: does one law with one set of coefficients describe several runs?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.damping.evidence import NEGATIVE, choose
from pipeline.damping.law_fit import LawFit, rates_of
from pipeline.damping.laws import Law, words_of
from pipeline.damping.select import Damping
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Joint
from pipeline.numerics.levels import FALSE_ALARM, STRONG
from pipeline.numerics.regression import chi2_quantile
from pipeline.track import F8

Rejection = Literal["", "misfit", "differ", "negative"]


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """One law with coefficients that all runs share; ``chi2`` and ``dof`` are reduced for the correlation of points.

    ``excess_chi2`` is the increase of chi-square over separate coefficients, and ``excess_dof`` their number saved.
    The law is rejected if chi-square is improbable, if the coefficients differ or if one is negative.
    """

    law: Law
    coefficients: Joint
    largest_m: float
    smallest_m: float
    chi2: float
    dof: float
    bic: float
    excess_chi2: float
    excess_dof: float
    rejection: Rejection

    @property
    def rejected(self) -> bool:
        """Whether the runs contradict one law with common coefficients."""
        return self.rejection != ""

    @property
    def reduced_chi2(self) -> float:
        """Chi-square over the degrees of freedom."""
        return self.chi2 / self.dof if self.dof > 0 else math.nan

    def rates(self, amplitude: F8) -> tuple[F8, F8]:
        """Return -dA/dt at amplitudes (n,) in m, and its standard uncertainty, both (n,) in m/s."""
        # The rate depends only on the coefficients, so any start amplitude gives the same result.
        theta = np.concatenate([[1.0], self.coefficients.values])
        covariance = np.zeros((theta.size, theta.size))
        covariance[1:, 1:] = self.coefficients.covariance
        return rates_of(self.law, amplitude, theta, covariance)


@dataclass(frozen=True, slots=True, eq=False)
class JointDamping:
    """The damping laws of several runs together; ``admissible`` laws describe all runs, from best to worst."""

    runs: tuple[str, ...]
    fits: Mapping[str, JointFit]
    selected: str
    admissible: tuple[str, ...]
    message: str

    @property
    def best(self) -> JointFit:
        """The fit of the selected law."""
        return self.fits[self.selected]

    @property
    def one_law(self) -> bool:
        """Whether one law with one set of coefficients describes all runs."""
        return bool(self.admissible)


def join(runs: Sequence[tuple[str, Damping, float]]) -> JointDamping:
    """Combine the laws of at least two runs of one bob and disc: name, damping and last time since t0, s.

    The coefficients :math:`\\theta_i` of the runs, with the covariances :math:`C_i`, have the generalised least-squares
    mean :math:`\\bar\\theta`. If they are equal, :math:`\\sum_i (\\theta_i - \\bar\\theta)^T C_i^{-1}
    (\\theta_i - \\bar\\theta)` has a chi-square distribution with (runs - 1) times their number of degrees of freedom.
    """
    if len(runs) < 2:
        raise AnalysisError(f"a joint fit needs two runs at least, got {len(runs)}")
    shared = [name for name in runs[0][1].fits if all(name in damping.fits for _, damping, _ in runs)]
    if not shared:
        raise AnalysisError("no damping law was fitted to every run; compare runs of the same bob")
    last_s = [seconds for _, _, seconds in runs]
    fits = {name: _joined([damping.fits[name] for _, damping, _ in runs], last_s) for name in shared}

    def span(name: str) -> F8:
        return np.array([fits[name].largest_m, fits[name].smallest_m])

    selected, admissible = choose(fits, STRONG, span)
    names = tuple(name for name, _, _ in runs)
    return JointDamping(names, fits, selected, admissible, _message(names, fits, selected, admissible))


def _joined(each: Sequence[LawFit], last_s: Sequence[float]) -> JointFit:
    law, units = each[0].law, each[0].joint.units
    theta = np.array([fit.joint.values[1:] for fit in each])
    # A law that chi-square rejects has a wider covariance, which must not hide that the coefficients differ.
    known = [np.linalg.pinv(fit.joint.covariance[1:, 1:] / fit.widening, hermitian=True) for fit in each]
    covariance = np.linalg.pinv(np.sum(known, axis=0), hermitian=True)
    mean = covariance @ np.sum([weight @ own for weight, own in zip(known, theta, strict=True)], axis=0)
    excess = float(sum((own - mean) @ weight @ (own - mean) for weight, own in zip(known, theta, strict=True)))
    saved = float((len(each) - 1) * mean.size)
    chi2 = sum(fit.reduced_chi2 * fit.dof for fit in each if fit.dof > 0) + excess
    dof = sum(fit.dof for fit in each) + saved
    rejection: Rejection = ""
    if dof >= 1.0 and chi2 > chi2_quantile(1.0 - FALSE_ALARM, dof):
        rejection = "misfit"
    elif saved and excess > chi2_quantile(1.0 - FALSE_ALARM, saved):
        rejection = "differ"
    elif np.any(mean < -NEGATIVE * np.sqrt(np.diag(covariance))):
        rejection = "negative"
    ends = [fit.amplitude(np.array([0.0, seconds])) for fit, seconds in zip(each, last_s, strict=True)]
    count = len(each) + mean.size
    bic = chi2 + count * math.log(max(dof + count, 2.0))
    coefficients = Joint(tuple(law.parameters)[1:], mean, covariance, units[1:])
    return JointFit(
        law, coefficients, float(np.max(ends)), float(np.min(ends)), chi2, dof, bic, excess, saved, rejection
    )


def _message(names: tuple[str, ...], fits: Mapping[str, JointFit], selected: str, admissible: tuple[str, ...]) -> str:
    together, best = ", ".join(names), fits[selected]
    if admissible:
        values = ", ".join(f"{name} = {value}" for name, value in best.coefficients.estimates().items()) or "none"
        rest = f"; {', '.join(admissible[1:])} would do as well" if len(admissible) > 1 else ""
        return f"One damping law holds across {together}: {words_of(best.law)} ({values}){rest}."
    alike = [words_of(fit.law) for fit in fits.values() if fit.rejection == "differ"]
    if alike:
        return f"No common coefficients: {together} each follow {alike[0]}, with different coefficients."
    return f"No one damping law holds across {together}; the least bad is {words_of(best.law)}."
