"""Write a report: the page, its figures and its tables, a folder that changes as a whole."""

from __future__ import annotations

import gc
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from springmass.errors import detail
from springmass.report.budgets import budget_csv
from springmass.report.figures import KINDS, NAMES, comparison_figure, draw, render
from springmass.report.html import render_html
from springmass.report.latex import budget_tex, table_tex
from springmass.report.motion_table import motion_csv, smoothed_or_why
from springmass.report.recorded import notes_of
from springmass.report.tables import results_csv
from springmass.runs.analysing import Analysed
from springmass.runs.comparing import Compared
from springmass.runs.json_results import plain
from storage.atomic import write_whole
from storage.folder import whole_folder

__all__ = ["write_report"]


def write_report(
    directory: Path,
    runs: Sequence[Analysed],
    *,
    compared: Compared | None = None,
    summary: Mapping[str, Any] | None = None,
    pdf: bool = False,
) -> Path:
    """Write the report of one run or of several side by side.

    Parameters
    ----------
    directory : Path
        Usually ``NAME.results``; replaced as a whole where it holds an earlier report and nothing else.
    runs : sequence of Analysed
        One at least.
    compared : Compared, optional
        The runs' spring constants and common damping laws; drawn and tabulated.
    summary : mapping, optional
        What ``results.json`` holds in place of the runs' results. Its ``provenance``, else the first run's, goes into
        the page: version, parameters, time, whatever says how to make this report again.
    pdf : bool
        Whether figures are written as PDF too: that takes as long as all the rest, the fonts in them above all.

    Returns
    -------
    Path
        The page, ``report.html``: where it stands, the rest stands.

    Raises
    ------
    ValueError
        If there is no run.
    storage.errors.WriteFailed
        If a file or the folder cannot be written; the earlier report stands then.

    Notes
    -----
    Besides the page: ``results.json`` (``summary``, else one object for one run and a list for several; what is no
    number is null), ``results.csv``, ``table.tex``, ``budget.csv``, ``budget.tex``, ``motion.csv`` of each run that
    oscillates, and ``figures/`` with every figure as SVG, and as PDF where asked for. Names of figures and motions
    begin with their run's where there are several.
    The same arguments give the same bytes.
    """
    if not runs:
        raise ValueError("a report needs one run at least, got none")
    directory, names = Path(directory), [run.name for run in runs]
    stems = _stems(names)
    with whole_folder(directory, _names(stems), PAGE) as folder, _collected_once_a_run():
        _write(folder, runs, stems, compared, summary, KINDS if pdf else KINDS[:1])
    detail(f"written: {directory}: {', '.join(sorted(each.name for each in directory.iterdir()))}")
    return directory / PAGE


@contextmanager
def _collected_once_a_run() -> Iterator[None]:
    """Look for dead objects in cycles once a run: figures are many living ones, and a tenth of the time went so."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


PAGE = "report.html"
_TABLES = ("results.json", "results.csv", "table.tex", "budget.csv", "budget.tex")


def _names(stems: Sequence[str]) -> set[str]:
    """Return the name of every file that a report of these runs may hold."""
    pictures = [f"{stem}{name}" for stem in stems for name in NAMES]
    figures = {f"figures/{name}.{kind}" for name in (*pictures, "comparison") for kind in KINDS}
    return {PAGE, *_TABLES, *figures, *(f"{stem}motion.csv" for stem in stems)}


def _write(
    folder: Path,
    runs: Sequence[Analysed],
    stems: Sequence[str],
    compared: Compared | None,
    summary: Mapping[str, Any] | None,
    kinds: Sequence[Literal["svg", "pdf"]],
) -> None:
    (folder / "figures").mkdir()
    names, analyses = [run.name for run in runs], [run.analysis for run in runs]
    pictures = []
    for stem, run in zip(stems, runs, strict=True):
        smoothed = smoothed_or_why(run.analysis)
        figures = draw(run.analysis, smoothed, notes=notes_of(run.recorded), classic=run.classic)
        drawn = {name: {kind: render(figure, kind) for kind in kinds} for name, figure in figures.items()}
        for name, files in drawn.items():
            for kind, data in files.items():
                write_whole(folder / "figures" / f"{stem}{name}.{kind}", data)
        if not isinstance(smoothed, str):
            write_whole(folder / f"{stem}motion.csv", motion_csv(run.analysis, smoothed))
        pictures.append({name: files["svg"] for name, files in drawn.items()})
        del figures
        gc.collect(0)  # the youngest alone: what was made for this run
    results = [run.result for run in runs]
    content = plain(summary if summary is not None else results[0] if len(results) == 1 else results)
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    # Half a character, which a file's name may hold, is written as JSON's own escape of it.
    tables: tuple[bytes | str, ...] = (
        text.encode("utf-8", "backslashreplace"),
        results_csv(names, analyses),
        table_tex(names, analyses),
        budget_csv(names, analyses),
        budget_tex(names, analyses),
    )
    for name, table in zip(_TABLES, tables, strict=True):
        write_whole(folder / name, table)
    overview = {}
    if compared is not None:
        overview = {kind: render(comparison_figure(compared.comparison), kind) for kind in kinds}
        for kind, data in overview.items():
            write_whole(folder / "figures" / f"comparison.{kind}", data)
    provenance = (summary or results[0])["provenance"]
    page = render_html(runs, pictures, compared=compared, overview=overview.get("svg", b""), provenance=provenance)
    write_whole(folder / PAGE, page)


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
