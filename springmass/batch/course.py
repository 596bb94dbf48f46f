"""``runs.csv``: what is known of each run of a course, a row a file or a row a pattern."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from acquisition.regular_file import open_regular_text
from pipeline.bench.scene import PLACES
from springmass.batch.rows import COLUMNS
from springmass.errors import USAGE, ProgramError
from springmass.runs.inputs import Found

__all__ = ["Course", "Said", "join", "read_course", "template"]

ANSWERS = ("velocity", "channel", "run", "rate_hz", "unit", "time", "time_unit", "from_s", "to_s", "clock_ppm")
NUMBERS = ("rate_hz", "from_s", "to_s", "clock_ppm")
POSITION = "sensor_position"
KNOWN = ("path", "scene", POSITION, *ANSWERS, *PLACES, *(f"{name}_u" for name in PLACES))
TEMPLATE = (
    "path", "bob_mass_kg", "bob_mass_kg_u", "spring_mass_kg", "spring_mass_kg_u", "disc_diameter_m",
    "disc_diameter_m_u", "air_temperature_c", "group", "section", "spring", "disc",
)  # fmt: skip
LARGEST = 64 << 20  # bytes
_TAG = re.compile(r"[a-z][a-z0-9_]*")
_UNIT = re.compile(r"_(kg|g|m|mm|cm|s|hz|c|pa|n_per_m|per_s)(_u)?$")


@dataclass(frozen=True, slots=True)
class Said:
    """What one row says of a run, or all rows that name it.

    Parameters
    ----------
    scene_file : str
        Empty where none is named.
    scene : mapping
        Values by attribute of a scene: text of a position, or (value, u).
    answers : mapping
        What the recording leaves open, as :func:`springmass.runs.loading.load` takes it.
    tags : mapping of str to str
    line : int
        In the file; of several rows the first.
    """

    scene_file: str = ""
    scene: Mapping[str, Any] = field(default_factory=dict)
    answers: Mapping[str, Any] = field(default_factory=dict)
    tags: Mapping[str, str] = field(default_factory=dict)
    line: int = 0


@dataclass(frozen=True, slots=True)
class Course:
    """A table of runs.

    Parameters
    ----------
    path : Path
    tags : tuple of str
        Names of its columns that are no part of a scene or a recording.
    rows : tuple of (str, Said)
        A path or pattern, and what is said there.
    """

    path: Path
    tags: tuple[str, ...]
    rows: tuple[tuple[str, Said], ...]

    def files(self) -> list[str]:
        """Return the files that it names without a pattern, those of its own folder where they are relative."""
        named = [os.path.join(self.path.parent, text) for text, _ in self.rows if not self.is_pattern(text)]
        return list(dict.fromkeys(named))

    def is_pattern(self, text: str) -> bool:
        """Return whether a row's path is a pattern: with a mark of one, and not the name of a file, ``run [1].txt``."""
        return any(mark in text for mark in "*?[") and not os.path.exists(os.path.join(self.path.parent, text))


def template(paths: Sequence[str]) -> str:
    """Return a ``runs.csv`` to fill in, a row for each path."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(TEMPLATE)
    writer.writerows([path, *[""] * (len(TEMPLATE) - 1)] for path in paths)
    return out.getvalue()


def read_course(path: str | Path) -> Course:
    """Read a table of runs: commas, semicolons or tabs, a decimal comma where commas do not part the columns.

    Raises
    ------
    ProgramError
        With exit code 2 if it is no such table; the line names row, column and value.
    """
    path = Path(path)
    table = list(_table(path))
    if not table:
        raise ProgramError(f"{path}: a table of runs was demanded, got an empty file; see batch --template", USAGE)
    (_, head, comma), *lines = table
    names = [name.strip() for name in head]
    while names and not names[-1]:
        names.pop()
    tags = _checked(path, names)
    rows = []
    for number, cells, _ in lines:
        if len(cells) > len(names) and any(cell.strip() for cell in cells[len(names) :]):
            demand = f"{len(names)} columns were demanded, got {len(cells)}; put quotes about a text with a separator"
            raise ProgramError(f"{path}, line {number}: {demand}", USAGE)
        told = {name: cell.strip() for name, cell in zip(names, cells, strict=False) if cell.strip()}
        if not told:
            continue
        if "path" not in told:
            raise ProgramError(f"{path}, line {number}: the path of a run was demanded, got none", USAGE)
        rows.append((told["path"], _said(path, number, told, tags, decimal_comma=comma)))
    return Course(path, tags, tuple(rows))


def _table(path: Path) -> Iterator[tuple[int, list[str], bool]]:
    """Yield line number, cells and whether numbers may have a decimal comma."""
    try:
        if path.stat().st_size > LARGEST:
            raise ProgramError(f"{path}: a table of runs of at most {LARGEST >> 20} MB was demanded", USAGE)
        with open_regular_text(path, "utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        raise ProgramError(f"{path}: a table of runs was demanded, {error.strerror}; check the name", USAGE) from error
    except UnicodeDecodeError as error:
        raise ProgramError(f"{path}: a table in UTF-8 was demanded; save the sheet as CSV UTF-8", USAGE) from error
    first = text.partition("\n")[0]
    mark = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark)
    try:
        for cells in reader:
            if cells and not cells[0].lstrip().startswith("#"):
                yield reader.line_num, cells, mark != ","
    except csv.Error as error:
        raise ProgramError(f"{path}, line {reader.line_num}: no row of a table ({error})", USAGE) from error


def _checked(path: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return the tags among the names of columns."""
    if "path" not in names:
        raise ProgramError(f"{path}: a column path was demanded, got {', '.join(names)}; see batch --template", USAGE)
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ProgramError(f"{path}: the column {twice[0]} stands there twice; leave one out", USAGE)
    tags = []
    for name in names:
        if name in KNOWN:
            continue
        near = get_close_matches(name, KNOWN, n=1, cutoff=0.85)
        if near or _UNIT.search(name):
            hint = f"did you mean {near[0]}?" if near else f"allowed with a unit are {', '.join(PLACES)}"
            raise ProgramError(f"{path}: unknown column {name!r}; {hint}", USAGE)
        if not _TAG.fullmatch(name) or name in COLUMNS:
            demand = "a tag of lower-case letters, digits and _ that is no column of the results"
            raise ProgramError(f"{path}: {demand} was demanded, got {name!r}; rename the column", USAGE)
        tags.append(name)
    return tuple(tags)


