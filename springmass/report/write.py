"""Write a report: the page, its figures and its tables, in a folder that is replaced as a whole."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from springmass.errors import detail
from springmass.report.budgets import budget_csv
from springmass.report.figures import KINDS, NAMES, comparison_figure, draw, overlay_figure, render
from springmass.report.html import render_html
from springmass.report.latex import budget_tex, lab_report_tex, table_tex
from springmass.report.motion_table import motion_csv, smoothed_or_why
from springmass.report.recorded import notes_of
from springmass.report.tables import results_csv
from springmass.report.words import caption, verdict
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
    template: Literal["latex"] | None = None,
) -> Path:
    """Write the report of one run or of several side by side.

    Parameters
    ----------
    directory : Path
        Usually ``NAME.results``; replaced as a whole if it contains only an earlier report.
    runs : sequence of Analysed
        At least one run.
    compared : Compared, optional
        The runs' spring constants and common damping laws; drawn and tabulated.
    summary : mapping, optional
        Content of ``results.json`` instead of the runs' results. The page shows its ``provenance``, or else that of the
        first run: version, parameters, time and everything needed to reproduce the report.
    pdf : bool
        Whether to write figures as PDF too, which doubles the time.
    template : {"latex"}, optional
        Whether to write ``lab-report.tex`` too, a document to complete; all figures are then also written as PDF.

    Returns
    -------
    Path
        Path of the page, ``report.html``; if it exists, the report is complete.

    Raises
    ------
    ValueError
        If there is no run.
    storage.errors.WriteFailed
        If a file or the folder cannot be written; the earlier report is then kept.

    Notes
    -----
    The other files are ``results.json`` (``summary``, or else one object for one run and a list for several; NaN and
    infinity are null), ``results.csv``, ``table.tex``, ``budget.csv``, ``budget.tex``, ``motion.csv`` of each run that
    oscillates, and ``figures/`` with every figure as SVG and, if requested, as PDF. If there are several runs, the
    names of figures and motions begin with the name of the run.
    """
    if not runs:
        raise ValueError("a report needs one run at least, got none")
    directory, names = Path(directory), [run.name for run in runs]
    stems = _stems(names)
    with whole_folder(directory, _names(stems), PAGE) as folder:
        kinds = KINDS if pdf or template is not None else KINDS[:1]
        drawn = _write(folder, runs, stems, compared, summary, kinds)
        if template is not None:
            _write_lab_report(folder, runs[0], drawn)
    detail(f"written: {directory}: {', '.join(sorted(each.name for each in directory.iterdir()))}")
    return directory / PAGE


PAGE = "report.html"
LAB_REPORT = "lab-report.tex"
_TABLES = ("results.json", "results.csv", "table.tex", "budget.csv", "budget.tex")


def _names(stems: Sequence[str]) -> set[str]:
    """Return the names of all files that a report of these runs may contain."""
    pictures = [f"{stem}{name}" for stem in stems for name in NAMES]
    figures = {f"figures/{name}.{kind}" for name in (*pictures, "comparison", "overlay") for kind in KINDS}
    return {PAGE, LAB_REPORT, *_TABLES, *figures, *(f"{stem}motion.csv" for stem in stems)}


def _write(
    folder: Path,
    runs: Sequence[Analysed],
    stems: Sequence[str],
    compared: Compared | None,
    summary: Mapping[str, Any] | None,
    kinds: Sequence[Literal["svg", "pdf"]],
) -> Sequence[str]:
    """Write everything; return the names of the first run's figures."""
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
    results = [run.result for run in runs]
    content = plain(summary if summary is not None else results[0] if len(results) == 1 else results)
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    # Lone surrogates, which a file's name may contain, are written as JSON escapes.
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
    overlay = overlay_figure(names, analyses) if len(runs) > 1 else None
    over = {} if overlay is None else {kind: render(overlay, kind) for kind in kinds}
    for kind, data in over.items():
        write_whole(folder / "figures" / f"overlay.{kind}", data)
    page = render_html(
        runs,
        pictures,
        compared=compared,
        overview=overview.get("svg", b""),
        overlay=over.get("svg", b""),
        stems=stems,
        provenance=(summary or results[0])["provenance"],
    )
    write_whole(folder / PAGE, page)
    return list(pictures[0])


def _write_lab_report(folder: Path, run: Analysed, drawn: Sequence[str]) -> None:
    """Write the document to complete, with the figures for a lab report."""
    shown = [name for name in ("position", "amplitude", "frequency") if name in drawn]
    captions = {name: caption(name, run.analysis) for name in shown}
    figures = {name: f"figures/{name}" for name in shown}
    write_whole(folder / LAB_REPORT, lab_report_tex(run, figures, captions, verdict(run.analysis)))


def _stems(names: Sequence[str]) -> list[str]:
    """Return the prefix of each run's figures: empty for a single run, else a safe name."""
    if len(names) == 1:
        return [""]
    stems: list[str] = []
    for i, name in enumerate(names, 1):
        safe = re.sub(r"[^A-Za-z0-9.+-]+", "_", name).strip("._")[:60] or f"run{i}"
        taken = {stem.lower() for stem in stems}
        stems.append(f"{safe}_" if f"{safe}_".lower() not in taken else f"{safe}_{i}_")
    return stems
