"""From inputs to jobs: which runs there are, what is known of each, what has to be done again, and whose part it is."""

from __future__ import annotations

import functools
import glob
import hashlib
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

from acquisition.recordings.base import dialect_folder
from acquisition.regular_file import open_regular_text, read_regular
from pipeline.bench.scene import PLACES, Scene
from pipeline.errors import SceneError
from springmass.batch.course import POSITION, Said, join, read_course
from springmass.batch.rows import dumped
from springmass.errors import UNREADABLE, USAGE, ProgramError
from springmass.layout import PACKAGES, part
from springmass.runs.analysing import numbered
from springmass.runs.inputs import Found, files_of
from springmass.runs.scenes import read_scene

__all__ = ["Job", "Plan", "code_sha256", "job_of", "names_of", "plan", "shard_of"]

_GLOB = "*?["
_LIBRARIES = ("numpy", "scipy", "uncertainties")


@dataclass(frozen=True, slots=True)
class Job:
    """One run to analyse.

    Parameters
    ----------
    path : str
        As the inputs name it.
    folder : str
        Where relative paths begin: the folder in which the plan was made.
    answers : mapping
        What the recording leaves open, as :func:`springmass.runs.loading.load` takes it.
    scene : mapping or None
        Tables of what was given for this run; None: what the recording carries.
    tags : mapping of str to str
    accuracy : str
    """

    path: str
    folder: str
    answers: Mapping[str, Any]
    scene: Mapping[str, Any] | None
    tags: Mapping[str, str]
    accuracy: str

    @property
    def key(self) -> str:
        """What tells this run from others: its path, and which run and channel of the file."""
        which = [self.answers.get(name) for name in ("run", "channel")]
        return dumped([self.path, *which]) if any(which) else self.path

    @property
    def scene_sha256(self) -> str:
        """Digest of the scene that was given; empty where none was."""
        return "" if self.scene is None else _digest(self.scene)

    @property
    def parameters_sha256(self) -> str:
        """Digest of accuracy and answers."""
        return _digest({"accuracy": self.accuracy, "answers": self.answers})

    def told(self) -> dict[str, Any]:
        """Return what a row keeps of it, to analyse the run again: all but the folder, which may be another."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "folder"}

    def whole(self, path: str) -> str:
        """Return a path as any process finds it."""
        return os.path.join(self.folder, path)


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be done.

    Parameters
    ----------
    jobs : tuple of Job
        By path.
    tags : tuple of str
        The course's own columns.
    said : tuple of str
        What is to be said before work begins.
    """

    jobs: tuple[Job, ...]
    tags: tuple[str, ...]
    said: tuple[str, ...]


def plan(
    inputs: Sequence[str],
    *,
    runs_csv: str | None = None,
    scene: str | None = None,
    accuracy: str = "standard",
    answers: Mapping[str, Any] | None = None,
    known: Collection[str] = (),
    but: Collection[str] = (),
) -> Plan:
    """Find the runs of a course and what is known of each.

    Parameters
    ----------
    inputs : sequence of str
        Files, folders with all in them, patterns, and lists: ``@FILE`` names one with a path a line. None: what the
        table of runs names.
    runs_csv : str, optional
        Table of runs, see :func:`springmass.batch.course.read_course`.
    scene : str, optional
        Scene file for all runs, under what the table says.
    accuracy : str
    answers : mapping, optional
        For all runs, under what the table says.
    known : collection of str
        Paths that are recordings, as an earlier pass saw.
    but : collection of str
        Absolute paths of files and folders in the inputs that are none of them.

    Raises
    ------
    ProgramError
        With exit code 2 or 3; one line.
    """
    course = None if runs_csv is None else read_course(runs_csv)
    out = {*but, *(() if runs_csv is None else (os.path.abspath(runs_csv),))}
    texts = list(_expanded(inputs)) if inputs or course is None else course.files()
    found, said = files_of(texts, deep=True, known=known, but=out)
    first: dict[str, Found] = {}
    for one in found:  # a file that several inputs name is one run
        first.setdefault(os.path.abspath(one.path), one)
    files = sorted(first.values(), key=lambda one: one.path)
    if course is None:
        tags: tuple[str, ...] = ()
        joined = [(one, Said()) for one in files]
    else:
        joined, unused, without = join(course, files)
        tags = course.tags
        said += [f"{course.path}, {row}: no file of the inputs belongs to this row" for row in unused]
        said += [f"{course.path}: no row belongs to {path}" for path in without]
        if tags:
            said.append(f"{course.path}: tags: {', '.join(tags)}")
    shared = None if scene is None else read_scene(scene)
    jobs = tuple(_job(one, row, shared, accuracy, answers or {}, str(runs_csv)) for one, row in joined)
    return Plan(jobs, tags, tuple(said))


