"""Tables of a report: Table 1 for the terminal and the page, and every number as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate, format_value

__all__ = [
    "QUANTITIES",
    "TableRow",
    "cell",
    "law_status",
    "page_unit",
    "pretty",
    "pretty_number",
    "raised",
    "results_csv",
    "table_rows",
    "text_table",
]

# name, quantity in words, symbol in ASCII, on the page, in LaTeX
_QUANTITIES = (
    ("period", "period", "T", "T", "T"),
    ("frequency", "frequency", "f", "f", "f"),
    ("angular_frequency", "angular frequency", "omega", "ω", r"\omega"),
    ("spring_constant", "spring constant", "k", "k", "k"),
    ("amplitude", "amplitude at the start", "A0", "A₀", "A_0"),
    ("displacement_amplitude", "amplitude of the displacement", "x0", "x₀", "x_0"),
    ("offset", "rest position", "y0", "y₀", "y_0"),
    ("noise", "noise of one sample", "sigma", "σ", r"\sigma"),
    ("damping_rate", "damping rate at the start", "lambda", "λ", r"\lambda"),
    ("relaxation_rate", "relaxation rate", "r", "r", "r"),
    ("relaxation_rate_slow", "slow relaxation rate", "r_1", "r 1", "r_1"),
    ("relaxation_rate_fast", "fast relaxation rate", "r_2", "r 2", "r_2"),
    ("quality_factor", "quality factor", "Q", "Q", "Q"),
    ("velocity_rms", "velocity, root mean square", "v_rms", "v rms", r"v_\mathrm{rms}"),
    ("reynolds_number", "Reynolds number", "Re", "Re", r"\mathit{Re}"),
    ("keulegan_carpenter_number", "Keulegan-Carpenter number", "KC", "KC", r"\mathit{KC}"),
    ("drag_coefficient", "drag coefficient", "C_d", "C d", r"C_\mathrm{d}"),
    ("gamma", "linear damping", "gamma", "γ", r"\gamma"),
    ("beta", "quadratic damping", "beta", "β", r"\beta"),
    ("mu", "dry friction", "mu", "μ", r"\mu"),
    ("c", "drag by a power of the amplitude", "c", "c", "c"),
    ("n", "that power", "n", "n", "n"),
)
QUANTITIES = {name: quantity for name, quantity, *_ in _QUANTITIES}

_PAGE_UNITS = {"degC": "°C", "m/s^2": "m/s²", "1/s": "s⁻¹", "1/(m s)": "m⁻¹ s⁻¹"}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
NOTHING = "-"


@dataclass(frozen=True, slots=True)
class TableRow:
    """One line of Table 1.

    Parameters
    ----------
    name : str
        As in ``Analysis.estimates``; "gamma", "beta", "mu", "c" and "n" are the selected law's.
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


def table_rows(analyses: Sequence[Analysis]) -> tuple[TableRow, ...]:
    """Return Table 1: every quantity that at least one run gives, one column a run.

    Parameters
    ----------
    analyses : sequence of Analysis
    """
    rows = []
    for name, quantity, symbol, page_symbol, tex_symbol in _QUANTITIES:
        estimates = tuple(_estimate(analysis, name) for analysis in analyses)
        if any(estimate is not None for estimate in estimates):
            rows.append(TableRow(name, quantity, symbol, page_symbol, tex_symbol, estimates))
    return tuple(rows)


def text_table(names: Sequence[str], analyses: Sequence[Analysis], *, width: int = 100) -> str:
    """Return Table 1 in plain ASCII, aligned; runs that do not fit side by side follow in a further block.

    Parameters
    ----------
    names : sequence of str
        Of the runs; shortened where they are wider than their column.
    analyses : sequence of Analysis
    width : int
        Columns of the terminal.

    Examples
    --------
    >>> import numpy as np
    >>> from pipeline.analyse import analyse
    >>> from pipeline.track import Track
    >>> t = np.arange(1000) / 100
    >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(1).standard_normal(1000)
    >>> text_table(["bob"], [analyse(Track.from_arrays(t, y))]).splitlines()[2].split()[::4]
    ['period', '0.000022']
    """
    rows = table_rows(analyses)
    left = max([len("quantity"), *(len(row.quantity) for row in rows)]) + 2
    middle = max([len("symbol"), *(len(row.symbol) for row in rows)]) + 2
    widest = max([8, *(len(cell) for row in rows for cell in row.cells)])
    together = max(1, (width - left - middle + 3) // (widest + 3))
    blocks = []
    for first in range(0, len(names), together):
        chosen = slice(first, first + together)
        heads = [_shortened(_ascii(name), widest) for name in names[chosen]]
        lines = [_line("quantity", "symbol", heads, left, middle, widest)]
        lines.append("-" * max(len(lines[0]), left + middle + len(heads) * (widest + 3) - 3))
        lines += [_line(row.quantity, row.symbol, row.cells[chosen], left, middle, widest) for row in rows]
        blocks.append("\n".join(line.rstrip() for line in lines))
    return "\n\n".join(blocks) + "\n"


def results_csv(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return every estimate and every law's parameters as CSV with the columns run, name, value, u, unit.

    Numbers keep all their digits: the file is for programs. A law's parameter is named ``LAW.PARAMETER``.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["run", "name", "value", "u", "unit"])
    for run, analysis in zip(names, analyses, strict=True):
        everything = dict(analysis.estimates)
        if isinstance(analysis.motion, Oscillation):
            for law, fit in analysis.motion.damping.fits.items():
                everything |= {f"{law}.{name}": x for name, x in fit.joint.estimates().items()}
        for name, x in everything.items():
            writer.writerow([cell(run), name, repr(float(x.value)), repr(float(x.u)), x.unit])
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
    """Return a unit as the page writes it."""
    return _PAGE_UNITS.get(unit, unit)


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
    return analysis.motion.derived.coefficients.get(name)


def _line(quantity: str, symbol: str, cells: Sequence[str], left: int, middle: int, widest: int) -> str:
    return quantity.ljust(left) + symbol.ljust(middle) + "   ".join(cell.ljust(widest) for cell in cells)


def _shortened(name: str, width: int) -> str:
    # Names of one experiment differ at their ends as often as at their beginnings: keep both.
    return name if len(name) <= width else f"{name[: width // 2 - 1]}..{name[len(name) - (width - width // 2 - 1) :]}"


def _ascii(text: str) -> str:
    return visible(text).encode("ascii", "replace").decode()


def _typeset(number: str) -> str:
    mantissa, mark, power = number.replace("+-", "±").partition("e")
    mantissa = mantissa.replace("-", "−")
    return f"{mantissa} × 10{raised(int(power))}" if mark else mantissa


def raised(power: int) -> str:
    """Return an exponent in raised digits."""
    return str(power).translate(_SUPERSCRIPT)
