"""The columns of a course's table, and ``results.csv``, the file that everything else reads."""

import csv
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from acquisition.regular_file import open_regular_text
from pipeline.bench.scene import PLACES
from pipeline.quantities import QUANTITIES
from springmass.errors import UNREADABLE, ProgramError
from springmass.typeset import cell
from storage.atomic import whole_file, writing

CSV = "results.csv"
ESTIMATES = (*QUANTITIES, "natural_angular_frequency", "own_mass_kg")
"""Estimates with two columns each: the value, and with ``_u`` the standard uncertainty, in SI units."""
QUALITY = (
    "used", "missing", "false_echo", "clipped", "duplicate_time", "non_monotonic_time", "outside", "malformed_rows",
)  # fmt: skip
WHOLE = ("samples", *QUALITY, "errors", "warnings")
NUMERIC_COLUMNS = (
    "rate_hz", "duration_s", "u_clock", "reduced_chi2", "disc_damping_rate",
    *(name for pair in ((x, f"{x}_u") for x in (*ESTIMATES, *PLACES)) for name in pair),
)  # fmt: skip
DETAILS = ("findings", "messages", "correlations", "drag_points")
"""Columns that contain JSON."""
_FIRST = ("run", "path", "status", "error")
_LAWS = ("law", "admissible", "stated_law", "one_law", "undetermined")
_ORIGIN = ("input_sha256", "scene_sha256", "parameters_sha256", "software")
COURSE_COLUMNS = (
    *_FIRST, "format", "kind", "channel", "unit", "start_time", "clock", *_LAWS, *WHOLE, *NUMERIC_COLUMNS, *_ORIGIN,
    *DETAILS,
)  # fmt: skip
COURSE = "course"
"""Column with the folder of the course, used when several courses are read together."""
RESERVED = frozenset((COURSE, *COURSE_COLUMNS))
"""Names that no tag may have."""
FAILED = ("failed", "ended", "no_oscillation")
"""Values of ``status`` for runs without a period; "ended" means that the worker process died."""
_HEAD = ",".join(_FIRST[:3])
_QUOTED = re.compile(r"'(?=\s*[-=+@＝＋－＠])")


def columns_of(tags: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of a course's table, with its tags after the status."""
    return (*_FIRST, *tags, *COURSE_COLUMNS[len(_FIRST) :])


def write_results(folder: Path, rows: Iterable[Mapping[str, Any]], tags: Sequence[str]) -> None:
    """Write ``results.csv`` whole: numbers with all their digits, unknown values empty, texts without formulas."""
    columns = columns_of(tags)
    with whole_file(folder / CSV) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        with writing(folder / CSV):
            table.writerow(columns)
            for row in rows:
                values = [row.get(name) for name in columns]
                table.writerow([cell(value) if isinstance(value, str) else value for value in values])
            file.flush()


def is_course(folder: str | os.PathLike[str]) -> bool:
    """Return whether a folder has results of ``springmass batch``."""
    try:
        with open_regular_text(os.path.join(folder, CSV), "utf-8") as file:
            return file.read(len(_HEAD)) == _HEAD
    except (OSError, ValueError):
        return False


def read_results(folder: str | os.PathLike[str]) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the rows of ``results.csv`` by column, and the course's own columns; an empty cell is None."""
    if not is_course(folder):
        raise ProgramError(f"{folder}: expected a folder that springmass batch made", "name that of its -o")
    path = os.path.join(folder, CSV)
    try:
        with open_regular_text(path, "utf-8", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
        names = tuple(rows[0]) if rows else COURSE_COLUMNS
        if missing := [name for name in COURSE_COLUMNS if name not in names]:
            raise ValueError(f"no column {missing[0]}")
        found = [{name: _value(name, row[name]) for name in names} for row in rows]
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise ProgramError(f"{path}: damaged ({error})", "run springmass batch again", UNREADABLE) from error
    return found, tuple(name for name in names if name not in RESERVED)


def _value(name: str, text: str) -> Any:
    if not text:
        return None
    return float(text) if name in _FLOATS else int(text) if name in WHOLE else _QUOTED.sub("", text, count=1)


_FLOATS = frozenset(NUMERIC_COLUMNS)
