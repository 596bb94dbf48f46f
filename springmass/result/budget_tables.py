"""The shares of an uncertainty budget, which `pipeline.results.budget` makes, as a text table and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.analyse import Analysis
from pipeline.quantities import INPUTS, QUANTITIES
from pipeline.results.budget import Budget, Contribution
from springmass.result.table1 import table_estimates
from springmass.typeset import cell

SAME = ("frequency", "angular_frequency")  # determined by the period alone
LEAST_SHARE = 1e-3  # of the variance; smaller shares do not change a printed digit of u


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One quantity of the budget table."""

    name: str
    quantity: str
    budget: Budget
    contributions: tuple[Contribution, ...]
    rest: float


def budgets_of(analysis: Analysis) -> tuple[BudgetRow, ...]:
    """Return the budget table of a run in the order of Table 1; empty if nothing oscillates.

    Frequencies are omitted, because they share the period's budget.
    """
    budgets, rows = analysis.budgets, []
    for name in dict.fromkeys(name for name, _ in table_estimates(analysis)):
        if name in budgets and name not in SAME and budgets[name].contributions:
            every = budgets[name].contributions
            listed = tuple(c for c in every if c.share >= LEAST_SHARE)
            rows.append(
                BudgetRow(
                    name, QUANTITIES[name].label, budgets[name], listed, sum(c.share for c in every[len(listed) :])
                )
            )
    return tuple(rows)


def correlations_of(analysis: Analysis) -> list[tuple[str, list[float]]]:
    """Return the symbol of each quantity of the budget table, and its correlations with those above it."""
    joint = analysis.derived.joint
    at = [joint.names.index(row.name) for row in budgets_of(analysis)]
    return [
        (QUANTITIES[joint.names[row]].page_symbol, joint.correlation[row, at[:i]].tolist()) for i, row in enumerate(at)
    ]


def budget_text(analysis: Analysis) -> str:
    """Return a brief budget in ASCII: one line per quantity with its two largest contributions.

    Quantities with only one input of at least 1 % are omitted, because their line would give no information, but for
    the spring constant, whose u may come from a mass that was not stated.
    """
    shown = {row: [c for c in row.contributions if c.share >= 0.01] for row in budgets_of(analysis)}
    rows = [row for row, inputs in shown.items() if len(inputs) > 1 or row.name == "spring_constant"]
    if not rows:
        return ""
    left = max(len(row.quantity) for row in rows) + 2
    lines = ["Where the uncertainty comes from (share of the variance; A: the record's scatter, B: anything else):"]
    for row in rows:
        greatest = [f"{INPUTS[c.name].label} ({c.kind}) {100 * c.share:.0f} %" for c in shown[row][:2]]
        lines.append(f"  {row.quantity:<{left}}{', '.join(greatest)}")
    return "\n".join(lines)


def budget_csv(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return every budget as CSV, with one line per input and all digits of the numbers."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    heads = ["run", "quantity", "input", "type", "value", "u", "unit", "sensitivity", "contribution", "share"]
    writer.writerow(heads)
    for run, analysis in zip(names, analyses, strict=True):
        for quantity, budget in analysis.budgets.items():
            for c in budget.contributions:
                given = ["", "", ""] if c.input is None else [repr(c.input.value), repr(c.input.u), c.input.unit]
                slope = "" if c.sensitivity is None else repr(c.sensitivity)
                writer.writerow([cell(run), quantity, c.name, c.kind, *given, slope, repr(c.u), repr(c.share)])
    return out.getvalue()
