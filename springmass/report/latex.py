"""Tables for LaTeX: Table 1 and the uncertainty budget, with siunitx quantities."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.numerics.estimate import Estimate, format_value
from pipeline.registry.quantities import INPUTS
from springmass.report.budgets import budgets_of
from springmass.report.tables import table_rows

__all__ = ["budget_tex", "table_tex"]

_SIUNITX = {
    "s": r"\second",
    "Hz": r"\hertz",
    "rad": r"\radian",
    "rad/s": r"\radian\per\second",
    "N/m": r"\newton\per\metre",
    "m": r"\metre",
    "1": "",
    "kg": r"\kilogram",
    "m/s": r"\metre\per\second",
    "1/s": r"\per\second",
    "1/(m s)": r"\per\metre\per\second",
    "m^(1-n)/s": r"\metre^{1-n}\per\second",
    "V": r"\volt",
    "N": r"\newton",
    "m/s^2": r"\metre\per\second\squared",
    "rad/s^2": r"\radian\per\second\squared",
    "1/m": r"\per\metre",
    "1/rad": r"\per\radian",
    "degC": r"\degreeCelsius",
    "Pa": r"\pascal",
}
INPUT_WIDTH = 0.42
"""Of a budget's lines for the input's name, which breaks there: what is left holds its value on A4."""
_WRITTEN = re.compile(r"\(?(?P<value>-?[\d.]+) \+- (?P<u>[\d.]+)\)?(?:e(?P<power>[+-]\d+))?")
_TEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: "\\" + character for character in "&%$#_{}"},
}


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
    caption = (
        "Results of the oscillation experiment; in parentheses the standard uncertainty ($k = 1$) of the last digits."
    )
    return _framed(caption, ["Quantity", "Symbol", *map(_tex_text, names)], body, [r"  \label{tab:springmass}"])


def budget_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return the uncertainty budgets as one LaTeX table a run; they need booktabs, longtable and siunitx, version 3.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    return "\n".join(_budget_table(name, analysis) for name, analysis in zip(names, analyses, strict=True))


def _budget_table(name: str, analysis: Analysis) -> str:
    """A block a quantity, its result above its inputs: beside them it would not fit a page of A4."""
    lines = []
    for row in budgets_of(analysis):
        result = f"{row.quantity[:1].upper()}{row.quantity[1:]} {_tex_quantity(row.budget.estimate)}"
        freedom = r"\infty" if math.isinf(row.budget.dof) else f"{row.budget.dof:.0f}"
        expanded = rf"$U = {row.budget.expanded:.2g}$, $k = {row.budget.coverage_factor:.2f}$, $\nu = {freedom}$"
        lines.append(rf"\multicolumn{{4}}{{l}}{{{result}; {_tex_power(expanded)}}} \\")
        for c in row.contributions:
            given = "--" if c.input is None else _tex_quantity(c.input)
            cells = [
                rf"\quad {_tex_text(INPUTS[c.name].label)}",
                c.kind,
                given,
                rf"\qty{{{100 * c.share:.1f}}}{{\percent}}",
            ]
            lines.append(" & ".join(cells) + r" \\")
        lines.append(r"\addlinespace")
    caption = (
        f"Uncertainty budget of {_tex_text(name)}: share of each input in the variance, "
        "from the record's own scatter (A) or from elsewhere (B), and the expanded uncertainty $U = ku$ that covers "
        r"\qty{95.45}{\percent}, in the result's unit."
    )
    return "\n".join(
        [
            r"% needs \usepackage{booktabs}, \usepackage{longtable} and \usepackage{siunitx}, version 3",
            r"{\footnotesize",
            rf"\begin{{longtable}}{{p{{{INPUT_WIDTH}\linewidth}}llr}}",
            rf"  \caption{{{caption}}} \\",
            r"  \toprule",
            r"  Input & Type & Value & Share \\",
            r"  \midrule",
            r"  \endhead",
            r"  \bottomrule",
            r"  \endfoot",
            *(f"  {line}" for line in lines[:-1]),
            r"\end{longtable}",
            "}",
            "",
        ]
    )


def _tex_power(text: str) -> str:
    """Set a power of ten as one."""
    return re.sub(r"e([+-])0*(\d+)", lambda found: rf" \times 10^{{{found[1].replace('+', '')}{found[2]}}}", text)


def _framed(caption: str, heads: Sequence[str], body: Sequence[str], label: Sequence[str] = ()) -> str:
    """Set the lines of a table under its heads, all columns to the left."""
    return "\n".join(
        [
            r"% needs \usepackage{booktabs} and \usepackage{siunitx}, version 3",
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{{caption}}}",
            *label,
            rf"  \begin{{tabular}}{{{'l' * len(heads)}}}",
            r"    \toprule",
            rf"    {' & '.join(heads)} \\",
            r"    \midrule",
            *(f"    {line}" for line in body),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        ]
    )


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
    return "".join(_TEX_SPECIAL.get(character, character) for character in visible(text))
