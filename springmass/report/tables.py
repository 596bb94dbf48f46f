"""Tables of a report: Table 1, and every number as CSV."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.damping.laws import LAWS
from pipeline.damping.select import Damping
from pipeline.findings.finding import kinds
from pipeline.numerics.estimate import Estimate, UpperLimit, format_limit, format_value
from pipeline.registry.quantities import QUANTITIES

_PAGE_UNITS = {"1": "", "degC": "°C", "m/s^2": "m/s²", "1/s": "s⁻¹", "1/(m s)": "m⁻¹ s⁻¹"}
_SUPERSCRIPT = str.maketrans("-0123456789n", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ")
_POWER = re.compile(r"\^(?:\(([\dn-]+)\)|([\dn-]+))")
NOTHING = "-"


class TableKey(NamedTuple):
    """The identity of a line of Table 1.

    ``law`` is the law that the value assumes, "" for an average over laws, None if the table names none; ``certain``
    says whether all results assume it, because the user states it or the recording supports no other.
    """

    name: str
    law: str | None = None
    certain: bool = False
    row: str = ""
    """The law whose values have a separate row, for coefficients."""

    @property
    def words(self) -> str:
        """The damping law that the value assumes, in words; empty if the table names none."""
        if self.law is None:
            return ""
        if not self.law:
            return "any law"
        return f"law {self.law}" if self.certain else f"if {self.law}"


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
    def cells(self) -> tuple[str, ...]:
        """The estimates as printed, with two digits of u."""
        return tuple(NOTHING if x is None else str(x) for x in self.estimates)


def table_estimates(analysis: Analysis) -> dict[TableKey, Estimate]:
    """Return the contents of Table 1 for a run: estimates and coefficients, each with its law."""
    found = _shown_estimates(analysis)
    moving = ("m/s", "m/s^2", "rad/s")  # what is recorded of a motion is zero on average, and a sensor's zero no result
    if is_about(analysis, "offset") or analysis.track.unit in moving:
        found.pop(TableKey("offset"), None)
    return found


def is_about(analysis: Analysis, subject: str) -> bool:
    """Return whether a finding is about a subject of ``about`` in findings.toml."""
    return any(subject in kinds()[finding.code].about for finding in analysis.findings)


def _shown_estimates(analysis: Analysis) -> dict[TableKey, Estimate]:
    motion = analysis.motion
    if not isinstance(motion, Oscillation):
        return {TableKey(name): analysis.estimates[name] for name in _IN_TABLE if name in analysis.estimates}
    derived = motion.derived
    law, certain = derived.law_of_coefficients, bool(motion.damping.admissible) or motion.damping.by_statement
    # A coefficient of a user-defined law is not one of these quantities, even if it has the same name.
    coefficients = derived.coefficients if derived.quoted and law in LAWS else {}
    found = {}
    for name in _IN_TABLE:
        if name in derived.estimates:
            key = TableKey(name, derived.law, bool(derived.law)) if QUANTITIES[name].by_law else TableKey(name)
            found[key] = derived.estimates[name]
        elif name in coefficients:
            found[TableKey(name, law, certain, law)] = coefficients[name]
    return found


_IN_TABLE = tuple(name for name, quantity in QUANTITIES.items() if quantity.in_table)


def table_rows(
    runs: Sequence[Analysis | Mapping[TableKey, Estimate]], *, missing: bool = False
) -> tuple[TableRow, ...]:
    """Return Table 1: every quantity that at least one run gives, with one column per run.

    With ``missing``, a row says what the spring constant requires, if no run gives it.
    """
    columns = [table_estimates(run) if isinstance(run, Analysis) else run for run in runs]
    rows = []
    for name, q in QUANTITIES.items():
        keys = [{key.row: key for key in run if key.name == name} for run in columns]
        for i, law in enumerate(dict.fromkeys(row for of_run in keys for row in of_run)):
            words = {of_run[law].words for of_run in keys if law in of_run}
            label = words.pop() if len(words) == 1 else f"if {law}" if law else "by each run's law"
            estimates = tuple(
                run[of_run[law]] if law in of_run else None for run, of_run in zip(columns, keys, strict=True)
            )
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
        if missing and name == "spring_constant" and not any(keys) and any(map(_needs_mass, runs, columns)):
            rows.append(TableRow(name, q.label, q.symbol, q.page_symbol, q.tex_symbol, (None,) * len(runs), NEEDS_MASS))
    return tuple(rows)


NEEDS_MASS = "needs the mass: --mass-kg KG"


def _needs_mass(run: Analysis | Mapping[TableKey, Estimate], column: Mapping[TableKey, Estimate]) -> bool:
    """Return whether a distance oscillates and only the mass is missing."""
    if isinstance(run, Analysis) and run.scene.bob_mass_kg is not None:
        return False
    amplitude = column.get(TableKey("amplitude"))
    return TableKey("period") in column and amplitude is not None and amplitude.unit == "m"


def every_number(analysis: Analysis) -> dict[str, Estimate]:
    """Return every estimate of a run, and every law's parameters under names ``LAW.PARAMETER``."""
    everything = dict(analysis.estimates)
    if isinstance(analysis.motion, Oscillation):
        derived = analysis.motion.derived
        for law, fit in analysis.motion.damping.fits.items():
            everything |= {f"{law}.{name}": x for name, x in derived.parameters_of(fit).items()}
    return everything


