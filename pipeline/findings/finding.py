"""Findings: the stages yield codes with numbers, and ``findings.toml`` has the words of each code."""

from __future__ import annotations

import string
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple, get_origin, get_type_hints

from pipeline.notice import Notice, Severity
from pipeline.units import amount, noun, number, plural

RANK = {"error": 0, "warning": 1, "info": 2}

# The code for a note in a run file of another version of springmass that this one does not know.
UNKNOWN_CODE = "unknown_code"

# Unit and usual form of a number whose name ends so; one that ends in _m has the unit of the recording.
SUFFIXES = {"_s": ("s", ".3g"), "_hz": ("Hz", ".4g"), "_metres": ("m", ".3g"), "_rad": ("rad", ".2g")}


@dataclass(frozen=True, slots=True)
class FindingKind:
    """The block of one code in ``findings.toml``, which explains each field."""

    symptom: str
    severity: tuple[Severity, ...]
    meaning: str
    cause: str
    example: Mapping[str, float | str]
    says: tuple[str, ...] = ()
    why: tuple[str, ...] = ()
    details: tuple[str, ...] = ()
    advice: tuple[str, ...] = ("",)
    states: tuple[str, ...] = ()
    figure: str = ""
    harm: str = "uncertainty"
    doubts: tuple[str, ...] = ()
    doubts_above: Mapping[str, float] = field(default_factory=dict)
    doubts_anyway: tuple[str, ...] = ()
    about: tuple[str, ...] = ()
    explains: tuple[str, ...] = ()
    consequence: str | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding about a run, in words.

    ``message`` is one sentence with the number that matters, ``details`` are for readers who want more, ``values`` are
    the numbers in SI units, and ``advice`` says what to do; a note has none.
    """

    code: str
    severity: Severity
    message: str
    details: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    advice: str = ""


@cache
def kinds() -> Mapping[str, FindingKind]:
    """Return the blocks of ``findings.toml`` by code, in its order."""
    import tomllib

    blocks = tomllib.loads(Path(__file__).with_name("findings.toml").read_text(encoding="utf-8"))
    several = {name for name, kind in get_type_hints(FindingKind).items() if get_origin(kind) is tuple}
    for block in blocks.values():
        block |= {name: (x,) if isinstance(x := block[name], str) else tuple(x) for name in several & block.keys()}
    return {code: FindingKind(**block) for code, block in blocks.items()}


def word(found: Notice, unit: str = "m") -> Finding:
    """Put into words what a stage found in a recording whose values have this unit."""
    kind = kinds()[found.code]
    severity = found.severity or kind.severity[0]
    if severity not in kind.severity:
        raise ValueError(f"finding {found.code!r} has no severity {severity!r} in findings.toml")
    numbers = {name: each for name, each in found.numbers.items() if each is not None}
    shown = {name: _Number(name, each, unit) for name, each in numbers.items()}
    if kind.why:
        shown["why"] = _Number("why", why(found, unit), unit)
    return Finding(
        found.code,
        severity,
        _filled(("{sentence}", *kind.says), shown, unit)[0],
        " ".join(each[:1].upper() + each[1:] for each in _filled(kind.details, shown, unit)),
        {name: each for name, each in numbers.items() if not isinstance(each, str)},
        "" if severity == "info" else _filled(kind.advice, shown, unit)[0],
    )


def why(found: Notice, unit: str = "m") -> str:
    """Return what something that a stage found follows from, in words without a full stop."""
    shown = {name: _Number(name, each, unit) for name, each in found.numbers.items() if each is not None}
    return "; ".join(_filled(kinds()[found.code].why, shown, unit))


def usual_advice(code: str) -> str:
    """Return what to do about a finding of the example, in a recording of a length."""
    kind = kinds()[code]
    return word(Notice(code, kind.example, kind.severity[-1])).advice or kind.advice[-1]


def worded(unit: str, *groups: Iterable[Notice]) -> tuple[Finding, ...]:
    """Put all that was found into words, the most severe first, without what another finding explains."""
    every = [found for group in groups for found in group]
    explained = {code for found in every for code in kinds()[found.code].explains}
    return by_severity(word(found, unit) for found in every if found.code not in explained)


def by_severity(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings with the most severe first; those of equal severity keep their order."""
    return tuple(sorted(findings, key=lambda finding: RANK[finding.severity]))


def _filled(sentences: Sequence[str], shown: Mapping[str, _Number], unit: str) -> list[str]:
    """Return the sentences whose numbers are all there, with the numbers in their places."""
    rest = "rest position" if unit in ("m", "rad") else f"mean {noun(unit)}"
    echoes = {"echoes": "false echoes"} if unit == "m" else {}  # nothing else has any
    known = {"value": noun(unit), "values": plural(unit), "rest": rest, **echoes, **shown}
    return [each.format_map(known) for each in sentences if _names(each) <= known.keys()]


def _names(sentence: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(sentence) if name}


class _Number(NamedTuple):
    """A number that a sentence shows with its unit."""

    name: str
    value: float | str
    unit: str

    def __format__(self, form: str) -> str:
        if isinstance(self.value, str):
            return self.value
        if form.endswith("%"):
            return f"{number(100.0 * self.value, f'{form[:-1]}.2g')} %"
        if self.name.endswith("_m"):
            return amount(self.value, self.unit, form or ".2g")
        for end, (symbol, usual) in SUFFIXES.items():
            if self.name.endswith(end):
                return f"{number(self.value, form or usual)} {symbol}"
        if not form and self.value > 1e6:
            return "over a million"
        return number(self.value, form)
