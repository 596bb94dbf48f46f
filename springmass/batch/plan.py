"""Turn inputs into jobs: find the runs and the known values of each."""

from __future__ import annotations

import functools
import glob
import hashlib
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from acquisition.recordings.base import dialect_folder
from acquisition.regular_file import open_regular_text, read_regular
from pipeline.bench.scene import PLACES, Scene
from pipeline.errors import SceneError
from springmass.batch.course import POSITION, Entry, join, read_course
from springmass.batch.rows import dumped
from springmass.errors import UNREADABLE, USAGE, ProgramError
from springmass.layout import PACKAGES, part
from springmass.runs.inputs import InputFile, files_of
from springmass.runs.outputs import numbered
from springmass.runs.scenes import read_scene

__all__ = ["Job", "Plan", "code_sha256", "names_of", "plan"]

_GLOB = "*?["
_LIBRARIES = ("numpy", "scipy", "uncertainties")


@dataclass(frozen=True, slots=True)
class Job:
    """One run to analyse.

    Parameters
    ----------
    path : str
        Path as given in the inputs.
    folder : str
        Start of relative paths: the folder in which the plan was made.
    answers : mapping
        Answers to what the recording leaves open: reading options of :class:`springmass.runs.options.ReadOptions`.
    scene : mapping or None
        Scene given for this run, by table and key; None: the scene that the recording carries.
    tags : mapping of str to str
    accuracy : str
    law : str or None
        Stated damping law, in the form that :func:`springmass.runs.analysing.with_law` takes.
    """

    path: str
    folder: str
    answers: Mapping[str, Any]
    scene: Mapping[str, Any] | None
    tags: Mapping[str, str]
    accuracy: str
    law: str | None = None

    @property
    def key(self) -> str:
        """Key that distinguishes this run from others: its path, and the run and channel within the file."""
        which = [self.answers.get(name) for name in ("run", "channel")]
        return dumped([self.path, *which]) if any(which) else self.path

    @property
    def scene_sha256(self) -> str:
        """Digest of the given scene; empty if none was given."""
        return "" if self.scene is None else _digest(self.scene)

    @property
    def parameters_sha256(self) -> str:
        """Digest of accuracy, answers and stated law."""
        return _digest({"accuracy": self.accuracy, "answers": self.answers, "law": self.law})

    def to_mapping(self) -> dict[str, Any]:
        """Return the job as stored in a row for a later analysis: everything except the folder, which may change."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "folder"}

    @classmethod
    def from_mapping(cls, job: Mapping[str, Any], folder: str) -> Job:
        """Return the job stored in a row; its relative paths start from the folder."""
        return cls(**job, folder=folder)

    def whole(self, path: str) -> str:
        """Return a path that every process can find."""
        return os.path.join(self.folder, path)


@dataclass(frozen=True, slots=True)
class Plan:
    """The jobs of a course.

    Parameters
    ----------
    jobs : tuple of Job
        Jobs sorted by path.
    tags : tuple of str
        The course's own columns.
    notes : tuple of str
        Messages for the user before the work begins, one line each.
    """

    jobs: tuple[Job, ...]
    tags: tuple[str, ...]
    notes: tuple[str, ...]


def plan(
    inputs: Sequence[str],
    *,
    runs_csv: str | None = None,
    scene: str | None = None,
    accuracy: str = "standard",
    law: str | None = None,
    answers: Mapping[str, Any] | None = None,
    known: Collection[str] = (),
    but: Collection[str] = (),
) -> Plan:
    """Find the runs of a course and the known values of each.

    Parameters
    ----------
    inputs : sequence of str
        Files, folders with all their contents, patterns, and lists: ``@FILE`` names a file with one path per line. If
        there are no inputs, the files that the table of runs names are used.
    runs_csv : str, optional
        Table of runs, see :func:`springmass.batch.course.read_course`.
    scene : str, optional
        Scene file for all runs; values in the table take precedence.
    accuracy : str
    law : str, optional
        Damping law of all runs; the table takes precedence.
    answers : mapping, optional
        Reading options for all runs; the table takes precedence.
    known : collection of str
        Paths that an earlier pass identified as recordings.
    but : collection of str
        Absolute paths of files and folders to leave out.

    Raises
    ------
    ProgramError
        With exit code 2 or 3 and a message of one line.
    """
    course = None if runs_csv is None else read_course(runs_csv)
    out = {*but, *(() if runs_csv is None else (os.path.abspath(runs_csv),))}
    texts = list(_expanded(inputs)) if inputs or course is None else course.files()
    # A file that the table names is a run even if it cannot be read.
    named = {os.path.abspath(path) for path in (*known, *(() if course is None else course.files()))}
    recordings, notes = files_of(texts, deep=True, known=named, but=out)
    first: dict[str, InputFile] = {}
    for recording in recordings:  # a file named by several inputs is one run
        first.setdefault(os.path.abspath(recording.path), recording)
    files = sorted(first.values(), key=lambda recording: recording.path)
    if course is None:
        tags: tuple[str, ...] = ()
        joined = [(recording, Entry()) for recording in files]
    else:
        joined, unused, without = join(course, files)
        tags = course.tags
        notes += [f"{course.path}, {row}: no file of the inputs belongs to this row" for row in unused]
        notes += [f"{course.path}: no row belongs to {path}" for path in without]
        if tags:
            notes.append(f"{course.path}: tags: {', '.join(tags)}")
    shared = None if scene is None else read_scene(scene)
    if shared is not None and shared.damping_law is not None and law is None:
        notes.insert(0, f"damping law {shared.damping_law}: stated in {scene}")
    jobs = tuple(
        replace(_job(file, entry, shared, accuracy, answers or {}, str(runs_csv)), law=entry.law or law)
        for file, entry in joined
    )
    return Plan(jobs, tags, tuple(notes))


def _expanded(inputs: Sequence[str]) -> list[str]:
    texts: list[str] = []
    for text in inputs:
        if text.startswith("@") and not os.path.exists(text):
            texts += _listed(Path(text[1:]))
        elif any(mark in text for mark in _GLOB) and not os.path.exists(text):
            matched = sorted(glob.glob(text, recursive=True))
            if not matched:
                raise ProgramError(f"{text}: no file matches this pattern", UNREADABLE)
            texts += matched
        else:
            texts.append(text)
    return texts


def _listed(path: Path) -> list[str]:
    try:
        with open_regular_text(path, "utf-8-sig") as file:
            lines = file.read().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ProgramError(f"{path}: expected a list of paths, one a line ({error})", USAGE) from error
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def _job(
    file: InputFile, entry: Entry, shared: Scene | None, accuracy: str, answers: Mapping[str, Any], where: str
) -> Job:
    given = read_scene(entry.scene_file) if entry.scene_file else shared
    tables = {} if given is None else given.to_mapping()
    for name, value in entry.scene.items():
        table, key = ("sensor", "position") if name == POSITION else PLACES[name]
        number = value if name == POSITION else {"value": value[0], "u": value[1]} if value[1] else value[0]
        tables.setdefault(table, {})[key] = number
    try:
        scene = Scene.from_mapping(tables, where=f"{where}, line {entry.line}") if tables else None
    except SceneError as error:
        raise ProgramError(str(error), USAGE) from error
    known = {name: value for name, value in answers.items() if value not in (None, False)}
    if file.velocity is not None:
        known["velocity"] = file.velocity
    return Job(
        file.path,
        os.getcwd(),
        {**known, **entry.answers},
        None if scene is None else scene.to_mapping(),
        dict(entry.tags),
        accuracy,
    )


def names_of(jobs: Sequence[Job]) -> list[str]:
    """Return a name per run: its path below the common folder, without suffix, with repeated names numbered.

    Examples
    --------
    >>> jobs = [Job(path, "/", {}, None, {}, "fast") for path in ("c/a/1.txt", "c/b/1.txt", "c/b/1.csv")]
    >>> names_of(jobs)
    ['a/1', 'b/1', 'b/1-2']
    """
    if not jobs:
        return []
    whole = [os.path.abspath(job.whole(job.path)) for job in jobs]
    above = os.path.commonpath([os.path.dirname(path) for path in whole])
    return numbered([os.path.splitext(os.path.relpath(path, above))[0].replace(os.sep, "/") for path in whole])


@functools.cache
def code_sha256() -> str:
    """Return the digest of a row's dependencies except its run: program, library versions and the user's dialects."""
    # In a wheel the packages are in another place; without ``part``, rows of an older program would count as unchanged.
    rooms = [*map(part, PACKAGES), *(Path(__file__).resolve().parents[1] / room for room in ("batch", "runs"))]
    parts = [f"{name} {version(name)}".encode() for name in _LIBRARIES]
    files = [file for room in rooms for file in sorted(room.rglob("*.py"))]
    if (dialects := dialect_folder()).is_dir():
        files += sorted(dialects.glob("*.toml"))
    parts += [read_regular(file) for file in files]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def _digest(value: object) -> str:
    return hashlib.sha256(dumped(value).encode("utf-8", "backslashreplace")).hexdigest()
