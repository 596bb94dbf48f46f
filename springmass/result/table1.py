"""Table 1: its lines, each with an estimate of every run; and every number of a run by name, also as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipeline.analyse import Analysis
from pipeline.damping.laws import LAWS
from pipeline.findings.finding import kinds
from pipeline.numerics.estimate import Estimate
from pipeline.quantities import QUANTITIES
from springmass.typeset import cell


@dataclass(frozen=True, slots=True)
class TableRow:
    """One line of Table 1: an estimate for each run that gives it, or why none does; an index follows a space."""

    name: str
    quantity: str
    symbol: str
    page_symbol: str
    tex_symbol: str
    estimates: tuple[Estimate | None, ...]
    note: str = ""

    @property
    def on_screen(self) -> str:
        """The symbol in Unicode where an index cannot be set lower, as in T_s."""
        return self.page_symbol.replace(" ", "_")


def table_estimates(analysis: Analysis) -> dict[tuple[str, str], tuple[str, Estimate]]:
    """Return the contents of Table 1 for a run: each value with the damping law that it assumes, in words.

    The keys are the name of a quantity and, for a coefficient, the law whose values have a separate row. A coefficient
    is that of a law if all results assume it, because the user states it or the recording supports no other.
    """
    derived, damping = analysis.derived, analysis.damping
    law, certain = derived.law_of_coefficients, bool(damping.admissible) or damping.by_statement
    # A coefficient of a user-defined law is not one of these quantities, even if it has the same name.
    coefficients = derived.coefficients if derived.quoted and law in LAWS else {}
    moving = ("m/s", "m/s^2", "rad/s")  # what is recorded of a motion is zero on average, and a sensor's zero no result
    shown = {}
    for name, quantity in QUANTITIES.items():
        no_zero = name == "offset" and (is_about(analysis, "offset") or analysis.track.unit in moving)
        if no_zero or not quantity.in_table:
            continue
        if name in derived.estimates:
            by_law = quantity.by_law and derived.laws
            words = "" if not by_law else f"law {derived.law}" if derived.law else "any law"
            shown[name, ""] = words, derived.estimates[name]
        elif name in coefficients:
            shown[name, law] = f"{'law' if certain else 'if'} {law}", coefficients[name]
    return shown


def is_about(analysis: Analysis, subject: str) -> bool:
    """Return whether a finding is about a subject of ``about`` in findings.toml."""
    return any(subject in kinds()[finding.code].about for finding in analysis.findings)


def table_rows(runs: Sequence[Analysis]) -> tuple[TableRow, ...]:
    """Return Table 1: every quantity that at least one run gives, with one column per run."""
    columns = [table_estimates(run) for run in runs]
    rows = []
    for name, q in QUANTITIES.items():
        cells = [{law: cell for (of, law), cell in column.items() if of == name} for column in columns]
        for i, law in enumerate(dict.fromkeys(law for of_run in cells for law in of_run)):
            words = {of_run[law][0] for of_run in cells if law in of_run}
            label = words.pop() if len(words) == 1 else f"if {law}" if law else "by each run's law"
            estimates = tuple(of_run[law][1] if law in of_run else None for of_run in cells)
            rows.append(
                TableRow(
                    f"{law}.{name}" if i else name,
                    f"{q.label}, {label}" if label else q.label,
                    q.symbol,
                    q.page_symbol,
                    q.tex_symbol,
                    estimates,
                )
            )
    return tuple(rows)


def rows_and_needs(runs: Sequence[Analysis]) -> tuple[TableRow, ...]:
    """Return Table 1 with a line that says what the spring constant requires, if no run gives it."""
    rows, constant, q = table_rows(runs), "spring_constant", QUANTITIES["spring_constant"]
    if any(row.name == constant for row in rows) or not any(map(_needs_mass, runs)):
        return rows
    before = list(QUANTITIES)[: list(QUANTITIES).index(constant)]
    at = sum(row.name.rpartition(".")[2] in before for row in rows)
    row = TableRow(constant, q.label, q.symbol, q.page_symbol, q.tex_symbol, (None,) * len(runs), NEEDS_MASS)
    return *rows[:at], row, *rows[at:]


NEEDS_MASS = "needs the mass"


def _needs_mass(run: Analysis) -> bool:
    """Return whether a distance oscillates and only the mass is missing."""
    estimates = run.derived.estimates
    of_length = "period" in estimates and "amplitude" in estimates and estimates["amplitude"].unit == "m"
    return of_length and run.scene.bob_mass_kg is None and run.scene.hangs_on_spring


def numbers_of(analysis: Analysis) -> Mapping[str, Estimate]:
    """Return all estimates of a run and the coefficients of the selected law, by name."""
    return {**analysis.estimates, **analysis.derived.coefficients}


def _every_number(analysis: Analysis) -> dict[str, Estimate]:
    """Return every estimate of a run, and every law's parameters under names ``LAW.PARAMETER``."""
    everything = dict(analysis.estimates)
    for law, fit in analysis.damping.fits.items():
        everything |= {f"{law}.{name}": x for name, x in analysis.derived.parameters_of(fit).items()}
    return everything


def results_csv(names: Sequence[str], runs: Sequence[Analysis]) -> str:
    """Return every number of every run as CSV with the columns run, name, value, u, unit.

    Numbers keep all their digits: the file is for programs.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["run", "name", "value", "u", "unit"])
    for name, run in zip(names, runs, strict=True):
        for quantity, x in _every_number(run).items():
            writer.writerow([cell(name), quantity, repr(float(x.value)), repr(float(x.u)), x.unit])
    return out.getvalue()
