"""The table of the trials: a line for each kind, and what all of them come to."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.trials.troubles.judge import LIMIT, Verdict
from tests.trials.troubles.record import Kind

CURED = 3.0  # greatest median u, over the rms error, of a kind that is to be cured
MEASURED = 16  # records of which the rms error is known well enough to be held against that


@dataclass(frozen=True, slots=True)
class Line:
    """One kind at one tier."""

    kind: Kind
    verdicts: Sequence[Verdict]

    def count(self, word: str) -> int:
        """Return how many records had this verdict."""
        return sum(one.word == word for one in self.verdicts)

    @property
    def n(self) -> int:
        """How many records."""
        return len(self.verdicts)

    @property
    def wide(self) -> tuple[float, str]:
        """The greatest median u over the rms error of the estimates within the limit, and which estimate's it is."""
        ratios = [(0.0, "")]
        for name in dict.fromkeys(name for one in self.verdicts for name in one.given if name not in self.kind.spread):
            held = [one.given[name] for one in self.verdicts if name in one.given and one.given[name].z <= LIMIT]
            if len(held) > max(2, self.n // 2):
                rms = math.sqrt(float(np.mean([one.error**2 for one in held])))
                if rms > 0.0:
                    ratios.append((float(np.median([one.u_own for one in held])) / rms, name))
        return max(ratios)

    @property
    def worst(self) -> str:
        """The estimate that is off farthest, with the most by which, of records not named."""
        off = [(g.z, name) for one in self.verdicts if not one.named for name, g in one.given.items()]
        z, name = max(off, default=(0.0, ""))
        return f"{name} {z:.1f}" if z > LIMIT else ""

    @property
    def warnings(self) -> str:
        """The codes of warnings, the most frequent first, with how often."""
        codes = [code for one in self.verdicts for code in one.warnings]
        shares = sorted(dict.fromkeys(codes), key=lambda code: -codes.count(code))
        return ", ".join(f"{code} {codes.count(code)}" for code in shares)

    @property
    def holds(self) -> bool:
        """Whether the kind is within the limits that hold for every single kind."""
        if self.count("confident wrong") > self.n // 10:
            return False
        if self.kind.plain and any(one.warnings for one in self.verdicts):
            return False
        return self.count("refused") <= self.n // 10 and not self.too_wide

    @property
    def too_wide(self) -> bool:
        """Whether the kind is to be cured, and passes by its uncertainties alone."""
        return self.kind.cure and self.n >= MEASURED and self.wide[0] > CURED


def summed(kinds: Sequence[Kind], verdicts: Sequence[Verdict]) -> list[Line]:
    """Return a line for every kind that has a verdict."""
    lines = [Line(kind, [one for one in verdicts if one.kind == kind.name]) for kind in kinds]
    return [line for line in lines if line.verdicts]


def total(lines: Sequence[Line]) -> str:
    """Return what all lines come to, in a sentence."""
    n = sum(line.n for line in lines)
    wrong, refused = (sum(line.count(word) for line in lines) for word in ("confident wrong", "refused"))
    plain = [one for line in lines if line.kind.plain for one in line.verdicts]
    alarms = sum(bool(one.warnings) for one in plain)
    return (
        f"{len(lines)} kinds, {n} records: confident wrong {wrong} ({wrong / n:.1%}), right or named "
        f"{n - wrong - refused} ({1.0 - (wrong + refused) / n:.1%}), refused without a name {refused}; "
        f"{sum(not line.holds for line in lines)} kinds beyond a limit; "
        f"false alarms on {alarms} of {len(plain)} plain records"
    )


def beyond(lines: Sequence[Line]) -> str:
    """Return a line for every kind that is beyond a limit."""
    words = ("confident wrong", "right", "named", "refused")
    rows = []
    for line in lines:
        if not line.holds:
            counts = ", ".join(f"{line.count(word)} {word}" for word in words)
            notes = [counts, line.worst, f"u over rms error {line.wide}", line.warnings]
            rows.append(f"{line.kind.name}: {'; '.join(filter(None, notes))}")
    return "\n".join(rows)


def as_markdown(lines: Sequence[Line]) -> str:
    """Return the table for a page of the documentation: kinds by what stands before the colon of their names."""
    rows = [
        "| trouble | kinds | records | right | named | refused | wrong, not named | greatest median u over rms error |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    groups: dict[str, list[Line]] = {}
    for line in lines:
        groups.setdefault(line.kind.name.split(":")[0], []).append(line)
    for name, group in groups.items():
        counts = [sum(line.count(w) for line in group) for w in ("right", "named", "refused", "confident wrong")]
        cured = max((line.wide[0] for line in group if line.kind.cure), default=0.0)
        numbers = [len(group), sum(line.n for line in group), *counts]
        rows.append(f"| {name} | {' | '.join(map(str, numbers))} | {f'{cured:.1f}' if cured else ''} |")
    return "\n".join(rows)
