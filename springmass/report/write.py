"""Write a report: the page, its tables and, if asked for, its figures; their folder gets new files, the page last."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args

from acquisition.regular_file import open_regular_text
from springmass.charts.chart import Chart
from springmass.charts.draw import Counting, PictureFormat, save
from springmass.charts.run import CHARTS, charts_of
from springmass.charts.several import comparison, masses, overlay, static
from springmass.comparing.comparison import SpringComparison
from springmass.errors import LOG
from springmass.report.html import render_html
from springmass.report.latex import budget_tex, lab_report_tex, table_tex
from springmass.report.motion_table import amplitude_csv, motion_csv
from springmass.report.recorded import notes_of
from springmass.report.words import verdict
from springmass.result.budget_tables import budget_csv
from springmass.result.output_names import safe_name
from springmass.result.run_json import plain
from springmass.result.table1 import results_csv
from springmass.runs.run import Run
from storage.atomic import remove_files, whole_folder, write_whole

REPORT_PAGE = "report.html"
LAB_REPORT = "lab-report.tex"
RUN_TABLE = "results.csv"
TABLES = ("results.json", RUN_TABLE, "table.tex", "budget.csv", "budget.tex")
OF_LAB_REPORT = ("position", "amplitude", "frequency")


def write_report(
    directory: Path,
    runs: Sequence[Run],
    *,
    compared: SpringComparison | None = None,
    summary: Mapping[str, Any] | None = None,
    figures: Sequence[PictureFormat] = (),
    template: Literal["latex"] | None = None,
    script: str = "",
    counting: Counting = iter,
) -> Path:
    """Write the report of one run, or of several side by side; return its page, which exists once it is complete.

    ``directory``, usually ``NAME.results``, is replaced as a whole if it contains only an earlier report. ``summary``
    is the content of ``results.json`` in place of the runs' results. ``figures`` are the kinds of files in
    ``figures/``; if SVG is among them, the page shows them to viewers that run no script. ``template`` asks for
    ``lab-report.tex``, whose figures are PDF. ``script`` is the address of a script that several reports share; without
    one the page contains it. If there are several runs, the names of figures and motions begin with the name of the
    run. ``counting`` shows how many figures are drawn.
    """
    directory, stems = Path(directory), _stems([run.name for run in runs])
    kinds: list[PictureFormat] = list(dict.fromkeys((*figures, *(("pdf",) if template is not None else ()))))
    names, analyses, several = [run.name for run in runs], [run.analysis for run in runs], charts_across(runs, compared)
    charts = {
        stem: charts_of(run.analysis, notes_of(run.recorded), run.classic, profiles=bool(figures))
        for stem, run in zip(stems, runs, strict=True)
    }
    with whole_folder(directory, _names([*stems, *_earlier_stems(directory)]), REPORT_PAGE) as folder:
        pictures: dict[str, bytes] = {}
        if kinds:
            (folder / "figures").mkdir()
            of_runs = {f"{stem}{name}": chart for stem, some in charts.items() for name, chart in some.items()}
            pictures = save({**several, **of_runs}, folder / "figures", kinds, counting)
        for stem, analysis in zip(stems, analyses, strict=True):
            if analysis.smoothed is not None:
                write_whole(folder / f"{stem}motion.csv", motion_csv(analysis, analysis.smoothed))
            if amplitudes := amplitude_csv(analysis):
                write_whole(folder / f"{stem}amplitude.csv", amplitudes)
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
        for name, table in zip(TABLES, tables, strict=True):
            write_whole(folder / name, table)
        page = render_html(
            runs,
            charts,
            compared=compared,
            several=several,
            pictures=pictures,
            provenance=(summary or results[0])["provenance"],
            script=script,
        )
        write_whole(folder / REPORT_PAGE, page)
        if template is not None:
            captions = [
                {f"{stem}{name}": of_run[name].caption for name in OF_LAB_REPORT if name in of_run}
                for stem, of_run in charts.items()
            ]
            sentences = [] if compared is None else verdict(compared)
            write_whole(folder / LAB_REPORT, lab_report_tex(runs, captions, sentences))
    LOG.debug(f"written: {directory}: {', '.join(sorted(each.name for each in directory.iterdir()))}")
    return directory / REPORT_PAGE


def charts_across(runs: Sequence[Run], compared: SpringComparison | None) -> dict[str, Chart]:
    """Return the charts of several runs together, by name."""
    charts = [overlay([run.name for run in runs], [run.analysis for run in runs]) if len(runs) > 1 else None]
    if compared is not None:
        charts += [
            comparison(compared.comparison),
            None if compared.line is None else masses(compared.line),
            None if compared.hooke is None else static(compared.hooke),
        ]
    return {chart.name: chart for chart in charts if chart is not None}


def remove_report(directory: Path) -> None:
    """Remove the files of a report; its folder stays if it contains anything else."""
    remove_files(directory, _names(_earlier_stems(directory)), REPORT_PAGE)


def _names(stems: Sequence[str]) -> set[str]:
    """Return the names of all files that a report of these runs may contain, or one of 0.2.0."""
    charts = [f"{stem}{name}" for stem in stems for name in (*CHARTS, "classic", "logarithmic")]
    figures = {
        f"figures/{name}.{kind}"
        for name in (*charts, "comparison", "overlay", "masses", "hooke")
        for kind in get_args(PictureFormat)
    }
    tables = (f"{stem}{name}.csv" for stem in stems for name in ("motion", "amplitude"))
    return {REPORT_PAGE, LAB_REPORT, *TABLES, *figures, *tables}


def _earlier_stems(directory: Path) -> list[str]:
    """Return the prefixes that files of an earlier report in the folder may have, by the runs that its table names."""
    try:
        with open_regular_text(directory / RUN_TABLE, "utf-8", newline="") as file:
            names = dict.fromkeys(row["run"] or "" for row in csv.DictReader(file))
    except (OSError, ValueError, KeyError, csv.Error):
        names = {}  # no earlier report, or a table of something else: nothing says which other files would be ours
    return ["", *_prefixes(list(names))]


def _stems(names: Sequence[str]) -> list[str]:
    """Return the prefix of each run's figures: empty for a single run, else a safe name."""
    return [""] if len(names) == 1 else _prefixes(names)


def _prefixes(names: Sequence[str]) -> list[str]:
    stems: list[str] = []
    for i, name in enumerate(names, 1):
        safe = safe_name(name) or f"run{i}"
        taken = {stem.lower() for stem in stems}
        stems.append(f"{safe}_" if f"{safe}_".lower() not in taken else f"{safe}_{i}_")
    return stems
