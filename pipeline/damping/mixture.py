"""Mixed drag: whether a recording needs two or more kinds of drag or friction together, even if no law fits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.damping.laws import Drag
from pipeline.damping.select import Damping, LawFit

__all__ = ["MixedDrag", "Params", "find_mixed"]

PRESENT = 3.0  # smallest coefficient accepted, in standard uncertainties; a true zero exceeds it with p = 0.0013


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_mixed`.

    Parameters
    ----------
    evidence : float
        Minimum by which the BIC of each law with one term must exceed that of the mixture; 10 is "very strong" [1]_.
    rival : float
        Minimum by which the BIC of each other mixture must exceed it; 6 is "strong". Mixtures that only add a term, or
        have a term that is not significantly positive, are ignored.

    References
    ----------
    .. [1] R. E. Kass, A. E. Raftery, "Bayes factors", J. Am. Stat. Assoc. 90 (1995) 773,
       doi:10.1080/01621459.1995.10476572.
    """

    evidence: float = 10.0
    rival: float = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class MixedDrag:
    """Terms of :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)` that a record needs together.

    Parameters
    ----------
    fit : LawFit
        Fit of the law with these terms; its uncertainties include its misfit, if chi-square rejects it.
    against : mapping of str to float
        Difference in BIC between each law with one term and the mixture, by name.
    """

    fit: LawFit
    against: Mapping[str, float]


def find_mixed(damping: Damping, params: Params | None = None) -> MixedDrag | None:
    """Return the mixture that the amplitudes need; None if one term may suffice or the mixture is ambiguous.

    Parameters
    ----------
    damping : Damping
    params : Params, optional

    Notes
    -----
    All coefficients must exceed zero by three standard uncertainties. Chi-square may reject the mixture, for example if
    the coefficients change with the amplitude. The residuals of the mixture then replace the noise, in the
    uncertainties and in every BIC (:attr:`pipeline.damping.select.LawFit.widening`). So a mixture that fits badly is
    returned only if the laws with one term fit far worse.
    """
    params = params or Params()
    sums = [fit for fit in damping.fits.values() if isinstance(fit.law, Drag) and fit.dof > 0]
    alone = [fit for fit in sums if len(fit.law.parameters) == 2]
    mixtures = [fit for fit in sums if len(fit.law.parameters) > 2 and _positive(fit)]
    if not mixtures or not alone:
        return None
    best = min(mixtures, key=lambda fit: fit.bic)
    against = {fit.name: _excess(fit, best) for fit in alone}
    rivals = [fit for fit in mixtures if not set(best.joint.names) <= set(fit.joint.names)]
    if min(against.values()) <= params.evidence or any(_excess(fit, best) <= params.rival for fit in rivals):
        return None
    return MixedDrag(best, against)


def _positive(fit: LawFit) -> bool:
    terms = [fit.joint[name] for name in fit.joint.names[1:]]
    return fit.converged and all(term.value > PRESENT * term.u for term in terms)


def _chi2(fit: LawFit) -> float:
    """Return chi-square, reduced for the correlation between points."""
    return fit.reduced_chi2 * fit.dof


def _excess(fit: LawFit, best: LawFit) -> float:
    """Return the difference in BIC between a law and the best one, with the residuals of the best one as noise."""
    fewer = len(best.law.parameters) - len(fit.law.parameters)
    return (_chi2(fit) - _chi2(best)) / best.widening - fewer * math.log(max(best.dof, 2.0))
