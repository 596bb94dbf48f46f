"""LaTeX: Table 1 and the uncertainty budget with siunitx quantities, and a lab report to fill in."""

from __future__ import annotations

import functools
import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.numerics.estimate import Estimate, UpperLimit, format_limit, in_brackets
from pipeline.quantities import INPUTS
from springmass.result.advice import by_harm, lab_report_line
from springmass.result.budget_tables import budgets_of
from springmass.result.table1 import table_rows
from springmass.runs.run import Run

if TYPE_CHECKING:
    from jinja2 import Environment

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
_TEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: "\\" + character for character in "&%$#_{}"},
}


def table_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return Table 1 as a LaTeX table of siunitx quantities; it needs booktabs and siunitx version 3."""
    return _filled("table.tex.j2", names=names, rows=table_rows(analyses))


def budget_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return one LaTeX table of the uncertainty budget per run; it needs booktabs, longtable and siunitx version 3."""
    runs = zip(names, analyses, strict=True)
    return "\n".join(_filled("budget.tex.j2", name=name, rows=budgets_of(analysis)) for name, analysis in runs)


def lab_report_tex(run: Run, captions: Mapping[str, str], sentences: Sequence[str]) -> str:
    """Return a lab report to complete: it contains Table 1, figures, captions, uncertainty, and questions for the rest.

    Compile it in the folder of the report, which contains its figures: ``pdflatex lab-report.tex``.
    """
    return _filled(
        "lab-report.tex.j2",
        sentences=sentences,
        table=table_tex([run.name], [run.analysis]),
        captions=captions,
        budgets=[row for row in budgets_of(run.analysis) if row.name in ("period", "spring_constant")],
        warnings=list(filter(None, map(lab_report_line, by_harm(run.result["findings"])))),
    )


def _filled(template: str, **values: Any) -> str:
    return _templates().get_template(template).render(**values)


@functools.cache
def _templates() -> Environment:
    """Return the templates, whose delimiters do not look like LaTeX."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("springmass.report"),
        undefined=StrictUndefined,
        variable_start_string="<<",
        variable_end_string=">>",
        block_start_string="<%",
        block_end_string="%>",
        comment_start_string="<#",
        comment_end_string="#>",
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "quantity": _tex_quantity,
        "words": _tex_words,
        "text": _tex_text,
        "input": lambda name: _tex_text(INPUTS[name].label),
        "freedom": lambda dof: r"\infty" if math.isinf(dof) else f"{dof:.0f}",
        "sentence": lambda text: f"{text[:1].upper()}{text[1:]}",
    }
    return environment


_TEX_MATH = {
    **dict(zip("±−×·≤≥≈∞", (r"\pm", "-", r"\times", r"\cdot", r"\leq", r"\geq", r"\approx", r"\infty"), strict=True)),
    "χ²": r"\chi^2",
    "φ": r"\varphi",
    "λ": r"\lambda",  # Unicode spells its name without the b
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


def _tex_quantity(estimate: Estimate | None) -> str:
    """Write value(u)unit for siunitx, with two digits of u."""
    if estimate is None:
        return "--"
    if isinstance(estimate, UpperLimit):
        return f"$<$ {_tex_number(format_limit(estimate.limit), estimate.unit)} (\\qty{{95}}{{\\percent}})"
    match = re.fullmatch(r"(-?[\d.]+)(\([\d.]+\))?(?:e([+-]\d+))?", in_brackets(estimate.value, estimate.u))
    if match is None:
        return "--"
    # siunitx wants the u in the last digit: 13.9(12) for 13.9(1.2).
    power = f"e{int(match[3])}" if match[3] else ""
    return _tex_number(f"{match[1]}{(match[2] or '').replace('.', '')}{power}", estimate.unit)


def _tex_number(number: str, unit: str) -> str:
    """Write a number, possibly with its uncertainty, and its unit for siunitx."""
    if not unit:
        return rf"\num{{{number}}}"
    macro = _SIUNITX.get(unit, rf"\text{{{_tex_text(unit)}}}")
    return rf"\qty{{{number}}}{{{macro}}}"


def _tex_text(text: str) -> str:
    return "".join(_TEX_SPECIAL.get(character, character) for character in visible(text))
