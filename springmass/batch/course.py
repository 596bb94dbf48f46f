"""Read ``runs.csv``, a table of known values for the runs of a course, with rows for files or patterns."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from acquisition.regular_file import open_regular_text
from pipeline.bench.scene import PLACES
from pipeline.registry.laws import LAW_NAMES
from springmass.batch.rows import RESERVED, TAG
from springmass.errors import USAGE, ProgramError
from springmass.runs.inputs import InputFile
from springmass.values import ANY_LAW

__all__ = ["Course", "Entry", "join", "read_course", "template"]

ANSWERS = (
    "velocity",
    "channel",
    "run",
    "rate_hz",
    "unit",
    "time",
    "time_unit",
    "delimiter",
    "decimal",
    "from_s",
    "to_s",
    "clock_ppm",
)
NUMBERS = ("rate_hz", "from_s", "to_s", "clock_ppm")
POSITION = "sensor_position"
LAW = "law"
KNOWN = ("path", "scene", POSITION, LAW, *ANSWERS, *PLACES, *(f"{name}_u" for name in PLACES))
TEMPLATE = (
    "path", "bob_mass_kg", "bob_mass_kg_u", "spring_mass_kg", "spring_mass_kg_u", "disc_diameter_m",
    "disc_diameter_m_u", "air_temperature_c", "group", "section", "spring", "disc",
)  # fmt: skip
LARGEST = 64 << 20  # maximum size of a table of runs, bytes
_UNIT = re.compile(r"_(kg|g|m|mm|cm|s|hz|c|pa|n_per_m|per_s)(_u)?$")


@dataclass(frozen=True, slots=True)
class Entry:
    """The values that one row states about a run, or all matching rows together.

    Parameters
    ----------
    scene_file : str
        Path of the scene file; empty if none is named.
    scene : mapping
        The name of a position, or (value, u), by attribute of a scene.
    answers : mapping
        Answers to what the recording leaves open: reading options of :class:`springmass.runs.options.ReadOptions`.
    tags : mapping of str to str
    line : int
        Line number in the file; for several rows, that of the first.
    law : str
        Stated damping law; empty if none is stated.
    """

    scene_file: str = ""
    scene: Mapping[str, Any] = field(default_factory=dict)
    answers: Mapping[str, Any] = field(default_factory=dict)
    tags: Mapping[str, str] = field(default_factory=dict)
    line: int = 0
    law: str = ""


@dataclass(frozen=True, slots=True)
class Course:
    """A table of runs.

    Parameters
    ----------
    path : Path
    tags : tuple of str
        Names of columns that describe neither a scene nor a recording.
    rows : tuple of (str, Entry)
        Path or pattern of each row, with the values that the row states.
    """

    path: Path
    tags: tuple[str, ...]
    rows: tuple[tuple[str, Entry], ...]

    def files(self) -> list[str]:
        """Return the files named without a pattern; relative paths start from the table's folder."""
        named = [os.path.join(self.path.parent, text) for text, _ in self.rows if not self.is_pattern(text)]
        return list(dict.fromkeys(named))

    def is_pattern(self, text: str) -> bool:
        """Return whether a row's path is a pattern rather than the name of a file such as ``run [1].txt``."""
        return any(mark in text for mark in "*?[") and not os.path.exists(os.path.join(self.path.parent, text))