def results_csv(names: Sequence[str], runs: Sequence[Analysis | Mapping[str, Estimate]]) -> str:
    """Return every number of every run as CSV with the columns run, name, value, u, unit.

    Numbers keep all their digits: the file is for programs.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["run", "name", "value", "u", "unit"])
    for name, run in zip(names, runs, strict=True):
        for quantity, x in (every_number(run) if isinstance(run, Analysis) else run).items():
            writer.writerow([cell(name), quantity, repr(float(x.value)), repr(float(x.u)), x.unit])
    return out.getvalue()


def cell(text: str) -> str:
    """Return a text of foreign origin as a safe cell of a CSV file.

    A spreadsheet evaluates a cell that begins with ``=``, ``+``, ``-`` or ``@`` as a formula; a leading apostrophe
    makes it text. Numbers remain numbers.

    Examples
    --------
    >>> cell("=1+1"), cell("-3.5")
    ("'=1+1", '-3.5')
    """
    shown = visible(text)
    try:
        float(shown)
    except ValueError:
        return f"'{shown}" if shown.strip()[:1] in _FORMULA else shown
    return shown


_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠")
"""Characters with which a formula begins in a spreadsheet."""


def pretty(estimate: Estimate | None) -> str:
    """Return an estimate for the page: the digits of :func:`pipeline.numerics.estimate.format_value`, typeset.

    Examples
    --------
    >>> pretty(Estimate(-8.36e-5, 9.6e-7, "m"))
    '(−8.360 ± 0.096) × 10⁻⁵ m'
    """
    if estimate is None:
        return "–"
    if isinstance(estimate, UpperLimit):
        return f"< {_typeset(format_limit(estimate.limit))} {page_unit(estimate.unit)}".rstrip() + " (95 %)"
    number = format_value(estimate.value, estimate.u)
    return f"{_typeset(number)} {page_unit(estimate.unit)}".rstrip()


def cells(estimate: Estimate | None) -> str:
    """Return an estimate as value, u and unit for three cells of a spreadsheet, with the digits of u, divided by |.

    Examples
    --------
    >>> cells(Estimate(0.7525961, 4.96e-5, "s")), cells(Estimate(101325.0, 1490.0, "Pa"))
    ('0.752596|0.000050|s', '1.013e+05|0.015e+05|Pa')
    """
    if estimate is None:
        return "||"
    if isinstance(estimate, UpperLimit):
        return f"< {format_limit(estimate.limit)}||{page_unit(estimate.unit)}"
    value, _, u = format_value(estimate.value, estimate.u).partition(" +- ")
    u, _, power = u.partition(")")
    return f"{value.lstrip('(')}{power}|{u}{power}|{page_unit(estimate.unit)}"


def pretty_number(value: float | None, digits: int = 2) -> str:
    """Typeset a number without an uncertainty to a few digits; return a dash for None or NaN.

    Examples
    --------
    >>> pretty_number(498765.0, 3)
    '4.99 × 10⁵'
    """
    if value is None or value != value:
        return "–"
    return _typeset(f"{value:#.{digits}g}".rstrip("."))


# For each unit: (upper limit of the value, factor, unit with its prefix), the smallest limit first. Periods stay in
# seconds down to 0.1 s.
_PREFIXES = {
    "m": ((1e-3, 1e6, "µm"), (1.0, 1e3, "mm")),
    "kg": ((1e-3, 1e6, "mg"), (1.0, 1e3, "g")),
    "s": ((1e-3, 1e6, "µs"), (0.1, 1e3, "ms")),
    "m/s": ((1e-4, 1e6, "µm/s"), (0.1, 1e3, "mm/s")),
}


def prefixed(estimate: Estimate) -> Estimate:
    """Return an estimate with an SI prefix that gives a value of about 1 to 1000; most units have no prefixes.

    Examples
    --------
    >>> prefixed(Estimate(0.05145, 2e-5, "m"))
    51.450(20) mm
    """
    size = max(abs(estimate.value), estimate.u if math.isfinite(estimate.u) else 0.0)
    for below, factor, unit in _PREFIXES.get(estimate.unit, ()):
        if 0.0 < size < below:
            value, u = (float(f"{x * factor:.15g}") for x in (estimate.value, estimate.u))
            return replace(estimate, value=value, u=u, unit=unit, variable=None)
    return estimate


def page_unit(unit: str) -> str:
    """Return a unit as the page writes it.

    Examples
    --------
    >>> page_unit("1/(m s)"), page_unit("rad/s^2"), page_unit("m^(1-n)/s"), page_unit("(m/s^2)^(1-n)/s")
    ('m⁻¹ s⁻¹', 'rad/s²', 'm¹⁻ⁿ/s', '(m/s²)¹⁻ⁿ/s')
    """
    if unit in _PAGE_UNITS:
        return _PAGE_UNITS[unit]
    return _POWER.sub(lambda power: (power[1] or power[2]).translate(_SUPERSCRIPT), unit)


def law_status(damping: Damping, name: str) -> str:
    """Return the status of a law in a few words."""
    if name == damping.selected:
        if damping.by_statement:
            return "stated, and rejected" if damping.fits[name].rejected else "stated"
        return "rejected, yet the least bad" if damping.fits[name].rejected else "selected"
    if damping.fits[name].rejected:
        return "rejected"
    return "admissible" if name in damping.admissible else "unlikely"


def _typeset(number: str) -> str:
    mantissa, mark, power = number.replace("+-", "±").partition("e")
    mantissa = mantissa.replace("-", "−")
    return f"{mantissa} × 10{raised(int(power))}" if mark else mantissa


def raised(power: int) -> str:
    """Return an exponent in superscript digits."""
    return str(power).translate(_SUPERSCRIPT)
