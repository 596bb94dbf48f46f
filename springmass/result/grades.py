"""Grades: of every number, whether it may be quoted, and why not.

A number is sound only if no finding contradicts the model that it comes from. A finding names the parts of the model
that it doubts (``doubts`` in findings.toml), and a quantity those that it comes from (``parts`` of its
:class:`pipeline.quantities.Quantity`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

from pipeline.analyse import Analysis
from pipeline.findings.finding import Finding, kinds
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.quantities import INPUTS, MODEL_PARTS, QUANTITIES
from springmass.result.table1 import numbers_of, table_rows

Grade = Literal["sound", "uncertain", "do not quote"]
GRADES: tuple[Grade, ...] = get_args(Grade)
UNCERTAIN = 0.05  # u over the value from which fewer than two digits are certain
MEANINGLESS = 0.5  # u over the value from which zero is within two standard uncertainties


@dataclass(frozen=True, slots=True)
class Reason:
    """A reason why a number may not be quoted, or as what; its grade if there is no worse one."""

    grade: Grade
    code: str  # of a finding, or the name of an input of the budget
    words: str = ""  # if the code is not enough


@dataclass(frozen=True, slots=True)
class Graded:
    """The grade of a number: that of the worst reason."""

    reasons: tuple[Reason, ...]

    @property
    def grade(self) -> Grade:
        """Whether the number may be quoted."""
        return max((reason.grade for reason in self.reasons), key=GRADES.index, default="sound")

    @property
    def why(self) -> str:
        """The reasons in words."""
        return ", ".join(dict.fromkeys(reason.words or reason.code for reason in self.reasons))


def grades_of(analysis: Analysis) -> dict[str, Graded]:
    """Return the grades of all estimates and coefficients by name, of whatever motion.

    A number is uncertain if a finding doubts a part of the model that it comes from, or if fewer than two of its digits
    are certain. It is not to be quoted if an error concerns it, if zero is within two standard uncertainties, or if the
    recording contradicts the law that was stated for it.
    """
    every = numbers_of(analysis)
    doubts = [(finding, doubted_by(finding)) for finding in analysis.findings]
    return {
        name: Graded((*_doubted(name, doubts), *_of_law(analysis, name), *_sized(analysis, name, x)))
        for name, x in every.items()
    }


def doubted_by(finding: Finding) -> frozenset[str]:
    """Return the parts of the model that a finding doubts; an error doubts all of them unless it names some."""
    kind = kinds()[finding.code]
    small = any(abs(finding.values.get(name, 0.0)) <= size for name, size in kind.doubts_above.items())
    if finding.severity == "info":
        return frozenset()
    named = kind.doubts_anyway if small else kind.doubts or ("everything",) * (finding.severity == "error")
    return frozenset(MODEL_PARTS if "everything" in named else named)


def _doubted(name: str, doubts: list[tuple[Finding, frozenset[str]]]) -> Iterator[Reason]:
    """Yield the findings that doubt what a quantity comes from; a coefficient of a user's law comes from every part."""
    parts = QUANTITIES[name].parts if name in QUANTITIES else MODEL_PARTS
    for finding, doubted in doubts:
        if doubted.intersection(parts):
            yield Reason("do not quote" if finding.severity == "error" else "uncertain", finding.code)


def _of_law(analysis: Analysis, name: str) -> Iterator[Reason]:
    """Yield why a quantity that assumes a damping law should not be quoted."""
    of_law = name not in QUANTITIES or QUANTITIES[name].by_law
    if of_law and analysis.damping.by_statement and analysis.damping.best.rejected:
        yield Reason("do not quote", "stated_law_rejected", "the recording contradicts the stated law")
    elif name in analysis.derived.coefficients and not analysis.derived.quoted:
        yield Reason("do not quote", "laws_not_separable", "several laws are admissible")


def _sized(analysis: Analysis, name: str, x: Estimate) -> Iterator[Reason]:
    """Judge a number by its u; a phase or a rest position has an arbitrary zero, and noise is not a result."""
    if isinstance(x, UpperLimit):
        yield Reason("sound", "upper_limit", "as an upper limit")
    elif name not in ("phase", "offset", "noise") and x.u > UNCERTAIN * abs(x.value):
        greatest = analysis.derived.budgets[name].contributions[0].name
        label = INPUTS[greatest].label
        if x.u > MEANINGLESS * abs(x.value):
            share = f"u is {100.0 * x.u / abs(x.value):.0f} % of it: " if x.value else ""
            yield Reason("do not quote", greatest, f"{share}{label}")
        else:
            yield Reason("uncertain", greatest, label)


def grades_text(analysis: Analysis, *, page: bool) -> str:
    """Return the symbols of Table 1 in groups: sound, uncertain and not to be quoted, each with its reason."""
    by_name = grades_of(analysis)
    groups: dict[Grade, dict[str, list[str]]] = {grade: {} for grade in GRADES}
    for row in table_rows([analysis]):
        if row.name in by_name:
            graded = by_name[row.name]
            groups[graded.grade].setdefault(graded.why, []).append(row.on_screen if page else row.symbol)
    parts = []
    for grade, by_reason in groups.items():
        words = [f"{', '.join(symbols)}{f' ({why})' if why else ''}" for why, symbols in by_reason.items()]
        if words:
            parts.append(f"{grade[0].upper()}{grade[1:]}: {'; '.join(words)}.")
    return " ".join(parts)