def template(paths: Sequence[str]) -> str:
    """Return a ``runs.csv`` to fill in, with one row per path."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(TEMPLATE)
    writer.writerows([path, *[""] * (len(TEMPLATE) - 1)] for path in paths)
    return out.getvalue()


def read_course(path: str | Path) -> Course:
    """Read a table of runs separated by commas, semicolons or tabs.

    Numbers may have a decimal comma unless commas separate the columns.

    Raises
    ------
    ProgramError
        With exit code 2 if the file is not such a table; the message names row, column and value.
    """
    path = Path(path)
    table = list(_table(path))
    if not table:
        raise ProgramError(f"{path}: expected a table of runs, got an empty file; see batch --template", USAGE)
    (_, head, comma), *lines = table
    names = [name.strip() for name in head]
    while names and not names[-1]:
        names.pop()
    tags = _checked(path, names)
    rows = []
    for number, cells, _ in lines:
        if len(cells) > len(names) and any(cell.strip() for cell in cells[len(names) :]):
            wrong = f"expected {len(names)} columns, got {len(cells)}; put quotes around a text with a separator"
            raise ProgramError(f"{path}, line {number}: {wrong}", USAGE)
        values = {name: cell.strip() for name, cell in zip(names, cells, strict=False) if cell.strip()}
        if not values:
            continue
        if "path" not in values:
            raise ProgramError(f"{path}, line {number}: the path of the run is missing; fill it in", USAGE)
        rows.append((values["path"], _entry(path, number, values, tags, decimal_comma=comma)))
    return Course(path, tags, tuple(rows))


def _table(path: Path) -> Iterator[tuple[int, list[str], bool]]:
    """Yield line number, cells and whether numbers may have a decimal comma, for each row."""
    try:
        if path.stat().st_size > LARGEST:
            raise ProgramError(f"{path}: a table of runs must be at most {LARGEST >> 20} MB", USAGE)
        with open_regular_text(path, "utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        raise ProgramError(f"{path}: no table of runs can be read ({error.strerror}); check the name", USAGE) from error
    except UnicodeDecodeError as error:
        raise ProgramError(f"{path}: not in UTF-8; save the sheet as CSV UTF-8", USAGE) from error
    first = text.partition("\n")[0]
    mark = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark)
    try:
        for cells in reader:
            if cells and not cells[0].lstrip().startswith("#"):
                yield reader.line_num, cells, mark != ","
    except csv.Error as error:
        raise ProgramError(f"{path}, line {reader.line_num}: not a row of a table ({error})", USAGE) from error


def _checked(path: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return the tags among the column names; refuse unknown or repeated columns."""
    if "path" not in names:
        raise ProgramError(f"{path}: no column path, got {', '.join(names)}; see batch --template", USAGE)
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ProgramError(f"{path}: the column {twice[0]} is there twice; leave one out", USAGE)
    tags = []
    for name in names:
        if name in KNOWN:
            continue
        near = get_close_matches(name, KNOWN, n=1, cutoff=0.85)
        if near or _UNIT.search(name):
            hint = f"did you mean {near[0]}?" if near else f"allowed with a unit are {', '.join(PLACES)}"
            raise ProgramError(f"{path}: unknown column {name!r}; {hint}", USAGE)
        if name in RESERVED:
            raise ProgramError(f"{path}: {name!r} is a column of the results; rename the column", USAGE)
        if not TAG.fullmatch(name):
            raise ProgramError(f"{path}: a tag has lower-case letters, digits and _, got {name!r}; rename it", USAGE)
        tags.append(name)
    return tuple(tags)


def _entry(path: Path, line: int, values: Mapping[str, str], tags: Sequence[str], *, decimal_comma: bool) -> Entry:
    def number(name: str) -> float:
        text = values[name].replace(",", ".") if decimal_comma else values[name]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ProgramError(f"{path}, line {line}: {name} must be a finite number, got {values[name]!r}", USAGE)
        return value

    scene: dict[str, Any] = {POSITION: values[POSITION]} if POSITION in values else {}
    for name in PLACES:
        if name in values:
            scene[name] = (number(name), number(f"{name}_u") if f"{name}_u" in values else 0.0)
        elif f"{name}_u" in values:
            raise ProgramError(f"{path}, line {line}: {name}_u is there without {name}; fill in both", USAGE)
    answers: dict[str, Any] = {
        name: number(name) if name in NUMBERS else values[name] for name in ANSWERS if name in values
    }
    if "velocity" in answers:
        answers["velocity"] = os.path.join(path.parent, answers["velocity"])
    scene_file = os.path.join(path.parent, values["scene"]) if "scene" in values else ""
    law = values.get(LAW, "")
    if law not in ("", ANY_LAW, *LAW_NAMES):
        laws = ", ".join((*LAW_NAMES, ANY_LAW))
        raise ProgramError(f"{path}, line {line}: {LAW} must be one of {laws}, got {law!r}", USAGE)
    return Entry(scene_file, scene, answers, {name: values[name] for name in tags if name in values}, line, law)


