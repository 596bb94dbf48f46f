"""LaTeX: Table 1 and the uncertainty budget with siunitx quantities, and a lab report to fill in."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.numerics.estimate import Estimate, UpperLimit, format_limit, format_value
from pipeline.registry.quantities import INPUTS
from springmass.report.advice import by_harm, lab_report_line
from springmass.report.budgets import budgets_of
from springmass.report.tables import table_rows
from springmass.runs.analysing import Analysed

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
"""Fraction of a budget's line width for the input's name, which wraps there; its value fits into the rest on A4."""
_WRITTEN = re.compile(r"\(?(?P<value>-?[\d.]+) \+- (?P<u>[\d.]+)\)?(?:e(?P<power>[+-]\d+))?")
_TEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: "\\" + character for character in "&%$#_{}"},
}


def table_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return Table 1 as a LaTeX table of siunitx quantities; it needs booktabs and siunitx version 3."""
    body = [
        " & ".join(
            [f"{row.quantity[:1].upper()}{row.quantity[1:]} & ${row.tex_symbol}$", *map(_tex_quantity, row.estimates)]
        )
        + r" \\"
        for row in table_rows(analyses)
    ]
    caption = "Results of the oscillation experiment; in parentheses the standard uncertainty of the last digits."
    return _framed(caption, ["Quantity", "Symbol", *map(_tex_text, names)], body, [r"  \label{tab:springmass}"])


def budget_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return one LaTeX table of the uncertainty budget per run; it needs booktabs, longtable and siunitx version 3."""
    return "\n".join(_budget_table(name, analysis) for name, analysis in zip(names, analyses, strict=True))


def _budget_table(name: str, analysis: Analysis) -> str:
    """Return the table, one block per quantity; a result is above its inputs, because A4 is too narrow for both."""
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
    """Typeset an exponent such as e-05 as a power of ten."""
    return re.sub(r"e([+-])0*(\d+)", lambda found: rf" \times 10^{{{found[1].replace('+', '')}{found[2]}}}", text)


def lab_report_tex(
    run: Analysed, figures: Mapping[str, str], captions: Mapping[str, str], sentences: Sequence[str]
) -> str:
    """Return a lab report to complete: it contains Table 1, figures, captions, uncertainty, and questions for the rest.

    Compile it in the folder of the report, which contains its figures: ``pdflatex lab-report.tex``.
    """
    warnings = [line for finding in by_harm(run.result.get("findings", ())) if (line := lab_report_line(finding))]
    budget = {row.name: row for row in budgets_of(run.analysis)}
    stated = [
        f"The {row.quantity} is {_tex_quantity(row.budget.estimate)}; its expanded uncertainty is "
        rf"$U = {_tex_power(f'{row.budget.expanded:.2g}')}$ in the same unit "
        f"($k = {row.budget.coverage_factor:.2f}$, coverage "
        rf"\qty{{95.45}}{{\percent}}). Its largest contribution is the {_tex_text(INPUTS[greatest.name].label)} "
        rf"(type {greatest.kind}, \qty{{{100 * greatest.share:.0f}}}{{\percent}} of the variance)."
        for name in ("period", "spring_constant")
        if (row := budget.get(name)) is not None
        for greatest in row.contributions[:1]
    ]
    pictures = [
        "\n".join(
            [
                r"\begin{figure}[htbp]",
                r"  \centering",
                rf"  \includegraphics[width=\linewidth,height=0.8\textheight,keepaspectratio]{{{path}}}",
                rf"  \caption{{{_tex_words(captions[name])}}}",
                rf"  \label{{fig:{name}}}",
                r"\end{figure}",
                "",
            ]
        )
        for name, path in figures.items()
    ]
    parts = {
        "SENTENCES": " ".join(_tex_words(sentence) for sentence in sentences),
        "TABLE": table_tex([run.name], [run.analysis]),
        "FIGURES": "\n".join(pictures),
        "UNCERTAINTY": "\n".join([*stated, *(_tex_words(warning) for warning in warnings)]),
    }
    text = Path(__file__).with_name("templates").joinpath("lab-report.tex").read_text("utf-8")
    return re.sub("@([A-Z]+)@", lambda found: parts[found[1]], text)


_TEX_MATH = {
    **dict(zip("±−×·≤≥≈∞", (r"\pm", "-", r"\times", r"\cdot", r"\leq", r"\geq", r"\approx", r"\infty"), strict=True)),
    "χ²": r"\chi^2",
    "φ": r"\varphi",
    "λ": r"\lambda",  # LAMDA in Unicode
    **{letter: "\\" + unicodedata.name(letter).split()[-1].lower() for letter in "αβγδζηθκμνπρστψω"},
    **{letter: "\\" + unicodedata.name(letter).split()[-1].capitalize() for letter in "ΔΩ"},
    **{lowered: f"_{digit}" for digit, lowered in enumerate("₀₁₂₃₄₅₆₇₈₉")},
}
_SUPERSCRIPTS = {raised: plain for plain, raised in zip("-0123456789n", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ", strict=True)}


def _tex_words(text: str) -> str:
    """Convert a sentence of the page to LaTeX, with symbols and powers as mathematics."""
    text = _tex_text(text).replace("\u00a0", "~").replace("\u202f", r"\,").replace("“", "``").replace("”", "''")
    text = re.sub(
        f"[{''.join(_SUPERSCRIPTS)}]+", lambda run: f"$^{{{''.join(_SUPERSCRIPTS[each] for each in run[0])}}}$", text
    )
    for symbol, tex in _TEX_MATH.items():
        text = text.replace(symbol, f"${tex}$")
    return text.replace("°C", r"\textcelsius{}").replace("µ", r"\textmu{}").replace("–", "--")


def _framed(caption: str, heads: Sequence[str], body: Sequence[str], label: Sequence[str] = ()) -> str:
    """Frame the lines of a table with its heads, all columns left-aligned."""
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
    """Write value(u)unit for siunitx, with the digits that ``format_value`` chooses."""
    if estimate is None:
        return "--"
    if isinstance(estimate, UpperLimit):
        return f"$<$ {_tex_number(format_limit(estimate.limit), estimate.unit)} (\\qty{{95}}{{\\percent}})"
    written = format_value(estimate.value, estimate.u)
    found = _WRITTEN.fullmatch(written)
    if found is None:
        number = written if re.fullmatch(r"-?[\d.]+(e[+-]\d+)?", written) else ""
    else:
        # 0.7529 +- 0.0014 is 0.7529(14), 13.9 +- 1.2 is 13.9(12), 1100 +- 150 is 1100(150).
        number = f"{found['value']}({int(found['u'].replace('.', ''))})"
        number += f"e{int(found['power'])}" if found["power"] else ""
    return _tex_number(number, estimate.unit) if number else "--"


def _tex_number(number: str, unit: str) -> str:
    """Write a number, possibly with its uncertainty, and its unit for siunitx."""
    if not unit:
        return rf"\num{{{number}}}"
    macro = _SIUNITX.get(unit, rf"\text{{{_tex_text(unit)}}}")
    return rf"\qty{{{number}}}{{{macro}}}"


def _tex_text(text: str) -> str:
    return "".join(_TEX_SPECIAL.get(character, character) for character in visible(text))
