"""``springmass map``: drag coefficients of a course against Re and KC, beside the literature's lines."""

from __future__ import annotations

import csv
import io
import json
import shlex
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from springmass.batch.search import search
from springmass.commands.options import File, argument, option, output
from springmass.errors import OK, UNREADABLE, ProgramError, suggest, tell
from springmass.runs.outputs import make_folder

COLUMNS = ("run", "disc", "reynolds_number", "keulegan_carpenter_number", "drag_coefficient", "drag_coefficient_u")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class MapOptions:
    """The options of ``springmass map``."""

    where: Annotated[str, option("EXPR", "draw only runs that match this expression, as in catalog")] = ""
    output: Annotated[File, output("DIR", "folder for drag-map.svg, .pdf and .csv (default: here)")] = "."


def map(
    *folders: Annotated[File, argument("DIR", "folders that batch created", required=True)],
    options: MapOptions = MapOptions(),
) -> int:
    """Draw the map of every run for which an expression holds; write it as SVG and PDF, its numbers as CSV."""
    from springmass.charts.drag_map import DragRun, drag_map
    from springmass.charts.draw import save
    from springmass.report.tables import cell
    from storage.atomic import write_whole

    courses = [str(folder) for folder in folders]
    found = search(courses, where=options.where).rows
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(COLUMNS)
    runs = []
    for row in found:
        points = json.loads(row["drag_points"] or "[]")
        if not points:
            continue
        label = row.get("disc") or f"{1e3 * row['disc_diameter_m']:.4g} mm"
        runs.append(DragRun(label, np.array(points)))
        table.writerows([cell(row["run"]), cell(label), *point] for point in points)
    if not any((one.points[:, 2] > 0).any() for one in runs):
        demand = "expected a run with a drag coefficient"
        raise ProgramError(
            f"{demand}, got none among {len(found)}: it needs bob, disc and air in the scene, see --where", UNREADABLE
        )
    folder = make_folder(options.output)
    save([drag_map(runs)], folder, ("svg", "pdf"))
    write_whole(folder / "drag-map.csv", out.getvalue())
    tell(f"{len(runs)} of {len(found)} runs give a drag coefficient; written: {folder / 'drag-map.svg'}")
    suggest(f"springmass compare {shlex.join(courses)}")
    return OK