def join(course: Course, files: Sequence[InputFile]) -> tuple[list[tuple[InputFile, Entry]], list[str], list[str]]:
    """Return each file with its values from the table, rows without a file, and files without a row.

    A file has one run for each row that names its path with a different ``run`` or ``channel``. A row with a path
    takes precedence over a row with a pattern.

    Raises
    ------
    ProgramError
        With exit code 2 if two rows contradict each other about one run.
    """
    exact: dict[str, list[Entry]] = {}
    patterns: list[tuple[str, Entry]] = []
    for text, entry in course.rows:
        if course.is_pattern(text):
            patterns.append((text, entry))
        else:
            exact.setdefault(os.path.abspath(os.path.join(course.path.parent, text)), []).append(entry)
    used: set[int] = set()
    joined: list[tuple[InputFile, Entry]] = []
    without: list[str] = []
    here = os.path.abspath(course.path.parent)
    for file in files:
        whole = os.path.abspath(file.path)
        wide = [entry for text, entry in patterns if _matches(whole, text, here)]
        narrow = exact.get(whole, [])
        used |= {entry.line for entry in (*wide, *narrow)}
        base = _together(course, file.path, wide)
        if not wide and not narrow:
            without.append(file.path)
        seen: dict[tuple[Any, Any], int] = {}
        for entry in narrow:
            which = (entry.answers.get("run"), entry.answers.get("channel"))
            if which in seen:
                wrong = f"lines {seen[which]} and {entry.line} both name {file.path}"
                raise ProgramError(f"{course.path}: {wrong}; leave one out, or give each another run or channel", USAGE)
            seen[which] = entry.line
        joined += [(file, _over(base, entry)) for entry in narrow] or [(file, base)]
    unused = [f"line {entry.line}: {text}" for text, entry in course.rows if entry.line not in used]
    return joined, unused, without


def _together(course: Course, path: str, rows: Sequence[Entry]) -> Entry:
    """Return the combined values of all patterns that match a file."""
    whole = Entry()
    for entry in rows:
        for part in ("scene", "answers", "tags"):
            before, after = getattr(whole, part), getattr(entry, part)
            if clash := sorted(name for name in after if before.get(name, after[name]) != after[name]):
                wrong = f"lines {whole.line} and {entry.line} both match {path} and differ in {clash[0]}"
                raise ProgramError(f"{course.path}: {wrong}; narrow one of the patterns", USAGE)
        if whole.law and entry.law and whole.law != entry.law:
            wrong = f"lines {whole.line} and {entry.line} both match {path} and differ in {LAW}"
            raise ProgramError(f"{course.path}: {wrong}; narrow one of the patterns", USAGE)
        whole = _over(whole, entry)
    return whole


def _over(under: Entry, over: Entry) -> Entry:
    merged = {name: {**getattr(under, name), **getattr(over, name)} for name in ("scene", "answers", "tags")}
    line, law = under.line or over.line, over.law or under.law
    return Entry(over.scene_file or under.scene_file, merged["scene"], merged["answers"], merged["tags"], line, law)


def _matches(whole: str, pattern: str, here: str) -> bool:
    """Return whether a path matches a pattern; a pattern without a slash is compared only with the file name."""
    if "/" not in pattern:
        return fnmatchcase(os.path.basename(whole), pattern)
    return fnmatchcase(whole, os.path.normpath(os.path.join(here, pattern)))
