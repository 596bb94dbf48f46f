"""LaTeX: Table 1 and the uncertainty budget with siunitx quantities, and a lab report to fill in."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pipeline.analyse import Analysis
from pipeline.quantities import INPUTS
from springmass.report.words import damping_sentence
from springmass.result.advice import by_harm, lab_report_line
from springmass.result.budget_tables import budgets_of
from springmass.result.table1 import table_rows
from springmass.runs.run import Run
from springmass.typeset import MANY_FREEDOM, tex_number, tex_quantity, tex_text, tex_words

if TYPE_CHECKING:
    from jinja2 import Environment


IN_TABLE = 2  # columns of runs that fit the text width of LaTeX's class article


def table_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return Table 1 as LaTeX tables of siunitx quantities for two runs each; they need booktabs and siunitx."""
    blocks = (slice(first, first + IN_TABLE) for first in range(0, len(names), IN_TABLE))
    return "\n".join(
        _filled("table.tex.j2", names=names[some], rows=table_rows(analyses[some]), number=number)
        for number, some in enumerate(blocks, 1)
    )


def budget_tex(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return one LaTeX table of the uncertainty budget per run; it needs booktabs, longtable and siunitx version 3."""
    runs = zip(names, analyses, strict=True)
    return "\n".join(_filled("budget.tex.j2", name=name, rows=budgets_of(analysis)) for name, analysis in runs)


def lab_report_tex(runs: Sequence[Run], captions: Sequence[Mapping[str, str]], compared: Sequence[str]) -> str:
    """Return a lab report to complete: it has Table 1, figures, captions, uncertainty, and questions for the rest.

    ``captions`` are those of each run's figures, and ``compared`` are sentences on all runs. Compile it in the folder
    of the report, which contains its figures: ``pdflatex lab-report.tex``.
    """
    sections = [
        {
            "name": run.name,
            "stated": [row for row in table_rows([run.analysis]) if row.name in _STATED],
            "damping": damping_sentence(run.analysis),
            "figures": figures,
            "budgets": [row for row in budgets_of(run.analysis) if row.name in ("period", "spring_constant")],
        }
        for run, figures in zip(runs, captions, strict=True)
    ]
    return _filled(
        "lab-report.tex.j2",
        runs=sections,
        compared=compared,
        table=table_tex([run.name for run in runs], [run.analysis for run in runs]),
        warnings=_warnings([finding for run in runs for finding in run.result["findings"]]),
    )


_STATED = ("period", "spring_constant", "amplitude", "damping_rate")


def _warnings(findings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what a lab report should say about warnings, each sentence once."""
    lines = filter(None, map(lab_report_line, by_harm(findings)))
    return list(dict.fromkeys(part for line in lines for part in re.split(r"(?<=[.!?]) (?=[A-Z])", line)))


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
        "quantity": tex_quantity,
        "words": tex_words,
        "text": tex_text,
        "input": lambda name: tex_text(INPUTS[name].label),
        "freedom": lambda dof: r"\infty" if dof > MANY_FREEDOM else f"{dof:.0f}",
        "about": lambda value, unit: tex_number(f"{value:.2g}", unit),
        "breakable": lambda name: re.sub(r"(\\_|[-+/.])", r"\1\\allowbreak{}", tex_text(name)),
        "sentence": lambda text: f"{text[:1].upper()}{text[1:]}",
    }
    return environment