def _expanded(inputs: Sequence[str]) -> list[str]:
    texts: list[str] = []
    for text in inputs:
        if text.startswith("@") and not os.path.exists(text):
            texts += _listed(Path(text[1:]))
        elif any(mark in text for mark in _GLOB) and not os.path.exists(text):
            matched = sorted(glob.glob(text, recursive=True))
            if not matched:
                raise ProgramError(f"{text}: a pattern of files was demanded, nothing matches it", UNREADABLE)
            texts += matched
        else:
            texts.append(text)
    return texts


def _listed(path: Path) -> list[str]:
    try:
        with open_regular_text(path, "utf-8-sig") as file:
            lines = file.read().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ProgramError(f"{path}: a list of paths, one a line, was demanded, got {error}", USAGE) from error
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def _job(one: Found, row: Said, shared: Scene | None, accuracy: str, answers: Mapping[str, Any], where: str) -> Job:
    given = read_scene(row.scene_file) if row.scene_file else shared
    tables = {} if given is None else given.to_mapping()
    for name, value in row.scene.items():
        table, key = ("sensor", "position") if name == POSITION else PLACES[name]
        number = value if name == POSITION else {"value": value[0], "u": value[1]} if value[1] else value[0]
        tables.setdefault(table, {})[key] = number
    try:
        scene = Scene.from_mapping(tables, where=f"{where}, line {row.line}") if tables else None
    except SceneError as error:
        raise ProgramError(str(error), USAGE) from error
    told = {name: value for name, value in answers.items() if value not in (None, False)}
    if one.velocity is not None:
        told["velocity"] = one.velocity
    return Job(
        one.path,
        os.getcwd(),
        {**told, **row.answers},
        None if scene is None else scene.to_mapping(),
        dict(row.tags),
        accuracy,
    )


def shard_of(jobs: Sequence[Job], shard: tuple[int, int] | None) -> list[Job]:
    """Return the jobs of a shard (i, n), 1 <= i <= n: every n-th, so that shards of unlike folders are alike."""
    return list(jobs) if shard is None else list(jobs[shard[0] - 1 :: shard[1]])


def names_of(jobs: Sequence[Job]) -> list[str]:
    """Return a name for each run: its path below the folder that holds all, without suffix; later ones numbered.

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
    """Digest of what a row depends on beside its run: this program, its libraries' versions, the user's dialects."""
    # In a wheel the packages are elsewhere; a folder that does not exist would leave old rows "unchanged" in silence.
    rooms = [*map(part, PACKAGES), *(Path(__file__).resolve().parents[1] / room for room in ("batch", "runs"))]
    parts = [f"{name} {version(name)}".encode() for name in _LIBRARIES]
    files = [file for room in rooms for file in sorted(room.rglob("*.py"))]
    if (dialects := dialect_folder()).is_dir():
        files += sorted(dialects.glob("*.toml"))
    parts += [read_regular(file) for file in files]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def job_of(job: Mapping[str, Any], folder: str) -> Job:
    """Return the job that a row kept, seen from a folder."""
    return Job(**job, folder=folder)


def _digest(value: object) -> str:
    return hashlib.sha256(dumped(value).encode("utf-8", "backslashreplace")).hexdigest()
