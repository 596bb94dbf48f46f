"""Which numbers of Table 1 may be quoted: for each row sound, uncertain or not to be quoted, with the reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from pipeline.analyse import Analysis, Oscillation
from pipeline.findings.finding import kinds
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.numerics.quantity import Unit
from pipeline.registry.quantities import INPUTS, QUANTITIES
from springmass.report.advice import Harm, harm_of
from springmass.runs.rows import table_estimates, table_rows

Grade = Literal["sound", "uncertain", "do not quote"]
UNCERTAIN = 0.05  # u over the value from which fewer than two digits are certain
MEANINGLESS = 0.5  # u over the value from which zero is within two standard uncertainties
_WITH_AIR = ("reynolds_number", "reynolds_number_start", "keulegan_carpenter_number", "drag_coefficient")


@dataclass(frozen=True, slots=True)
class Trust:
    """Whether a number may be quoted, and why not."""

    grade: Grade
    why: str = ""


GRADES: tuple[Grade, ...] = ("sound", "uncertain", "do not quote")


def trust_of(analysis: Analysis) -> dict[str, Trust]:
    """Return the trust in every quantity of Table 1 by its name; empty if nothing oscillates.

    A number is uncertain if it depends on an assumption that a warning names, or if fewer than two of its digits are
    certain. It is not to be quoted if an error concerns it, if zero is within two standard uncertainties, or if the
    recording contradicts the law that was stated for it. The worst of these decides; every reason is kept.
    """
    motion = analysis.motion
    if not isinstance(motion, Oscillation):
        return {}
    found = {}
    for key, x in table_estimates(analysis).items():
        reasons = [*_assumed(analysis, key.name, x), *_sized(motion, key.name, x)]
        if motion.damping.best.rejected:
            if QUANTITIES[key.name].by_law and motion.damping.by_statement:
                reasons.append(Trust("do not quote", "the recording contradicts the stated law"))
            elif key.row:
                reasons.append(Trust("uncertain", "no damping law fits"))
        grade = max(reasons, key=lambda each: GRADES.index(each.grade), default=Trust("sound")).grade
        found[key.name] = Trust(grade, ", ".join(dict.fromkeys(each.why for each in reasons)))
    return found


def _assumed(analysis: Analysis, name: str, x: Estimate) -> Iterator[Trust]:
    """Yield the errors and the unchecked assumptions on which a quantity depends."""
    for finding in analysis.findings:
        harm = harm_of(finding.code, finding.severity)
        if harm in (Harm.UNUSABLE, Harm.SCALE) and _concerns(kinds()[finding.code].symptom, name, x.unit):
            yield Trust("do not quote" if harm is Harm.UNUSABLE else "uncertain", finding.code)


def _concerns(symptom: str, name: str, unit: str) -> bool:
    """Return whether a quantity depends on what findings of a symptom are about."""
    if symptom == "Times":
        return any(letter in unit for letter in "sz") or unit == "N/m" or name in _WITH_AIR[:2]
    if symptom == "Distances":
        return isinstance(QUANTITIES[name].unit, Unit) or unit.startswith("m") or name in _WITH_AIR
    return symptom in ("Motion", "Recording") or (symptom == "Scene" and name in ("spring_constant", *_WITH_AIR))


def _sized(motion: Oscillation, name: str, x: Estimate) -> Iterator[Trust]:
    """Judge a number by its u; a rest position has an arbitrary zero, and noise is not a result."""
    if isinstance(x, UpperLimit):
        yield Trust("sound", "as an upper limit")
    elif name not in ("offset", "noise") and x.u > UNCERTAIN * abs(x.value):
        greatest = INPUTS[motion.derived.budgets[name].contributions[0].name].label
        if x.u > MEANINGLESS * abs(x.value):
            share = f"u is {100.0 * x.u / abs(x.value):.0f} % of it: " if x.value else ""
            yield Trust("do not quote", f"{share}{greatest}")
        else:
            yield Trust("uncertain", greatest)


def trust_text(analysis: Analysis, *, page: bool = False) -> str:
    """Return the symbols of Table 1 in groups: sound, uncertain and not to be quoted, each with its reason."""
    found = trust_of(analysis)
    groups: dict[Grade, dict[str, list[str]]] = {grade: {} for grade in GRADES}
    for row in table_rows([analysis]):
        if row.name in found:
            trust = found[row.name]
            groups[trust.grade].setdefault(trust.why, []).append(row.on_screen if page else row.symbol)
    parts = []
    for grade, by_reason in groups.items():
        words = [f"{', '.join(symbols)}{f' ({why})' if why else ''}" for why, symbols in by_reason.items()]
        if words:
            parts.append(f"{grade[0].upper()}{grade[1:]}: {'; '.join(words)}.")
    return " ".join(parts)
