"""Write a report: the page, its figures and its tables, each file whole or not at all."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from springmass.report.budgets import budget_csv
from springmass.report.figures import KINDS, MAKERS, comparison_figure, draw, render
from springmass.report.html import render_html
from springmass.report.latex import budget_tex, table_tex
from springmass.report.motion_table import motion_csv, smoothed_or_why
from springmass.report.tables import results_csv
from springmass.runs.analysing import Analysed
from springmass.runs.comparing import Compared
from springmass.runs.json_results import plain
from storage.atomic import write_whole

__all__ = ["write_report"]


def write_report(
    directory: Path,
    runs: Sequence[Analysed],
    *,
    compared: Compared | None = None,
    summary: Mapping[str, Any] | None = None,
) -> Path:
    """Write the report of one run or of several side by side.

    Parameters
    ----------
    directory : Path
        Usually ``NAME.results``; made if it is not there, files of an earlier report are replaced.
    runs : sequence of Analysed
        One at least.
    compared : Compared, optional
        The runs' spring constants and common damping laws; drawn and tabulated.
    summary : mapping, optional
        What ``results.json`` holds in place of the runs' results. Its ``provenance``, else the first run's, goes into
        the page: version, parameters, time, whatever says how to make this report again.

    Returns
    -------
    Path
        The page, ``report.html``, written last: where it stands, the rest stands.

    Raises
    ------
    ValueError
        If there is no run.
    storage.errors.WriteFailed
        If a file cannot be written.

    Notes
    -----
    Besides the page: ``results.json`` (``summary``, else one object for one run and a list for several; what is no
    number is null), ``results.csv``, ``table.tex``, ``budget.csv``, ``budget.tex``, ``motion.csv`` of each run that
    oscillates, and ``figures/`` with every figure as SVG and PDF. Names of figures and motions begin with their run's
    where there are several.
    The same arguments give the same bytes.
    """
    if not runs:
        raise ValueError("a report needs one run at least, got none")
    directory = Path(directory)
    (directory / "figures").mkdir(parents=True, exist_ok=True)
    names, analyses = [run.name for run in runs], [run.analysis for run in runs]
    pictures = []
    for stem, run in zip(_stems(names), runs, strict=True):
        smoothed = smoothed_or_why(run.analysis)
        figures = draw(run.analysis, smoothed)
        drawn = {name: {kind: render(figure, kind) for kind in KINDS} for name, figure in figures.items()}
        _write_figures(directory / "figures", stem, drawn)
        motion = directory / f"{stem}motion.csv"
        _put(motion, None if isinstance(smoothed, str) else motion_csv(run.analysis, smoothed))
        pictures.append({name: files["svg"] for name, files in drawn.items()})
    results = [run.result for run in runs]
    content = plain(summary if summary is not None else results[0] if len(results) == 1 else results)
    write_whole(directory / "results.json", json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    write_whole(directory / "results.csv", results_csv(names, analyses))
    write_whole(directory / "table.tex", table_tex(names, analyses))
    write_whole(directory / "budget.csv", budget_csv(names, analyses))
    write_whole(directory / "budget.tex", budget_tex(names, analyses))
    overview = {}
    if compared is not None:
        overview = {kind: render(comparison_figure(compared.comparison), kind) for kind in KINDS}
        for kind, data in overview.items():
            write_whole(directory / "figures" / f"comparison.{kind}", data)
    provenance = (summary or results[0])["provenance"]
    page = render_html(runs, pictures, compared=compared, overview=overview.get("svg", b""), provenance=provenance)
    return write_whole(directory / "report.html", page)


def _write_figures(folder: Path, stem: str, drawn: Mapping[str, Mapping[Literal["svg", "pdf"], bytes]]) -> None:
    for name in MAKERS:
        for kind in KINDS:
            _put(folder / f"{stem}{name}.{kind}", drawn[name][kind] if name in drawn else None)


def _put(target: Path, content: bytes | str | None) -> None:
    """Write a file, or take away one that an earlier report left: it would pass for one of this."""
    if content is None:
        target.unlink(missing_ok=True)
    else:
        write_whole(target, content)


def _stems(names: Sequence[str]) -> list[str]:
    """Return how each run's figures begin: with nothing if it is the only one, else with a safe name."""
    if len(names) == 1:
        return [""]
    stems: list[str] = []
    for i, name in enumerate(names, 1):
        safe = re.sub(r"[^A-Za-z0-9.+-]+", "_", name).strip("._")[:60] or f"run{i}"
        taken = {stem.lower() for stem in stems}
        stems.append(f"{safe}_" if f"{safe}_".lower() not in taken else f"{safe}_{i}_")
    return stems
