"""Tables of a report: Table 1 for the terminal, for LaTeX and for the page, and every number as CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.analyse import Analysis
from pipeline.cycles import NoOscillation
from pipeline.damping import Damping
from pipeline.estimate import Estimate, format_value

__all__ = [
    "TableRow",
    "law_status",
    "page_unit",
    "pretty",
    "pretty_number",
    "results_csv",
    "table_rows",
    "table_tex",
    "text_table",
]

# name, quantity in words, symbol in ASCII, on the page, in LaTeX
_QUANTITIES = (
    ("period", "period", "T", "T", "T"),
    ("frequency", "frequency", "f", "f", "f"),
    ("angular_frequency", "angular frequency", "omega", "ω", r"\omega"),
    ("spring_constant", "spring constant", "k", "k", "k"),
    ("amplitude", "amplitude at the start", "A0", "A₀", "A_0"),
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
_OF_LAW = ("gamma", "beta", "mu", "c", "n")

_SIUNITX = {
    "s": r"\second",
    "Hz": r"\hertz",
    "rad": r"\radian",
    "rad/s": r"\radian\per\second",
    "N/m": r"\newton\per\metre",
    "m": r"\metre",
    "kg": r"\kilogram",
    "m/s": r"\metre\per\second",
    "1/s": r"\per\second",
    "1/(m s)": r"\per\metre\per\second",
    "m^(1-n)/s": r"\metre^{1-n}\per\second",
}
_PAGE_UNITS = {"1/s": "s⁻¹", "1/(m s)": "m⁻¹ s⁻¹"}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_WRITTEN = re.compile(r"\(?(?P<value>-?[\d.]+) \+- (?P<u>[\d.]+)\)?(?:e(?P<power>[+-]\d+))?")
_TEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: "\\" + character for character in "&%$#_{}"},
}
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
        if not isinstance(analysis.motion, NoOscillation):
            for law, fit in analysis.motion.damping.fits.items():
                everything |= {f"{law}.{name}": x for name, x in fit.joint.estimates().items()}
        for name, x in everything.items():
            writer.writerow([run, name, repr(float(x.value)), repr(float(x.u)), x.unit])
    return out.getvalue()


def table_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return Table 1 as a LaTeX table of siunitx quantities; it needs booktabs and siunitx, version 3.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    body = [
        " & ".join(
            [f"{row.quantity[:1].upper()}{row.quantity[1:]} & ${row.tex_symbol}$", *map(_tex_quantity, row.estimates)]
        )
        + r" \\"
        for row in table_rows(analyses)
    ]
    heads = " & ".join(["Quantity & Symbol", *map(_tex_text, names)]) + r" \\"
    return "\n".join(
        [
            r"% needs \usepackage{booktabs} and \usepackage{siunitx}, version 3",
            r"\begin{table}",
            r"  \centering",
            r"  \caption{Results of the oscillation experiment; in parentheses the standard uncertainty"
            " ($k = 1$) of the last digits.}",
            r"  \label{tab:springmass}",
            rf"  \begin{{tabular}}{{ll{'l' * len(names)}}}",
            r"    \toprule",
            f"    {heads}",
            r"    \midrule",
            *(f"    {line}" for line in body),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def pretty(estimate: Estimate | None) -> str:
    """Return an estimate for the page: the digits of :func:`pipeline.estimate.format_value`, typeset.

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
    if name not in _OF_LAW:
        return analysis.estimates.get(name)
    if isinstance(analysis.motion, NoOscillation):
        return None
    joint = analysis.motion.damping.best.joint
    return joint[name] if name in joint.names else None


def _line(quantity: str, symbol: str, cells: Sequence[str], left: int, middle: int, widest: int) -> str:
    return quantity.ljust(left) + symbol.ljust(middle) + "   ".join(cell.ljust(widest) for cell in cells)


def _shortened(name: str, width: int) -> str:
    # Names of one experiment differ at their ends as often as at their beginnings: keep both.
    return name if len(name) <= width else f"{name[: width // 2 - 1]}..{name[len(name) - (width - width // 2 - 1) :]}"


def _ascii(text: str) -> str:
    printable = "".join(character if character.isprintable() else " " for character in text)
    return printable.encode("ascii", "replace").decode()


def _typeset(number: str) -> str:
    mantissa, mark, power = number.replace("+-", "±").partition("e")
    mantissa = mantissa.replace("-", "−")
    return f"{mantissa} × 10{str(int(power)).translate(_SUPERSCRIPT)}" if mark else mantissa


def _tex_quantity(estimate: Estimate | None) -> str:
    """Write value(u)unit for siunitx, from the one place that decides on digits."""
    if estimate is None:
        return "--"
    written = format_value(estimate.value, estimate.u)
    found = _WRITTEN.fullmatch(written)
    if found is None:
        number = written if re.fullmatch(r"-?[\d.]+(e[+-]\d+)?", written) else ""
    else:
        # 0.7529 +- 0.0014 is 0.7529(14), 13.9 +- 1.2 is 13.9(12), 1100 +- 150 is 1100(150).
        number = f"{found['value']}({int(found['u'].replace('.', ''))})"
        number += f"e{int(found['power'])}" if found["power"] else ""
    if not number:
        return "--"
    if not estimate.unit:
        return rf"\num{{{number}}}"
    unit = _SIUNITX.get(estimate.unit, rf"\text{{{_tex_text(estimate.unit)}}}")
    return rf"\qty{{{number}}}{{{unit}}}"


def _tex_text(text: str) -> str:
    printable = "".join(character if character.isprintable() else " " for character in text)
    return "".join(_TEX_SPECIAL.get(character, character) for character in printable)
