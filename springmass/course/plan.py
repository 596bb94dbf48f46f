"""Turn inputs, and the table of runs with the known values of each, into tasks; and what a row depends on."""

from __future__ import annotations

import csv
import functools
import glob
import hashlib
import io
import json
import os
import re
import subprocess
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from fnmatch import fnmatchcase
from importlib.metadata import version
from pathlib import Path
from typing import Any

from acquisition.recordings.identify import dialect_folder
from acquisition.recordings.reading import READ_FIELDS, ValueKind
from acquisition.regular_file import read_regular
from pipeline.bench.law_names import ANY_LAW, law_names
from pipeline.bench.scene import BENCH_KEYS, PLACES, Scene
from pipeline.bench.typed import typed
from springmass import __version__
from springmass.comparing.user_table import Row, read_rows
from springmass.course.results_csv import RESERVED
from springmass.errors import UNREADABLE, ProgramError
from springmass.layout import part
from springmass.loading.inputs import InputFile, files_of
from springmass.loading.loaded import sha256_of
from springmass.loading.notes import notes_paths
from springmass.loading.options import ANALYSIS_DEFAULTS, AnalysisOptions
from springmass.loading.scenes import read_scene
from springmass.result.output_names import numbered
from springmass.runs.tasks import Task

_LIBRARIES = ("numpy", "scipy", "uncertainties")


def key_of(task: Task) -> str:
    """Return what distinguishes a run from others: its path as the inputs name it, and the run and channel in it."""
    return json.dumps([task.name, task.how.run, task.how.channel])


def digests_of(task: Task) -> dict[str, str]:
    """Return the digests of the given scene, empty if there is none, and of the options but the velocity file."""
    scene = "" if task.scene is None else _digest(task.scene.to_mapping())
    # A path would differ between folders that hold the same course; made_of reads the file.
    return {"scene_sha256": scene, "parameters_sha256": _digest(replace(task.how, velocity=None).given())}


def made_of(task: Task) -> str:
    """Return a digest of all on which the run's row and report depend; this reads the files."""
    files = (task.source, task.how.velocity, *notes_paths(Path(task.source)))
    read = [digest_of(str(path)) if path else "" for path in files]
    return _digest([*read, digests_of(task), software()])


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs of a course sorted by path, its own columns with the values of each run, and lines for the user.

    A task has an absolute path, which every process can find, and is named by the path as the inputs name it.
    """

    tasks: tuple[Task, ...]
    tags: tuple[str, ...]
    tagged: tuple[Mapping[str, str], ...]
    notes: tuple[str, ...]


def plan(
    inputs: Sequence[str],
    *,
    runs_csv: str | None = None,
    scene: str | None = None,
    how: AnalysisOptions = ANALYSIS_DEFAULTS,
    known_paths: Collection[str] = (),
    output: str | None = None,
) -> Plan:
    """Find the runs of a course and the known values of each.

    Inputs are files, folders with all their contents, and patterns; without inputs, the files that the table of runs
    names. Scene and options are for all runs, and the table takes precedence. ``known_paths`` were
    identified as recordings by an earlier pass, ``output`` is left out.
    """
    table = None if runs_csv is None else read_table(runs_csv)
    out = {os.path.abspath(path) for path in (output, runs_csv) if path is not None}
    texts = list(_expanded(inputs)) if inputs or table is None else table.files()
    # A file that the table names is a run even if it cannot be read.
    named = {os.path.abspath(path) for path in (*known_paths, *(() if table is None else table.files()))}
    recordings, notes = files_of(texts, deep=True, known=named, but=out)
    first: dict[str, InputFile] = {}
    for recording in recordings:  # a file named by several inputs is one run
        first.setdefault(os.path.abspath(recording.path), recording)
    files = sorted(first.values(), key=lambda recording: recording.path)
    joined: list[tuple[InputFile, int, Values]] = [(recording, 0, {}) for recording in files]
    tags: tuple[str, ...] = ()
    if table is not None:
        joined, said = join(table, files)
        tags = table.tags
        notes += [*said, *([f"{table.path}: tags: {', '.join(tags)}"] if tags else [])]
    shared = None if scene is None else read_scene(scene)
    if shared is not None and shared.damping_law is not None and how.law is None:
        notes.insert(0, f"damping law {shared.damping_law}: stated in {scene}")
    tasks = []
    for file, line, values in joined:
        answers = {"velocity": file.velocity} | {name: values[name] for name in ANSWERS if name in values}
        if answers["velocity"] is not None:
            answers["velocity"] = os.path.abspath(answers["velocity"])
        of_run = _scene(values, shared, f"{runs_csv}, line {line}")
        tasks.append(Task(os.path.abspath(file.path), file.path, of_run, replace(how, **answers)))
    tagged = tuple({name: values[name] for name in tags if name in values} for _, _, values in joined)
    return Plan(tuple(tasks), tags, tagged, tuple(notes))


def _expanded(inputs: Sequence[str]) -> list[str]:
    texts: list[str] = []
    for text in inputs:
        if any(mark in text for mark in "*?[") and not os.path.exists(text):
            matched = sorted(glob.glob(text, recursive=True))
            if not matched:
                raise ProgramError(f"{text}: no file matches this pattern", "check the pattern", UNREADABLE)
            texts += matched
        else:
            texts.append(text)
    return texts


def _scene(values: Values, shared: Scene | None, where: str) -> Scene | None:
    """Return the scene that a run is given, with the values of the table in place of those of a file."""
    given = read_scene(values["scene"]) if "scene" in values else shared
    tables = {} if given is None else given.to_mapping()
    if POSITION in values:
        tables.setdefault("sensor", {})["position"] = values[POSITION]
    for name in PLACES.keys() & values.keys():
        (table, key), (value, u) = PLACES[name], values[name]
        tables.setdefault(table, {})[key] = {"value": value, "u": u} if u else value
    return Scene.from_mapping(tables, where=where) if tables else None


def names_of(tasks: Sequence[Task]) -> list[str]:
    """Return a name per run: its path below the common folder, without suffix, with repeated names numbered."""
    if not tasks:
        return []
    whole = [task.source for task in tasks]
    above = os.path.commonpath([os.path.dirname(path) for path in whole])
    return numbered([os.path.splitext(os.path.relpath(path, above))[0].replace(os.sep, "/") for path in whole])


@functools.cache
def software() -> str:
    """Return what a row depends on besides its run: the program, its libraries and the user's dialects."""
    parts = [f"springmass {__version__}{_commit()}", *(f"{name} {version(name)}" for name in _LIBRARIES)]
    if dialects := sorted(dialect_folder().glob("*.toml")):
        parts.append(f"dialects {hashlib.sha256(b''.join(map(read_regular, dialects))).hexdigest()[:12]}")
    return ", ".join(parts)


