"""LaTeX: Table 1 and the uncertainty budget with siunitx quantities, and a lab report to fill in."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pipeline.analyse import Analysis
from pipeline.quantities import INPUTS
from springmass.result.advice import by_harm, lab_report_line
from springmass.result.budget_tables import budgets_of
from springmass.result.table1 import table_rows
from springmass.runs.run import Run
from springmass.typeset import tex_quantity, tex_text, tex_words

if TYPE_CHECKING:
    from jinja2 import Environment


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
        "quantity": tex_quantity,
        "words": tex_words,
        "text": tex_text,
        "input": lambda name: tex_text(INPUTS[name].label),
        "freedom": lambda dof: r"\infty" if math.isinf(dof) else f"{dof:.0f}",
        "sentence": lambda text: f"{text[:1].upper()}{text[1:]}",
    }
    return environment
