"""Tables for LaTeX: Table 1 and the uncertainty budget, with siunitx quantities."""

from __future__ import annotations

import re
from collections.abc import Sequence

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.numerics.estimate import Estimate, format_value
from springmass.report.budgets import INPUTS, budgets_of
from springmass.report.tables import table_rows

__all__ = ["budget_tex", "table_tex"]

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
    "V": r"\volt",
    "N": r"\newton",
    "m/s^2": r"\metre\per\second\squared",
    "degC": r"\degreeCelsius",
    "Pa": r"\pascal",
}
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
    """Return the uncertainty budgets as one LaTeX table a run; they need booktabs and siunitx, version 3.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    return "\n".join(_budget_table(name, analysis) for name, analysis in zip(names, analyses, strict=True))


def _budget_table(name: str, analysis: Analysis) -> str:
    lines = []
    for row in budgets_of(analysis):
        heads = [row.quantity[:1].upper() + row.quantity[1:], _tex_quantity(row.budget.estimate)]
        for c in row.contributions:
            given = "--" if c.input is None else _tex_quantity(c.input)
            cells = [*heads, _tex_text(INPUTS[c.name]), c.kind, given, rf"\qty{{{100 * c.share:.1f}}}{{\percent}}"]
            lines.append(" & ".join(cells) + r" \\")
            heads = ["", ""]
        lines.append(r"\addlinespace")
    caption = (
        f"Uncertainty budget of {_tex_text(name)}: share of each input in the variance, "
        "from the record's own scatter (A) or from elsewhere (B)."
    )
    return _framed(caption, ["Quantity", "Result", "Input", "Type", "Value", "Share"], lines[:-1])


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
