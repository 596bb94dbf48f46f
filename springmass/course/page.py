"""Write the page of a course, with the runs that most need inspection first, and what to tell each group."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from acquisition.errors import visible
from pipeline.numerics.estimate import Estimate
from pipeline.several.course import LITTLE
from springmass.charts.chart import Chart
from springmass.charts.several import CourseValue, course, drag_map
from springmass.course.benches import BENCHES, CourseComparison, disc_of
from springmass.course.results_csv import COURSE, FAILED
from springmass.result.advice import sentence
from springmass.terminal.printing import visible_lines
from springmass.typeset import count
from storage.atomic import write_whole

COURSE_PAGE, GROUPS_FILE = "index.html", "groups.txt"
COLUMN_HEADINGS = {
    "period": "T / s",
    "spring_constant": "k / (N/m)",
    "amplitude": "A₀",
    "damping_rate": "λ / (1/s)",
    "disc_damping_rate": "λ of the disc, predicted",
    "drag_coefficient": "C_d",
}
"""Estimates with a column, and its heading; amplitudes have the unit of their run."""
LONGEST_PART = 16  # characters of a name that stay together: the width of its column
LINE_LOOKS = ("failed", "error", "warning", "fine")
_STATUS = {"ok": 0, "no_oscillation": 1}


def write_page(
    folder: Path,
    rows: Sequence[Mapping[str, Any]],
    lines: Sequence[Mapping[str, Any]],
    tags: Sequence[str],
    comparison: CourseComparison | None,
) -> None:
    """Write ``index.html``; the link of a line is empty if its run has no report."""
    from springmass.report.html import SHARED, Figures, drawn_by_script, template

    there = [name for name in COLUMN_HEADINGS if any(line["cells"][name] for line in lines)]  # only with numbers
    shown = [{**line, "link": quote(line["link"]), "parts": _parts(line["name"])} for line in lines]
    figures = Figures()
    differing = {visible(line["name"]): line["differs"] for line in lines if line["differs"]}
    right = [row for row, line in zip(rows, lines, strict=True) if line["look"] not in ("failed", "error")]
    charts = (_of_all(rows, differing, comparison), _of_drag(right))
    drawn = [figures.add(chart) for chart in charts if chart is not None]
    page = template("course.html.j2").render(
        title=folder.resolve().name,
        lines=sorted(shown, key=lambda line: (*(-x for x in line["need"][:3]), line["name"])),
        tags=tags,
        quantities={name: COLUMN_HEADINGS[name] for name in there},
        agreements=() if comparison is None else comparison.agreements,
        counts={kind: sum(line["look"] == kind for line in shown) for kind in LINE_LOOKS},
        figures={figure["name"]: figure for figure in drawn},
        **drawn_by_script(figures.charts, SHARED),
    )
    write_whole(folder / COURSE_PAGE, page.encode("utf-8", "backslashreplace"))


def _parts(name: str) -> list[str]:
    """Return a name in parts between which a line may break; parts that are too long for a column break anywhere."""
    parts = re.split(r"(?<=[_\-/. ])", name)
    return parts if max(map(len, parts)) <= LONGEST_PART else []


def _of_all(
    rows: Sequence[Mapping[str, Any]], differing: Mapping[str, str], comparison: CourseComparison | None
) -> Chart | None:
    """Return the chart of all spring constants, or else of all periods, if at least two runs have one."""
    by = "" if comparison is None or comparison.bench == COURSE else comparison.bench
    for name, label in (("spring_constant", "spring constant / (N/m)"), ("period", "period / s")):
        values = [
            CourseValue(
                run := visible(row["run"]),
                visible(row.get(by) or "none") if by else run,
                row[name],
                row[f"{name}_u"] or 0.0,
            )
            for row in sorted(rows, key=lambda row: (not row.get(by), row.get(by)))
            if row.get(name) is not None
        ]
        if len(values) > 1:
            agreements = () if comparison is None else comparison.agreements
            means = [x.mean for x in agreements if x.quantity == name and x.mean is not None]
            return course(label, by or "run", values, differing, means[0] if len(means) == 1 else None)
    return None


def _of_drag(rows: Sequence[Mapping[str, Any]]) -> Chart | None:
    """Return the map of the drag coefficients of all runs that have some."""
    return drag_map(
        [(disc_of(row), np.array(json.loads(points))) for row in rows if (points := row.get("drag_points"))]
    )


def line_of(row: Mapping[str, Any], tags: Sequence[str]) -> dict[str, Any]:
    """Return the line that the page shows for a run; the larger ``need``, the more it needs inspection.

    That is whether it has no period, its errors, its findings that change a result, and its misfit, in this order.
    """
    failed = row["status"] in FAILED
    look = "failed" if failed else "error" if row["errors"] else "warning" if row["tell"] else "fine"
    return {
        "name": row["run"],
        "link": "",
        "look": look,
        "need": [_STATUS.get(row["status"], 2), row["errors"], len(row["tell"]), row.get("reduced_chi2") or 0.0],
        "tell": [sentence(row["error"].removeprefix(f"{row['path']}: "))] if failed else row["tell"],
        "notes": [message for _, message in json.loads(row.get("messages") or "[]")],
        "differs": "",
        "tags": [row[tag] or "" for tag in tags],
        "cells": {name: _cell(row, name) for name in COLUMN_HEADINGS},
        "law": row.get("law") or "",
        "thumbnail": row["thumbnail"],
    }


def mark(lines: Sequence[dict[str, Any]], comparison: CourseComparison) -> None:
    """Put what the comparison says about a run first among the sentences for its group, and let it count."""
    by_name = {line["name"]: line for line in lines}
    said = [(group.name, group.message, "error") for group in comparison.suspects]
    if comparison.bench != COURSE:  # without a column of benches, nobody says that runs belong together
        apart = [group for group in comparison.disagreements if group.spread > LITTLE]
        said += [(name, group.message, "warning") for group in apart for name in group.names]
    for name, message, look in said:
        line = by_name[name]
        if not any(message in text for text in line["tell"]):
            line["tell"] = [sentence(message), *line["tell"]]
        if LINE_LOOKS.index(look) < LINE_LOOKS.index(line["look"]):
            line["look"] = look
        line["need"][1 if look == "error" else 2] += 1
        line["differs"] = line["differs"] or (message if look == "error" else "")


def write_groups(folder: Path, lines: Sequence[Mapping[str, Any]], tags: Sequence[str]) -> None:
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
        title = "All runs" if column is None else f"{tags[column]} {name}" if name else f"without {tags[column]}"
        texts = [f"  {', '.join(names)}: {text}" for text, names in runs_of.items()] or ["  nothing to mend"]
        paragraphs.append("\n".join([f"{title}: {count(len(group), 'run')}", *texts]))
    text = visible_lines("\n\n".join(paragraphs))
    write_whole(folder / GROUPS_FILE, text.encode("utf-8", "backslashreplace") + b"\n")


def _cell(row: Mapping[str, Any], name: str) -> tuple[str, str] | None:
    """Return an estimate's text, and its value as the sort key."""
    value, u = row.get(name), row.get(f"{name}_u")
    if value is not None and name == "disc_damping_rate":
        return f"{value:.2g}", repr(value)
    if value is None or u is None:
        return None
    return repr(Estimate(value, u, row["unit"] if name == "amplitude" else "")), repr(value)
