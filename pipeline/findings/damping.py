"""Findings on damping: which laws the run admits, and which it contradicts."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.damping.laws import words_of
from pipeline.damping.select import Damping
from pipeline.findings.finding import Finding

__all__ = ["damping_findings"]

# Difference of BIC that is "very strong" evidence: Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773. If two laws
# have the same prior probability, a wrong law beats the true law by this much in fewer than exp(-5) of recordings.
VERY_STRONG = 10.0


def damping_findings(damping: Damping) -> Iterator[Finding]:
    """Yield findings on laws that fit, laws that are rejected and laws that cannot be distinguished.

    Parameters
    ----------
    damping : Damping
    """
    rejected = [name for name, fit in damping.fits.items() if fit.rejected]
    if damping.fits and len(rejected) == len(damping.fits):
        nearest = min(damping.fits.values(), key=lambda fit: fit.reduced_chi2) if damping.by_statement else damping.best
        yield Finding(
            "no_law_fits",
            "warning",
            f"No damping law fits: the best has a reduced chi-square of {_number(nearest.reduced_chi2)}, not about 1.",
            f"The nearest is {words_of(nearest.law)}, which misses the amplitudes by more than their scatter. "
            "The uncertainties of the coefficients were increased by their residuals.",
            {"reduced_chi2": nearest.reduced_chi2},
        )
    elif damping.stated and (contradicted := _stated_law(damping)) is not None:
        yield contradicted
    if rejected or damping.unfitted:
        yield _rejections(damping, len(rejected))
    if len(damping.admissible) > 1:
        names = [words_of(damping.fits[name].law) for name in damping.admissible]
        undamped = any(len(damping.fits[name].law.parameters) == 1 for name in damping.admissible)
        yield Finding(
            "laws_not_separable",
            "info",
            f"{len(names)} damping laws fit this run equally well; a longer run may distinguish them.",
            f"In order of evidence: {', '.join(names)}."
            + (" The run does not show for certain that there is any damping." if undamped else ""),
            {"laws": len(names)},
        )


def _stated_law(damping: Damping) -> Finding | None:
    """Return the finding on a stated law that was not fitted, that chi-square rejects, or that another law beats."""
    if not damping.by_statement:
        why = damping.unfitted.get(damping.stated, "its fit failed")
        return Finding(
            "stated_law_rejected",
            "warning",
            f"The stated damping law {damping.stated} was not used, because it could not be fitted.",
            f"{damping.stated}: not fitted, because {why}. The law was chosen by the recording.",
        )
    stated = damping.best
    other = min((fit for fit in damping.fits.values() if not fit.rejected), key=lambda fit: fit.bic, default=stated)
    excess = stated.bic - other.bic
    if not stated.rejected and excess <= VERY_STRONG:
        return None
    return Finding(
        "stated_law_rejected",
        "warning",
        f"The recording contradicts the law that you stated, {stated.name}: {other.name} fits better.",
        f"{words_of(stated.law)} has a reduced chi-square of {_number(stated.reduced_chi2)}, {words_of(other.law)} has "
        f"{_number(other.reduced_chi2)}; the BIC of the stated law is higher by {_number(excess)}.",
        {"reduced_chi2": stated.reduced_chi2, "bic_excess": excess},
    )


def _rejections(damping: Damping, rejected: int) -> Finding:
    """Return one finding on all laws that are rejected or have no fit, with the reason for each."""
    by_reason: dict[str, list[str]] = {}
    for fit in damping.fits.values():
        # With as many parameters as windows there is no degree of freedom, and so no reduced chi-square.
        chi2 = f" ({_number(fit.reduced_chi2)})" if fit.dof > 0 else ""
        by_reason.setdefault(fit.rejection, []).append(f"{words_of(fit.law)}{chi2}")
    best = damping.best
    reasons = []
    if "misfit" in by_reason:
        selected = f"; {words_of(best.law)} has {best.reduced_chi2:.2g}" if best.dof > 0 else ""
        reasons.append(f"Rejected by their reduced chi-square{selected}: {', '.join(by_reason['misfit'])}.")
    if "negative" in by_reason:
        reasons.append(
            "Rejected because a coefficient is negative by more than two standard uncertainties (reduced chi-square "
            f"in brackets): {', '.join(by_reason['negative'])}."
        )
    reasons += [
        f"{words_of(fit.law)}: no convergence after {fit.tried}."
        for fit in damping.fits.values()
        if fit.rejection == "not converged"
    ]
    reasons += [f"{name}: not fitted, because {why}." for name, why in damping.unfitted.items()]
    count = rejected + len(damping.unfitted)
    tried = len(damping.fits) + len(damping.unfitted)
    return Finding(
        "law_rejected",
        "info",
        f"{tried - count} of the {tried} damping laws tried {'fits' if tried - count == 1 else 'fit'} this recording; "
        f"{count} {'does' if count == 1 else 'do'} not.",
        " ".join(reasons),
        {"rejected": count, "tried": tried},
    )


def _number(value: float) -> str:
    """Return a number with three digits and without an exponent."""
    if value > 1e6:
        return "over a million"
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"
