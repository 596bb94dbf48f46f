"""Findings on damping: which laws the run admits, and which it contradicts."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import words_of
from pipeline.damping.select import Damping
from pipeline.numerics.levels import VERY_STRONG
from pipeline.numerics.quantity import number
from pipeline.registry.found import Found


def damping_findings(damping: Damping) -> Iterator[Found]:
    """Yield which laws fit, which do not, and which cannot be distinguished."""
    rejected = [name for name, fit in damping.fits.items() if fit.rejected]
    if damping.fits and len(rejected) == len(damping.fits):
        nearest = min(damping.fits.values(), key=lambda fit: fit.reduced_chi2) if damping.by_statement else damping.best
        yield Found("no_law_fits", {"reduced_chi2": nearest.reduced_chi2, "nearest": words_of(nearest.law)})
    elif damping.growth_rate:
        yield Found("growing", {"growth_rate": damping.growth_rate})
    elif damping.stated:
        yield from _stated_law(damping)
    if rejected or damping.unfitted:
        unfitted = len(damping.unfitted)
        numbers = {"rejected": len(rejected) + unfitted, "tried": len(damping.fits) + unfitted}
        yield Found("law_rejected", {**numbers, **_reasons(damping)})
    if len(damping.admissible) > 1:
        laws = [damping.fits[name].law for name in damping.admissible]
        undamped = next((words_of(law) for law in laws if len(law.parameters) == 1), None)
        names = ", ".join(words_of(law) for law in laws)
        yield Found("laws_not_separable", {"laws": len(laws), "names": names, "undamped": undamped})


def _stated_law(damping: Damping) -> Iterator[Found]:
    """Yield that a stated law was not fitted, that chi-square rejects it, or that another law beats it."""
    if not damping.by_statement:
        why = damping.unfitted.get(damping.stated, "its fit failed")
        yield Found("stated_law_rejected", {"law": damping.stated, "why": why})
        return
    best = damping.best
    other = min((fit for fit in damping.fits.values() if not fit.rejected), key=lambda fit: fit.bic, default=best)
    excess = best.bic - other.bic
    if best.rejected or excess > VERY_STRONG:
        numbers = {"reduced_chi2": best.reduced_chi2, "other_chi2": other.reduced_chi2, "bic_excess": excess}
        yield Found("stated_law_rejected", {**numbers, "law": best.name, "other": other.name})


def _reasons(damping: Damping) -> dict[str, str]:
    """Return the laws that are rejected, or have no fit, by the reason."""
    best = damping.best
    by_reason: dict[str, list[str]] = {}
    for fit in damping.fits.values():
        by_reason.setdefault(fit.rejection, []).append(f"{words_of(fit.law)}{_chi2(fit)}")
    reasons = {reason: ", ".join(laws) for reason, laws in by_reason.items() if reason in ("misfit", "negative")}
    if "misfit" in by_reason:
        reasons["selected"] = f"{words_of(best.law)}{_chi2(best)}"
    unfitted = [f"{name}, because {why}" for name, why in damping.unfitted.items()]
    return reasons | ({"unfitted": "; ".join(unfitted)} if unfitted else {})


def _chi2(fit: LawFit) -> str:
    # With as many parameters as windows there is no degree of freedom, and so no reduced chi-square.
    return f" ({number(fit.reduced_chi2)})" if fit.dof > 0 else ""
