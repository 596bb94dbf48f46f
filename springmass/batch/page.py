"""Write the page of a course: a sortable table of all runs, with those that most need inspection first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from acquisition.errors import visible
from pipeline.numerics.estimate import Estimate
from pipeline.results.course import LITTLE
from springmass.batch.benches import BENCHES, CourseComparison
from springmass.batch.reports import REPORTS, Need, need_of, report_name
from springmass.batch.rows import COURSE, FAILED
from springmass.batch.store import GROUPS, PAGE, Store
from springmass.charts.chart import Chart
from springmass.charts.several import course
from springmass.report.advice import sentence
from springmass.terminal.printing import visible_lines
from storage.atomic import writing

SHOWN = (
    ("period", "T", "s"),
    ("spring_constant", "k", "N/m"),
    ("amplitude", "A₀", ""),
    ("damping_rate", "λ", "1/s"),
    ("drag_coefficient", "C_d", ""),
)
"""Estimates with a column: name, symbol and unit; an empty unit means none, or that of the run."""

LOOKS = ("failed", "error", "warning", "fine")


def write_page(store: Store, lines: Sequence[Mapping[str, Any]], tags: Sequence[str], reports: set[str]) -> None:
    """Write ``index.html``."""
    from springmass.report.html import Figures, drawn_by_script, template
    from springmass.report.script import SHARED

    there = [i for i in range(len(SHOWN)) if any(line["cells"][i][1] for line in lines)]  # only with numbers
    shown = [
        {**line, "cells": [line["cells"][i] for i in there], "link": _link(line["name"], reports)} for line in lines
    ]
    shown.sort(key=lambda line: (*(-x for x in line["need"]), line["name"]))
    figures = Figures()
    chart = _chart(lines)
    figure = None if chart is None else figures.add(chart)
    counts = {kind: sum(line["look"] == kind for line in shown) for kind in LOOKS}
    page = template("course.html.j2").render(
        title=store.folder.resolve().name,
        lines=shown,
        tags=tags,
        quantities=[SHOWN[i] for i in there],
        counts=counts,
        figure_of_runs=figure,
        **drawn_by_script(figures.charts, SHARED),
    )
    with store.output(PAGE) as temporary, writing(store.folder / PAGE):
        temporary.write_bytes(page.encode("utf-8", "backslashreplace"))


def _chart(lines: Sequence[Mapping[str, Any]]) -> Chart | None:
    """Return the chart of all spring constants, or else of all periods, if at least two runs have one."""
    for name, label in (("spring_constant", "spring constant / (N/m)"), ("period", "period / s")):
        rows = [(line["name"], *line["estimates"].get(name, (None, None))) for line in lines]
        known = [(visible(run), value, u or 0.0) for run, value, u in rows if value is not None]
        if len(known) > 1:
            return course(label, known)
    return None


def _link(name: str, reports: set[str]) -> str:
    report = report_name(name)
    return f"{REPORTS}/{quote(report)}/report.html" if report in reports else ""


def line_of(row: Mapping[str, Any], tags: Sequence[str]) -> dict[str, Any]:
    """Return the line that the page shows for a run, from its row and the course's own columns."""
    failed = row["status"] in FAILED
    look = "failed" if failed else "error" if row["errors"] else "warning" if row["tell"] else "fine"
    return {
        "name": row["run"],
        "look": look,
        "need": need_of(row),
        "tell": [row["error"]] if failed else row["tell"],
        "notes": [message for _, message in row["messages"]],
        "codes": "" if failed else ", ".join(row["findings"]),
        "tags": [row["job"]["tags"].get(tag, "") for tag in tags],
        "cells": [_cell(row, quantity, unit) for quantity, _, unit in SHOWN],
        "law": row.get("law") or "",
        "estimates": row["estimates"],
        "thumbnail": row["thumbnail"],
    }


def mark(lines: Sequence[dict[str, Any]], comparison: CourseComparison) -> None:
    """Put what the comparison says about a run first among the sentences for its group, and let it count."""
    by_name = {line["name"]: line for line in lines}
    said = [(one.name, one.message, "error") for one in comparison.suspects]
    if comparison.bench != COURSE:  # without a column of benches, nobody says that runs belong together
        apart = [one for one in comparison.disagreements if one.spread > LITTLE]
        said += [(name, one.message, "warning") for one in apart for name in one.names]
    for name, message, look in said:
        line = by_name[name]
        if not any(message in text for text in line["tell"]):
            line["tell"] = [sentence(message), *line["tell"]]
        if LOOKS.index(look) < LOOKS.index(line["look"]):
            line["look"] = look
        need: Need = line["need"]
        counted = {"errors": need.errors + 1} if look == "error" else {"harmful": need.harmful + 1}
        line["need"] = need._replace(**counted)


def write_groups(store: Store, lines: Sequence[Mapping[str, Any]], tags: Sequence[str]) -> None:
    """Write ``groups.txt``: a paragraph for each group, with what to tell it."""
    column = next((tags.index(name) for name in BENCHES if name in tags), None)
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        groups.setdefault("" if column is None else line["tags"][column], []).append(line)
    paragraphs = []
    for name, group in sorted(groups.items()):
        runs_of: dict[str, list[str]] = {}
        for line in group:
            for text in line["tell"]:
                runs_of.setdefault(text, []).append(line["name"])
        runs = f"{len(group)} run{'s' if len(group) > 1 else ''}"
        title = "All runs" if column is None else f"{tags[column]} {name}" if name else f"without {tags[column]}"
        texts = [f"  {', '.join(names)}: {text}" for text, names in runs_of.items()] or ["  nothing to mend"]
        paragraphs.append("\n".join([f"{title}: {runs}", *texts]))
    with store.output(GROUPS) as temporary, writing(store.folder / GROUPS):
        temporary.write_bytes(visible_lines("\n\n".join(paragraphs)).encode("utf-8", "backslashreplace") + b"\n")


def _cell(row: Mapping[str, Any], quantity: str, unit: str) -> tuple[str, str, str]:
    """Return an estimate's label, its text, and its value as the sort key."""
    value, u = row["estimates"].get(quantity, (None, None))
    label = next(symbol for name, symbol, _ in SHOWN if name == quantity)
    if value is None or u is None:
        return label, "", ""
    unit = unit or (row["unit"] if quantity == "amplitude" else "")
    return label, repr(Estimate(value, u, unit)), repr(value)
