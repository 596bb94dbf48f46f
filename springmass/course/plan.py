"""Turn inputs into jobs: find the runs and the known values of each, and what its row depends on."""

from __future__ import annotations

import functools
import glob
import hashlib
import json
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from acquisition.recordings.base import dialect_folder
from acquisition.regular_file import open_regular, read_regular
from pipeline.bench.scene import PLACES, Scene
from springmass.course.runs_csv import ANSWERS, POSITION, Values, join, read_table
from springmass.errors import UNREADABLE, ProgramError
from springmass.layout import PACKAGES, part
from springmass.runs.analysing import Task
from springmass.runs.inputs import InputFile, files_of
from springmass.runs.options import HOW, How
from springmass.runs.outputs import numbered
from springmass.runs.scenes import about_path, read_scene

_LIBRARIES = ("numpy", "scipy", "uncertainties")
_CODE = (".py", ".toml", ".j2", ".css", ".js")


@dataclass(frozen=True, slots=True)
class Job:
    """One run to analyse: its path as the inputs name it, the given options by name, the given scene, and its tags.

    Relative paths start from ``folder``.
    """

    path: str
    folder: str
    how: Mapping[str, Any]
    scene: Scene | None
    tags: Mapping[str, str]

    @property
    def key(self) -> str:
        """What distinguishes this run from others: its path, and the run and channel within the file."""
        return json.dumps([self.path, self.how.get("run"), self.how.get("channel")])

    def digests(self) -> dict[str, str]:
        """Return the digests of the given scene, empty if there is none, and of the options."""
        scene = "" if self.scene is None else _digest(self.scene.to_mapping())
        return {"scene_sha256": scene, "parameters_sha256": _digest(self.how)}

    def made_of(self) -> str:
        """Return a digest of all on which the run's row and report depend; this reads the files."""
        files = (self.path, self.how.get("velocity"), str(about_path(Path(self.path))))
        read = [digest_of(self.whole(path)) if path else "" for path in files]
        return _digest([*read, self.digests(), code_sha256()])

    def task(self) -> Task:
        """Return what every process can analyse."""
        how = How.of(self.how)
        if how.velocity is not None:
            how = replace(how, velocity=self.whole(str(how.velocity)))
        return Task(self.whole(self.path), self.path, self.scene, how)

    def whole(self, path: str) -> str:
        """Return a path that every process can find."""
        return os.path.join(self.folder, path)


@dataclass(frozen=True, slots=True)
class Plan:
    """The jobs of a course sorted by path, the course's own columns, and lines for the user."""

    jobs: tuple[Job, ...]
    tags: tuple[str, ...]
    notes: tuple[str, ...]


def plan(
    inputs: Sequence[str],
    *,
    runs_csv: str | None = None,
    scene: str | None = None,
    how: How = HOW,
    known: Collection[str] = (),
    output: str | None = None,
) -> Plan:
    """Find the runs of a course and the known values of each.

    Inputs are files, folders with all their contents, and patterns; without inputs, the files that the table of runs
    names. Scene and options are for all runs, and the table takes precedence. ``known`` are paths that an earlier pass
    identified as recordings, ``output`` is left out.
    """
    table = None if runs_csv is None else read_table(runs_csv)
    out = {os.path.abspath(path) for path in (output, runs_csv) if path is not None}
    texts = list(_expanded(inputs)) if inputs or table is None else table.files()
    # A file that the table names is a run even if it cannot be read.
    named = {os.path.abspath(path) for path in (*known, *(() if table is None else table.files()))}
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
    jobs = []
    for file, line, values in joined:
        velocity = {} if file.velocity is None else {"velocity": file.velocity}
        stated = how.given() | velocity | {name: values[name] for name in ANSWERS if name in values}
        of_run = _scene(values, shared, f"{runs_csv}, line {line}")
        of_tags = {name: values[name] for name in tags if name in values}
        jobs.append(Job(file.path, os.getcwd(), stated, of_run, of_tags))
    return Plan(tuple(jobs), tags, tuple(notes))


def _expanded(inputs: Sequence[str]) -> list[str]:
    texts: list[str] = []
    for text in inputs:
        if any(mark in text for mark in "*?[") and not os.path.exists(text):
            matched = sorted(glob.glob(text, recursive=True))
            if not matched:
                raise ProgramError(f"{text}: no file matches this pattern", UNREADABLE)
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


def names_of(jobs: Sequence[Job]) -> list[str]:
    """Return a name per run: its path below the common folder, without suffix, with repeated names numbered."""
    if not jobs:
        return []
    whole = [os.path.abspath(job.whole(job.path)) for job in jobs]
    above = os.path.commonpath([os.path.dirname(path) for path in whole])
    return numbered([os.path.splitext(os.path.relpath(path, above))[0].replace(os.sep, "/") for path in whole])


@functools.cache
def code_sha256() -> str:
    """Return the digest of the program, the versions of its libraries and the user's dialects."""
    # In a wheel the packages are in another place; without ``part``, rows of an older program would count as unchanged.
    rooms = [*map(part, PACKAGES), Path(__file__).resolve().parents[1]]
    files = [file for room in rooms for file in sorted(room.rglob("*")) if file.suffix in _CODE]
    if (dialects := dialect_folder()).is_dir():
        files += sorted(dialects.glob("*.toml"))
    versions = [f"{name} {version(name)}".encode() for name in _LIBRARIES]
    return hashlib.sha256(b"\0".join([*versions, *map(read_regular, files)])).hexdigest()


def digest_of(path: str) -> str:
    """Return the SHA-256 of a file in hexadecimal digits; empty if it cannot be read."""
    try:
        with open_regular(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""


def _digest(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
