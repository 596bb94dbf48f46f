"""Compare the runs of a course: springs, discs, scatter within and between benches, and wrongly labelled runs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.numerics.estimate import Estimate, format_value
from pipeline.results.course import Agreement, CourseRun, Suspect, agreement, suspects
from springmass.batch.rows import COURSE
from springmass.errors import UNREADABLE, USAGE, ProgramError

__all__ = ["CourseComparison", "compare_rows", "compared_json", "compared_text"]

BENCHES = ("bench", "group", "section", COURSE)
"""Candidate columns that distinguish benches; the first one that the course has is used."""


@dataclass(frozen=True, slots=True)
class CourseComparison:
    """A comparison of many runs.

    Parameters
    ----------
    runs : int
        Number of runs with a period.
    bench : str
        The column that distinguishes benches.
    agreements : tuple of Agreement
        Agreement of spring constants for each spring and of drag coefficients for each disc, without the suspects.
    suspects : tuple of Suspect
        Runs that differ from their course.
    laws : mapping of str to int
        Number of runs for which each damping law was selected.
    """

    runs: int
    bench: str
    agreements: tuple[Agreement, ...]
    suspects: tuple[Suspect, ...]
    laws: Mapping[str, int]


def compare_rows(rows: Sequence[Mapping[str, Any]], *, bench: str | None = None) -> CourseComparison:
    """Compare the runs of a course.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table by column. The columns ``spring`` and ``disc`` distinguish springs and discs if a row has
        them; otherwise the spring's mass and the disc's diameter do.
    bench : str, optional
        The column that distinguishes benches; if omitted, the first of :data:`BENCHES` that exists.

    Raises
    ------
    ProgramError
        With exit code 2 if the column does not exist, 3 if fewer than two runs have a period.
    """
    moving = [row for row in rows if row["status"] == "ok"]
    if len(moving) < 2:
        raise ProgramError(f"compare needs two runs with a period, got {len(moving)}; see --where", UNREADABLE)
    if bench is not None and bench not in moving[0]:
        raise ProgramError(f"--bench: the course has no column {bench!r}; name another", USAGE)
    by = bench or next(name for name in BENCHES if name in moving[0])
    courses = {row[COURSE] for row in moving}
    runs = [_run(row, by, alone=len(courses) == 1) for row in moving]
    differing = suspects(runs)
    named = {suspect.name for suspect in differing}
    good = [run for run in runs if run.name not in named]
    agreements = []
    for quantity, label in (("spring_constant", "spring"), ("drag", "disc")):
        groups: dict[str, list[CourseRun]] = {}
        for run in good:
            if getattr(run, quantity) is not None:
                groups.setdefault(getattr(run, label), []).append(run)
        for name, group in sorted(groups.items()):
            values = [getattr(run, quantity) for run in group]
            agreements.append(agreement(_NAMES[quantity], name, values, [run.bench for run in group]))
    counts: dict[str, int] = {}
    for row in moving:
        if row["law"]:
            counts[row["law"]] = counts.get(row["law"], 0) + 1
    laws = dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))
    return CourseComparison(len(runs), by, tuple(agreements), differing, laws)


_NAMES = {"spring_constant": "spring_constant", "drag": "drag_coefficient"}


def _run(row: Mapping[str, Any], bench: str, *, alone: bool) -> CourseRun:
    k, omega, mass = (_number(row, name) for name in ("spring_constant", "natural_angular_frequency", "own_mass_kg"))
    own = math.hypot(2.0 * _number(row, "natural_angular_frequency_u") / omega, _number(row, "own_mass_kg_u") / mass)
    points = np.array(json.loads(row["drag_points"] or "[]"))
    middle = points[len(points) // 2] if len(points) else None
    return CourseRun(
        name=row["run"] if alone else f"{row[COURSE]}: {row['run']}",
        spring=_label(row, "spring", "spring_mass_kg"),
        disc=_label(row, "disc", "disc_diameter_m"),
        bench=str(row[bench] or ""),
        spring_constant=Estimate(k, k * own, "N/m") if math.isfinite(k * own) else None,
        drag=None if middle is None else Estimate(float(middle[2]), float(middle[3])),
    )


def _label(row: Mapping[str, Any], tag: str, scene: str) -> str:
    label = row.get(tag)
    if label is None:
        label = row[scene]
    return "" if label is None else str(label)


def _number(row: Mapping[str, Any], name: str) -> float:
    value = row[name]
    return math.nan if value is None else float(value)


def compared_json(comparison: CourseComparison) -> dict[str, Any]:
    """Return a comparison as a JSON-serialisable mapping."""
    from springmass.runs.json_results import SCHEMA, plain

    fields: dict[str, Any] = plain(comparison)
    return {"schema": SCHEMA, **fields}


def compared_text(comparison: CourseComparison) -> str:
    """Return a comparison as lines of text."""
    lines = [f"{comparison.runs} runs; benches distinguished by {comparison.bench}", ""]
    for group in comparison.agreements:
        of = f" of {group.group}" if group.group else ""
        lines.append(f"{group.quantity}{of}: {format_value(group.mean.value, group.mean.u, group.mean.unit)}")
        within = "one run a bench" if math.isnan(group.within) else f"{group.within:.2g} within a bench"
        benches = f"{group.between:.2g} between {group.benches} benches"
        between = "one bench" if math.isnan(group.between) else benches
        lines.append(f"  {group.runs} runs; scatter {within} (stated {group.stated:.2g}), {between}")
    if any(group.quantity == "drag_coefficient" for group in comparison.agreements):
        lines.append("a drag coefficient counts all damping as drag of the disc, that of spring and hook too")
    laws = ", ".join(f"{law} {count}" for law, count in comparison.laws.items())
    lines += ["", f"damping laws selected: {laws}"] if laws else []
    differing = comparison.suspects
    lines += ["", f"runs that differ from their course: {len(differing)}"] if differing else []
    lines += [f"  {suspect.name}: {suspect.message}" for suspect in differing]
    return "\n".join(lines)
