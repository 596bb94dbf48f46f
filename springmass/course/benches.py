"""Compare the runs of a course: springs, discs, scatter within and between benches, and wrongly labelled runs."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.bench.plausible import slips
from pipeline.bench.scene import PLACES, Scene
from pipeline.numerics.estimate import Estimate
from pipeline.several.compare import SpringRun
from pipeline.several.course import LITTLE, Agreement, CourseRun, Disagreement, Suspect, agreement, judged
from springmass.course.results_csv import COURSE
from springmass.errors import UNREADABLE, ProgramError

BENCHES = ("bench", "group", "section", COURSE)
"""Candidate columns that distinguish benches; the first one that the course has is used."""
SCATTERED = 0.1  # maximum scatter of a spring's constants, over their mean: beyond it they have no common value


@dataclass(frozen=True, slots=True)
class CourseComparison:
    """A comparison of the runs with a period; ``bench`` is the column that distinguishes benches.

    The agreements are of the spring constants of each spring and the drag coefficients of each disc, without the
    runs that are named: suspects have an implausible mass or differ from their course, and ``disagreements`` are
    benches whose other runs of one spring disagree, which count as named beyond half a percent. ``laws`` counts for how
    many runs each damping law was selected.
    """

    runs: int
    bench: str
    agreements: tuple[Agreement, ...]
    suspects: tuple[Suspect, ...]
    disagreements: tuple[Disagreement, ...]
    laws: Mapping[str, int]


def compare_rows(rows: Sequence[Mapping[str, Any]]) -> CourseComparison:
    """Compare the runs of one course or of several, given as rows of their tables with the column ``course``.

    The columns ``spring`` and ``disc`` distinguish springs and discs if a row has them; otherwise the spring's mass and
    the disc's diameter do.
    """
    moving = [row for row in rows if row["status"] == "ok"]
    if len(moving) < 2:
        raise ProgramError(
            f"compare needs two runs with a period, got {len(moving)}", "name a larger course", UNREADABLE
        )
    by = next(name for name in BENCHES if any(name in row for row in moving))
    courses = {row[COURSE] for row in moving}
    runs = [_run(row, by, alone=len(courses) == 1) for row in moving]
    differing, disagreements = judged(runs)
    named = {suspect.name for suspect in differing}
    named |= {name for bench in disagreements if bench.spread > LITTLE for name in bench.names}
    agreements = []
    for quantity, label, called in (
        ("spring_constant", "spring", "spring_constant"),
        ("drag", "disc", "drag_coefficient"),
    ):
        groups: dict[str, list[CourseRun]] = {}
        for run in runs:
            if getattr(run, quantity) is not None:
                groups.setdefault(getattr(run, label), []).append(run)
        for name, group in sorted(groups.items()):
            good = [run for run in group if run.name not in named]
            agreements.append(
                _agreement(called, name, [getattr(run, quantity) for run in good], [run.bench for run in good])
            )
    laws = dict(Counter(sorted(row["law"] for row in moving if row.get("law"))).most_common())
    return CourseComparison(len(runs), by, tuple(agreements), differing, disagreements, laws)


def _agreement(quantity: str, name: str, values: Sequence[Estimate], benches: Sequence[str]) -> Agreement:
    """Return the agreement of a group's good runs, without a mean if they have no common value."""
    if not values:
        return Agreement(quantity, name, mean=None, why="all its runs are among those that differ")
    agreed = agreement(quantity, name, values, benches)
    scatter = max(x for x in (agreed.within, agreed.between, 0.0) if not math.isnan(x))
    if quantity == "spring_constant" and agreed.mean is not None and scatter > SCATTERED * agreed.mean.value:
        low, high = (f"{end.value:.4g}" for end in (min(values, key=float), max(values, key=float)))
        why = f"from {low} to {high} N/m: no one spring; a column spring in runs.csv tells springs apart"
        return replace(agreed, mean=None, why=why)
    return agreed


def _run(row: Mapping[str, Any], bench: str, *, alone: bool) -> CourseRun:
    name = row["run"] if alone else f"{row[COURSE]}: {row['run']}"
    k, omega, mass = (_estimate(row, x) for x in ("spring_constant", "natural_angular_frequency", "own_mass_kg"))
    scene = Scene(**{place: _estimate(row, place) for place in PLACES})
    points = np.array(json.loads(row.get("drag_points") or "[]"))
    middle = points[len(points) // 2] if len(points) else None
    on_spring = spring_constant = None
    if k is not None and omega is not None and mass is not None:
        on_spring = SpringRun(name, omega, mass, row.get("u_clock") or 0.0, row.get("clock") or "")
        spring_constant = Estimate(
            k.value, k.value * math.hypot(2.0 * omega.u / omega.value, mass.u / mass.value), "N/m"
        )
    return CourseRun(
        name=name,
        spring=_label(row.get("spring"), row.get("spring_mass_kg"), "g"),
        disc=disc_of(row),
        bench=str(row.get(bench) or ""),
        spring_constant=spring_constant,
        drag=None if middle is None else Estimate(float(middle[2]), float(middle[3])),
        amplitude=_estimate(row, "amplitude"),
        unit=row.get("unit") or "",
        on_spring=on_spring,
        spring_mass_kg=scene.spring_mass_kg,
        implausible="; ".join(each.clause for each in slips(scene) if each.decides),
    )


def disc_of(row: Mapping[str, Any]) -> str:
    """Return the name of a run's disc, or else its diameter."""
    return _label(row.get("disc"), row.get("disc_diameter_m"), "mm")


def _label(tag: Any, value: float | None, thousandth: str) -> str:
    if tag is not None:
        return str(tag)
    return "" if value is None else f"{1e3 * value:.10g} {thousandth}"


def _estimate(row: Mapping[str, Any], name: str) -> Estimate | None:
    value, u = row.get(name), row.get(f"{name}_u")
    return None if value is None or u is None else Estimate(value, u)
