"""Tables of a report: Table 1, and every number as CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.damping.laws import FunctionLaw
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate, format_value
from pipeline.registry.quantities import QUANTITIES

__all__ = [
    "TableRow",
    "cell",
    "every_number",
    "law_status",
    "page_unit",
    "pretty",
    "pretty_number",
    "raised",
    "results_csv",
    "table_estimates",
    "table_rows",
]

_PAGE_UNITS = {"1": "", "degC": "°C", "m/s^2": "m/s²", "1/s": "s⁻¹", "1/(m s)": "m⁻¹ s⁻¹"}
_SUPERSCRIPT = str.maketrans("-0123456789n", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ")
_POWER = re.compile(r"\^\(?([\dn-]+)\)?")
NOTHING = "-"


@dataclass(frozen=True, slots=True)
class TableRow:
    """One line of Table 1.

    Parameters
    ----------
    name : str
        As in ``Analysis.estimates``; "gamma" and "beta" are those of both drags together, with "mu", "c" and "n"
        the selected law's, where these do not describe the record.
    quantity : str
        In words.
    symbol, page_symbol, tex_symbol : str
        In ASCII, in Unicode (an index stands after a space) and as the inside of ``$...$``.
    estimates : tuple of Estimate or None
        One a run; None where the run does not give it.
    """

    name: str
    quantity: str
    symbol: str
    page_symbol: str
    tex_symbol: str
    estimates: tuple[Estimate | None, ...]

    @property
    def cells(self) -> tuple[str, ...]:
        """The estimates as printed, two digits of u."""
        return tuple(NOTHING if x is None else format_value(x.value, x.u, x.unit) for x in self.estimates)


def table_estimates(analysis: Analysis) -> dict[str, Estimate]:
    """Return what Table 1 says of a run: its estimates, and the selected law's coefficients, by name."""
    found = {name: _estimate(analysis, name) for name, quantity in QUANTITIES.items() if quantity.in_table}
    return {name: estimate for name, estimate in found.items() if estimate is not None}


def table_rows(runs: Sequence[Analysis | Mapping[str, Estimate]]) -> tuple[TableRow, ...]:
    """Return Table 1: every quantity that at least one run gives, one column a run.

    Parameters
    ----------
    runs : sequence of Analysis, or of what :func:`table_estimates` kept of one
    """
    told = [table_estimates(run) if isinstance(run, Analysis) else run for run in runs]
    rows = []
    for name, q in QUANTITIES.items():
        estimates = tuple(run.get(name) for run in told)
        if any(estimate is not None for estimate in estimates):
            rows.append(TableRow(name, q.label, q.symbol, q.page_symbol, q.tex_symbol, estimates))
    return tuple(rows)


def every_number(analysis: Analysis) -> dict[str, Estimate]:
    """Return every estimate of a run and every law's parameters, these named ``LAW.PARAMETER``."""
    everything = dict(analysis.estimates)
    if isinstance(analysis.motion, Oscillation):
        for law, fit in analysis.motion.damping.fits.items():
            everything |= {f"{law}.{name}": x for name, x in fit.joint.estimates().items()}
    return everything


def results_csv(names: Sequence[str], runs: Sequence[Analysis | Mapping[str, Estimate]]) -> str:
    """Return every number of every run as CSV with the columns run, name, value, u, unit.

    Numbers keep all their digits: the file is for programs.

    Parameters
    ----------
    names : sequence of str
    runs : sequence of Analysis, or of what :func:`every_number` kept of one
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["run", "name", "value", "u", "unit"])
    for name, run in zip(names, runs, strict=True):
        for quantity, x in (every_number(run) if isinstance(run, Analysis) else run).items():
            writer.writerow([cell(name), quantity, repr(float(x.value)), repr(float(x.u)), x.unit])
    return out.getvalue()


def cell(text: str) -> str:
    """Return a text from outside for a cell of a CSV file.

    A spreadsheet takes what begins with ``=``, ``+``, ``-`` or ``@`` for a formula and runs it; an apostrophe in front
    makes it text. Numbers stay numbers.

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
"""What a spreadsheet takes for the beginning of a formula."""


def pretty(estimate: Estimate | None) -> str:
    """Return an estimate for the page: the digits of :func:`pipeline.numerics.estimate.format_value`, typeset.

    Examples
    --------
    >>> pretty(Estimate(-8.36e-5, 9.6e-7, "m"))
    '(−8.360 ± 0.096) × 10⁻⁵ m'
    """
    if estimate is None:
        return "–"
    number = format_value(estimate.value, estimate.u)
    return f"{_typeset(number)} {page_unit(estimate.unit)}".rstrip()


def pretty_number(value: float | None, digits: int = 2) -> str:
    """Return a number without an uncertainty to a few digits, typeset; a dash for None or what is no number.

    Examples
    --------
    >>> pretty_number(498765.0, 3)
    '4.99 × 10⁵'
    """
    if value is None or value != value:
        return "–"
    return _typeset(f"{value:#.{digits}g}".rstrip("."))


def page_unit(unit: str) -> str:
    """Return a unit as the page writes it.

    Examples
    --------
    >>> page_unit("1/(m s)"), page_unit("rad/s^2"), page_unit("m^(1-n)/s")
    ('m⁻¹ s⁻¹', 'rad/s²', 'm¹⁻ⁿ/s')
    """
    if unit in _PAGE_UNITS:
        return _PAGE_UNITS[unit]
    return _POWER.sub(lambda power: power[1].translate(_SUPERSCRIPT), unit)


def law_status(damping: Damping, name: str) -> str:
    """Return what became of a law, in a word or two.

    Parameters
    ----------
    damping : Damping
    name : str
    """
    if name == damping.selected:
        return "rejected, yet the least bad" if damping.fits[name].rejected else "selected"
    if damping.fits[name].rejected:
        return "rejected"
    return "admissible" if name in damping.admissible else "unlikely"


def _estimate(analysis: Analysis, name: str) -> Estimate | None:
    if name in analysis.estimates or not isinstance(analysis.motion, Oscillation):
        return analysis.estimates.get(name)
    derived = analysis.motion.derived
    # A coefficient of a law of the user's own is not ours, even where it has the same name.
    return None if isinstance(derived.laws[0].fit.law, FunctionLaw) else derived.coefficients.get(name)


def _typeset(number: str) -> str:
    mantissa, mark, power = number.replace("+-", "±").partition("e")
    mantissa = mantissa.replace("-", "−")
    return f"{mantissa} × 10{raised(int(power))}" if mark else mantissa


def raised(power: int) -> str:
    """Return an exponent in raised digits."""
    return str(power).translate(_SUPERSCRIPT)
