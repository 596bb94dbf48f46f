"""Notes on a recording, also those made on the page: saved next to it in ``NAME.about.toml``, with scene and marks.

Recordings and run files are never changed; the notes, in ``bob.about.toml`` or ``bob.txt.about.toml``, may be. Every
command that reads the recording uses them and reports that it does. The page saves its notes here too. How the file is
read stands in ``[reading]``, only below the whole name, since ``bob.h5``, ``bob.wire`` and ``bob.txt`` share a stem.
"""

from __future__ import annotations

import glob
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomli_w

from acquisition.recordings.reading import READ_DEFAULTS, ReadOptions, value_of
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from springmass.errors import ProgramError
from springmass.loading.inputs import RUN_SUFFIXES, is_recording
from springmass.loading.scenes import LONGEST_SCENE, read_tables
from springmass.typeset import count
from storage.atomic import write_whole

STEM_SUFFIXES = (*RUN_SUFFIXES, ".wire")
"""Suffixes of run files and logs: the stem names their recording."""


@dataclass(frozen=True, slots=True)
class About:
    """The notes next to a recording, whose file may not exist; marks are times in the record, s, with their texts.

    ``reading`` is the table that says how the file is read, as it is written.
    """

    path: Path
    scene: Scene | None = None
    notes: tuple[str, ...] = ()
    marks: tuple[tuple[float, str], ...] = ()
    reading: Mapping[str, Any] = field(default_factory=dict)

    def with_more(self, scene: Scene | None, notes: Sequence[str], marks: Sequence[tuple[float, str]]) -> About:
        """Return the notes with the given scene, if any, and with additional notes and marks."""
        together = tuple(sorted({*self.marks, *marks}))
        return replace(self, scene=scene or self.scene, notes=(*self.notes, *notes), marks=together)

    def described(self, *, scene: bool = True) -> str:
        """Return a summary of the notes in words, with or without their scene; empty if there are none."""
        parts = ["its scene"] if scene and self.scene is not None else []
        parts += [count(len(self.notes), "note")] if self.notes else []
        parts += [count(len(self.marks), "mark")] if self.marks else []
        return ", ".join(parts)


def about_path(recording: Path) -> Path:
    """Return the path of the notes on a recording, whether the file exists or not.

    A text has them under its whole name, because ``bob.txt`` and ``bob.csv`` are two recordings. Notes under the stem,
    as earlier versions wrote them, are those of a text if no other recording has that stem.
    """
    by_stem = recording.with_name(f"{recording.stem}.about.toml")
    by_name = recording.with_name(f"{recording.name}.about.toml")
    if recording.suffix.lower() in STEM_SUFFIXES:
        return by_stem
    others = recording.parent.glob(f"{glob.escape(recording.stem)}.*")
    namesakes = (each for each in others if each.stem == recording.stem and each.name != recording.name)
    # Path.exists would raise for a name that is too long.
    alone = os.path.exists(by_stem) and not any(each.is_file() and is_recording(each) for each in namesakes)
    return by_stem if alone and not os.path.exists(by_name) else by_name


def about_of(recording: Path) -> About:
    """Read the notes next to a recording; they are empty if there is no such file."""
    path = about_path(recording)
    if not os.path.exists(path):
        return About(path)
    tables = read_tables(path)
    allowed = ("scene", "notes", "marks", *(("reading",) if path == _answers_path(recording) else ()))
    if unknown := sorted(set(tables) - set(allowed)):
        raise ProgramError(f"{path}: unknown key {unknown[0]!r}", f"allowed are {', '.join(allowed)}")
    try:
        scene = Scene.from_mapping(tables["scene"], where=f"{path} [scene]") if "scene" in tables else None
        marks = tuple((float(mark["t_s"]), str(mark["text"])) for mark in tables.get("marks", ()))
        notes = tuple(str(note) for note in tables.get("notes", ()))
    except SceneError as error:
        raise ProgramError(error.problem, error.remedy, where=error.where) from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        demand = "notes are a list of texts, marks are [[marks]] with t_s and text"
        raise ProgramError(f"{path}: {demand}", "mend or remove the file") from error
    return About(path, scene, notes, marks, tables.get("reading", {}))


def write_about(about: About) -> Path:
    """Write the notes atomically, replacing any earlier file, and return their path.

    Notes that :func:`about_of` would refuse are not written, because they would lock their recording out.
    """
    tables: dict[str, Any] = {"notes": list(about.notes)} if about.notes else {}
    if about.scene is not None and (scene := about.scene.to_mapping()):
        tables["scene"] = scene
    if about.reading:
        tables["reading"] = dict(about.reading)
    if about.marks:
        tables["marks"] = [{"t_s": t_s, "text": text} for t_s, text in about.marks]
    try:
        content = tomli_w.dumps(tables).encode()
    except UnicodeEncodeError as error:
        raise ProgramError(f"{about.path}: a note is not text in UTF-8", "write it in other letters") from error
    if len(content) > LONGEST_SCENE:
        demand = f"all notes together take at most {LONGEST_SCENE} bytes, got {len(content)}"
        raise ProgramError(f"{about.path}: {demand}", "shorten the new note, or keep long notes in a file of your own")
    return write_whole(about.path, content, overwrite=True)


@dataclass(frozen=True, slots=True)
class KeptAnswers:
    """How a file is read, as the notes next to it say, and the digest of the file for which this was stated."""

    path: Path
    reading: ReadOptions = READ_DEFAULTS
    sha256: str = ""

    def beside(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the kept answers that given ones leave in force.

        A unit belongs to its channel, and that of the times to their column, so another one takes the unit with it.
        """
        kept = self.reading.given()
        for name, unit in (("channel", "unit"), ("time", "time_unit")):
            if name in given and given[name] != kept.get(name):
                kept.pop(unit, None)
        return {name: value for name, value in kept.items() if name not in given}


def _answers_path(recording: Path) -> Path:
    return recording.with_name(f"{recording.name}.about.toml")


def notes_paths(recording: Path) -> tuple[Path, ...]:
    """Return the paths of all notes on a recording, whether the files exist or not."""
    return tuple(dict.fromkeys((about_path(recording), _answers_path(recording))))


def answers_of(recording: Path) -> KeptAnswers:
    """Read how a file is read from the notes next to it; nothing is stated if there are none."""
    path = _answers_path(recording)
    table = dict(read_tables(path).get("reading", {})) if os.path.exists(path) else {}
    sha256 = str(table.pop("sha256", ""))
    try:
        answers = {name: value_of(name, value) for name, value in table.items()}
    except ValueError as error:
        raise ProgramError(f"{path}: [reading]: {error}", "mend or remove the line") from error
    if "velocity" in answers:
        answers["velocity"] = os.path.join(path.parent, str(answers["velocity"]))
    return KeptAnswers(path, ReadOptions.of(answers), sha256)


def keep_answers(recording: Path, given: Mapping[str, Any], sha256: str) -> Path:
    """Add to the notes how a file is read, with the digest of the file, and return the path of the notes."""
    kept = answers_of(recording)
    answers = kept.beside(given) | dict(given)
    if "velocity" in answers:
        answers["velocity"] = os.path.relpath(answers["velocity"], kept.path.parent)
    by_stem = recording.suffix.lower() in STEM_SUFFIXES
    about = About(kept.path) if by_stem else replace(about_of(recording), path=kept.path)
    return write_about(replace(about, reading={**answers, "sha256": sha256}))
