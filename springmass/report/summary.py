"""The result of a run in three sentences or few more: the values, how sure they are, what to do."""

from __future__ import annotations

from pipeline.analyse import Analysis, Oscillation, Still
from pipeline.numerics.quantity import noun
from pipeline.registry.quantities import INPUTS
from springmass.report.advice import harm_of, sentence
from springmass.report.budgets import BudgetRow, budgets_of
from springmass.report.trust import trust_text
from springmass.report.words import damping_sentence
from springmass.runs.rows import is_about
from springmass.typeset import kept, prefixed, typeset


def summary(analysis: Analysis) -> tuple[tuple[str, str], ...]:
    """Return (title, text) of each part of the summary."""
    motion, warnings = analysis.motion, [f for f in analysis.findings if f.severity != "info"]
    ordered = sorted(warnings, key=lambda f: harm_of(f.code, f.severity))
    to_do = ordered[0].advice if ordered else ""
    if not isinstance(motion, Oscillation):
        why = sentence(typeset(motion.why))
        if isinstance(motion, Still) and "first_mode_period" not in analysis.estimates:
            why = "Nothing oscillates in this recording; it gives mean and noise only."
        return (("Result", why), *((("What to do", to_do),) if to_do else ()))
    row = _largest(analysis)
    if not to_do:
        to_do = f"Nothing needs attention. {_improvement(row)}".rstrip()
    if "spring_constant" not in analysis.estimates and analysis.scene.bob_mass_kg is None and _is_length(analysis):
        to_do += " For the spring constant, state the mass: --mass-kg KG."
    return (("Values", _values(analysis, motion)), ("How sure", _trust(analysis, row)), ("What to do", to_do))


def _is_length(analysis: Analysis) -> bool:
    return analysis.track.unit == "m"


def _values(analysis: Analysis, motion: Oscillation) -> str:
    x, moves = analysis.estimates, "bob swings" if _is_length(analysis) else f"{noun(analysis.track.unit)} oscillates"
    parts = [f"the {moves} with the period T\u00a0=\u00a0{kept(x['period'])}"]
    if "spring_constant" in x:
        parts.append(f"the mass gives the spring constant k\u00a0=\u00a0{kept(x['spring_constant'])}")
    start = f"{motion.damping.t0:.2f}\u00a0s"
    parts.append(
        f"its amplitude by the fit at t\u00a0=\u00a0{start} is A₀\u00a0=\u00a0{kept(prefixed(x['amplitude']))}"
    )
    if "damping_rate" in x:
        parts.append(f"its damping rate at the start is λ\u00a0=\u00a0{kept(x['damping_rate'])}")
    return f"{sentence('; '.join(parts))} {damping_sentence(analysis)}"


def _trust(analysis: Analysis, row: BudgetRow | None) -> str:
    noise = "more than noise" if is_about(analysis, "residuals") else "only noise"
    text = f"{trust_text(analysis, page=True)} The fit leaves {noise} in the residuals"
    if row is not None:
        greatest, symbol = row.contributions[0], "k" if row.name == "spring_constant" else "T"
        text += f"; {100.0 * greatest.share:.0f}\u00a0% of u({symbol})² comes from the {INPUTS[greatest.name].label}"
    return f"{text}."


def _largest(analysis: Analysis) -> BudgetRow | None:
    """Return the budget of the spring constant, or else of the period."""
    rows = {row.name: row for row in budgets_of(analysis) if row.contributions}
    return rows.get("spring_constant") or rows.get("period")


def _improvement(row: BudgetRow | None) -> str:
    if row is None:
        return ""
    greatest, symbol = row.contributions[0], "k" if row.name == "spring_constant" else "T"
    way = "record longer" if greatest.kind == "A" else f"find the {INPUTS[greatest.name].label} more accurately"
    return f"To know {symbol} better, {way}."