def _said(path: Path, line: int, told: Mapping[str, str], tags: Sequence[str], *, decimal_comma: bool) -> Said:
    def number(name: str) -> float:
        text = told[name].replace(",", ".") if decimal_comma else told[name]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ProgramError(f"{path}, line {line}: {name} must be a finite number, got {told[name]!r}", USAGE)
        return value

    scene: dict[str, Any] = {POSITION: told[POSITION]} if POSITION in told else {}
    for name in PLACES:
        if name in told:
            scene[name] = (number(name), number(f"{name}_u") if f"{name}_u" in told else 0.0)
        elif f"{name}_u" in told:
            raise ProgramError(f"{path}, line {line}: {name}_u does nothing without {name}; fill in both", USAGE)
    answers: dict[str, Any] = {
        name: number(name) if name in NUMBERS else told[name] for name in ANSWERS if name in told
    }
    if "velocity" in answers:
        answers["velocity"] = os.path.join(path.parent, answers["velocity"])
    scene_file = os.path.join(path.parent, told["scene"]) if "scene" in told else ""
    return Said(scene_file, scene, answers, {name: told[name] for name in tags if name in told}, line)


def join(course: Course, found: Sequence[Found]) -> tuple[list[tuple[Found, Said]], list[str], list[str]]:
    """Return each file with what the table says of it, rows that no file belongs to, and files without a row.

    A file has a run for each row that names it by its path with another ``run`` or ``channel``. What a pattern says
    holds where such a row says nothing.

    Raises
    ------
    ProgramError
        With exit code 2 if two rows say different things of one run.
    """
    exact: dict[str, list[Said]] = {}
    patterns: list[tuple[str, Said]] = []
    for text, said in course.rows:
        if course.is_pattern(text):
            patterns.append((text, said))
        else:
            exact.setdefault(os.path.abspath(os.path.join(course.path.parent, text)), []).append(said)
    used: set[int] = set()
    joined: list[tuple[Found, Said]] = []
    without: list[str] = []
    here = os.path.abspath(course.path.parent)
    for one in found:
        whole = os.path.abspath(one.path)
        wide = [said for text, said in patterns if _matches(whole, text, here)]
        narrow = exact.get(whole, [])
        used |= {said.line for said in (*wide, *narrow)}
        base = _together(course, one.path, wide)
        if not wide and not narrow:
            without.append(one.path)
        seen: dict[tuple[Any, Any], int] = {}
        for said in narrow:
            which = (said.answers.get("run"), said.answers.get("channel"))
            if which in seen:
                demand = f"lines {seen[which]} and {said.line} name {one.path}; leave one out, or tell their runs apart"
                raise ProgramError(f"{course.path}: {demand}", USAGE)
            seen[which] = said.line
        joined += [(one, _over(base, said)) for said in narrow] or [(one, base)]
    unused = [f"line {said.line}: {text}" for text, said in course.rows if said.line not in used]
    return joined, unused, without


def _together(course: Course, path: str, rows: Sequence[Said]) -> Said:
    """Return what all patterns say that a file matches."""
    whole = Said()
    for said in rows:
        for part in ("scene", "answers", "tags"):
            before, after = getattr(whole, part), getattr(said, part)
            if clash := sorted(name for name in after if before.get(name, after[name]) != after[name]):
                demand = f"lines {whole.line} and {said.line} both match {path} and differ in {clash[0]}"
                raise ProgramError(f"{course.path}: {demand}; narrow one of the patterns", USAGE)
        whole = _over(whole, said)
    return whole


def _over(under: Said, said: Said) -> Said:
    merged = {f.name: {**getattr(under, f.name), **getattr(said, f.name)} for f in fields(Said)[1:4]}
    return Said(said.scene_file or under.scene_file, **merged, line=under.line or said.line)


def _matches(whole: str, pattern: str, here: str) -> bool:
    """Tell whether a path matches: by its name alone where the pattern has no slash."""
    if "/" not in pattern:
        return fnmatchcase(os.path.basename(whole), pattern)
    return fnmatchcase(whole, os.path.normpath(os.path.join(here, pattern)))
