"""Joint damping: does one law with one set of coefficients describe several runs?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.damping.law_fit import NEGATIVE, LawFit, Rejection, choose
from pipeline.damping.laws import words_of
from pipeline.damping.select import Damping
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.levels import FALSE_ALARM
from pipeline.numerics.regression import chi2_quantile
from pipeline.track import F8


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointFit(LawFit):
    """One law with coefficients that all runs share; its amplitude at the start is the largest of them, and exact.

    ``excess_chi2`` is the increase of chi-square over separate coefficients, and ``excess_dof`` their number saved.
    The law is rejected if chi-square is improbable, if the coefficients differ or if one is negative.
    """

    smallest_m: float
    excess_chi2: float
    excess_dof: float

    @property
    def coefficients(self) -> dict[str, Estimate]:
        """The shared coefficients by name."""
        return {name: self.joint[name] for name in self.joint.names[1:]}


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
        raise AnalysisError("no damping law was fitted to every run", "compare runs of the same bob")
    last_s = [seconds for _, _, seconds in runs]
    fits = {name: _joined([damping.fits[name] for _, damping, _ in runs], last_s) for name in shared}

    def span(name: str) -> F8:
        return np.array([fits[name].joint.values[0], fits[name].smallest_m])

    selected, admissible, _ = choose(fits, span)
    names = tuple(name for name, _, _ in runs)
    return JointDamping(names, fits, selected, admissible, _message(names, fits, selected, admissible))


def _joined(each: Sequence[LawFit], last_s: Sequence[float]) -> JointFit:
    law = each[0].law
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
    joint = Joint(
        tuple(law.parameters), np.append(np.max(ends), mean), np.pad(covariance, ((1, 0), (1, 0))), each[0].joint.units
    )
    return JointFit(
        law,
        joint,
        chi2 / dof if dof > 0 else math.nan,
        dof,
        bic,
        rejection,
        smallest_m=float(np.min(ends)),
        excess_chi2=excess,
        excess_dof=saved,
    )


def _message(names: tuple[str, ...], fits: Mapping[str, JointFit], selected: str, admissible: tuple[str, ...]) -> str:
    together, best = ", ".join(names), fits[selected]
    if admissible:
        values = ", ".join(f"{name} = {value}" for name, value in best.coefficients.items()) or "none"
        rest = f"; {', '.join(admissible[1:])} would do as well" if len(admissible) > 1 else ""
        return f"One damping law holds across {together}: {words_of(best.law)} ({values}){rest}."
    alike = [words_of(fit.law) for fit in fits.values() if fit.rejection == "differ"]
    if alike:
        return f"No common coefficients: {together} each follow {alike[0]}, with different coefficients."
    return f"No one damping law holds across {together}; the least bad is {words_of(best.law)}."