def _commit() -> str:
    """Return the commit of a checkout, with a digest of its uncommitted changes; empty elsewhere, and without git."""
    if not part(".git").exists():  # a wheel's environment may lie in the repository of another project
        return ""
    git = ["git", "-C", str(part(""))]
    try:
        commit = subprocess.check_output([*git, "rev-parse", "--short=12", "HEAD"], stderr=subprocess.DEVNULL)
        changes = subprocess.check_output([*git, "diff", "HEAD"], stderr=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"+{commit.decode().strip()}" + (f".{hashlib.sha256(changes).hexdigest()[:12]}" if changes else "")


def digest_of(path: str) -> str:
    """Return the SHA-256 of a file in hexadecimal digits; empty if it cannot be read."""
    try:
        return sha256_of(Path(path))
    except (OSError, ValueError):
        return ""


def _digest(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


LAW = "law"
OF_ANALYSIS = ("from_s", "to_s", "clock_ppm")
ANSWERS = (*READ_FIELDS, LAW, *OF_ANALYSIS)
POSITION = "sensor_position"
_U = tuple(f"{name}_u" for name in PLACES)
KNOWN = ("path", "scene", POSITION, *ANSWERS, *PLACES, *_U)
TEMPLATE_COLUMNS = (
    "path", "scene", "bob_mass_kg", "bob_mass_kg_u", "spring_mass_kg", "spring_mass_kg_u", "disc_diameter_m",
    "disc_diameter_m_u", "air_temperature_c", "group", "section", "spring", "disc",
)  # fmt: skip
Values = Mapping[str, Any]
_UNIT = re.compile(r"_(kg|g|m|mm|cm|s|hz|c|pa|n_per_m|per_s)(_u)?$")
_TAG = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True, slots=True)
class RunsTable:
    """A table of runs: its file, the columns that are tags, and for each row line, path or pattern, and values.

    Values are by column, those of a quantity with its standard uncertainty.
    """

    path: Path
    tags: tuple[str, ...]
    rows: tuple[tuple[int, str, Values], ...]

    def files(self) -> list[str]:
        """Return the files named without a pattern; relative paths start from the table's folder."""
        named = [os.path.join(self.path.parent, text) for _, text, _ in self.rows if not self.is_pattern(text)]
        return list(dict.fromkeys(named))

    def is_pattern(self, text: str) -> bool:
        """Return whether a row's path is a pattern rather than the name of a file such as ``run [1].txt``."""
        return any(mark in text for mark in "*?[") and not os.path.exists(self.whole(text))

    def whole(self, text: str) -> str:
        """Return the absolute path of a row."""
        return os.path.abspath(os.path.join(self.path.parent, text))

    def pattern(self, text: str) -> str:
        """Return the pattern that a row means: a name without a slash, or else a whole path.

        Signs of a pattern in the name of the table's own folder stand for themselves.
        """
        if "/" not in text:
            return text
        return os.path.normpath(os.path.join(glob.escape(os.path.abspath(self.path.parent)), text))


def empty_table(paths: Sequence[str]) -> str:
    """Return a ``runs.csv`` to fill in, with one row per path.

    >>> empty_table(["#1.txt"]).splitlines()[1]
    './#1.txt,,,,,,,,,,,,'
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(TEMPLATE_COLUMNS)
    # A row that begins with # is a remark.
    named = [f"./{path}" if path.startswith("#") else path for path in paths]
    writer.writerows([path, *[""] * (len(TEMPLATE_COLUMNS) - 1)] for path in named)
    return out.getvalue()


def read_table(path: str | Path) -> RunsTable:
    """Read a table of runs; errors name row, column and value."""
    path = Path(path)
    names, rows = read_rows(path, "table of runs")
    tags = _tags(path, names)
    for row in rows:
        if "path" not in row.cells:
            raise ProgramError(f"{row.where}: the path of the run is missing", "fill it in")
    return RunsTable(path, tags, tuple((row.line, row.cells["path"], _values(path.parent, row)) for row in rows))


def _tags(path: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return the tags among the column names; refuse unknown or repeated columns."""
    if "path" not in names:
        raise ProgramError(f"{path}: no column path, got {', '.join(names)}", "see batch --template")
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ProgramError(f"{path}: the column {twice[0]} is there twice", "leave one out")
    tags = tuple(name for name in names if name not in KNOWN)
    for name in tags:
        near = get_close_matches(name, KNOWN, n=1, cutoff=0.85)
        if near or _UNIT.search(name):
            hint = f"did you mean {near[0]}?" if near else f"allowed with a unit are {', '.join(PLACES)}"
            raise ProgramError(f"{path}: unknown column {name!r}", hint)
        if name in RESERVED:
            raise ProgramError(f"{path}: {name!r} is a column of the results", "rename the column")
        if not _TAG.fullmatch(name):
            raise ProgramError(f"{path}: a tag has lower-case letters, digits and _, got {name!r}", "rename it")
    return tags


def _values(folder: Path, row: Row) -> Values:
    texts = row.cells
    values: dict[str, Any] = {name: text for name, text in texts.items() if name != "path" and name not in _U}
    numeric = [name for name, each in READ_FIELDS.items() if each.metadata["kind"] is ValueKind.POSITIVE]
    values |= {name: row.number(name) for name in (*numeric, *OF_ANALYSIS) if name in texts}
    values |= {name: os.path.join(folder, texts[name]) for name in ("scene", "velocity") if name in texts}
    for name in PLACES:
        if name in texts:
            try:
                read = typed(row.plain(name), BENCH_KEYS[PLACES[name]].unit)
            except ValueError as error:
                raise ProgramError(f"{row.where}: {name} {error}, got {texts[name]!r}", "correct the table") from error
            values[name] = (read.value, row.number(f"{name}_u") if f"{name}_u" in texts else read.u)
        elif f"{name}_u" in texts:
            raise ProgramError(f"{row.where}: {name}_u is there without {name}", "fill in both")
    if (law := texts.get(LAW)) not in (None, ANY_LAW, *law_names()):
        laws = ", ".join((*law_names(), ANY_LAW))
        raise ProgramError(f"{row.where}: {LAW} must be one of {laws}, got {law!r}")
    return values


def join(table: RunsTable, files: Sequence[InputFile]) -> tuple[list[tuple[InputFile, int, Values]], list[str]]:
    """Return each file with line and values from the table; a note for each row without file and file without row.

    A file has one run for each row that names its path with a different ``run`` or ``channel``. A row with a path
    takes precedence over a row with a pattern; other rows that contradict each other are refused.
    """
    exact: dict[str, list[tuple[int, Values]]] = {}
    patterns: list[tuple[int, str, Values]] = []
    for line, text, values in table.rows:
        if table.is_pattern(text):
            patterns.append((line, table.pattern(text), values))
        else:
            exact.setdefault(table.whole(text), []).append((line, values))
    used: set[int] = set()
    joined: list[tuple[InputFile, int, Values]] = []
    notes = []
    for file in files:
        path, first = os.path.abspath(file.path), 0
        base: Values = {}
        for line, text, values in patterns:
            # A pattern without a slash is compared only with the file name.
            if not fnmatchcase(path if "/" in text else os.path.basename(path), text):
                continue
            if clash := sorted(x for x in base.keys() & values.keys() if base[x] != values[x]):
                wrong = f"lines {first} and {line} both match {file.path} and differ in {clash[0]}"
                raise ProgramError(f"{table.path}: {wrong}", "narrow one of the patterns")
            base, first = {**base, **values}, first or line
            used.add(line)
        lines: dict[tuple[Any, Any], int] = {}
        for line, values in exact.get(path, []):
            which = (values.get("run"), values.get("channel"))
            if which in lines:
                wrong = f"lines {lines[which]} and {line} both name {file.path}"
                raise ProgramError(f"{table.path}: {wrong}", "leave one out, or give each another run or channel")
            lines[which] = line
            joined.append((file, line, {**base, **values}))
        used |= set(lines.values())
        if not lines:
            joined.append((file, first, base))
        if not lines and not first:
            notes.append(f"{table.path}: no row belongs to {file.path}")
    unused = [f"line {line}: {text}" for line, text, _ in table.rows if line not in used]
    return joined, [*(f"{table.path}, {row}: no file of the inputs belongs to this row" for row in unused), *notes]
