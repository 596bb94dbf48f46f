"""Scenes from files, and notes made on a recording afterwards: scene, remarks and marks.

Recordings and run files are never changed; the notes, in ``bob.about.toml`` or ``bob.txt.about.toml``, may be. Every
command that reads the recording uses them and reports that it does.
"""

from __future__ import annotations

import codecs
import glob
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w

from acquisition.errors import visible
from acquisition.regular_file import open_regular
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from springmass.errors import ProgramError, complain
from springmass.runs.inputs import is_recording
from springmass.typeset import count
from storage.atomic import write_whole

Amendments = Mapping[tuple[str, str], Any]
"""Mapping of a scene's (table, key) to a value as a scene file states it."""
LONGEST = 1 << 14
"""Maximum size of a file of a scene or of notes in bytes, for reading and for writing.

The time and the memory that Python's parser of TOML takes grow with the square of the longest dotted key: one key of
this size takes 3 s, one four times as long takes a minute and gigabytes.
"""


def read_scenes(paths: Sequence[str | Path], count: int) -> list[Scene | None]:
    """Return one scene per run, read from one file for all runs or one file for each in order; None without a file."""
    if len(paths) not in (0, 1, count):
        raise ProgramError(
            f"--scene was given {len(paths)} times for {count} runs; give it once for all of them, "
            "or once for each in their order"
        )
    scenes: list[Scene | None] = [read_scene(path) for path in paths] or [None]
    return scenes * count if len(scenes) == 1 else scenes


def read_scene(path: str | Path) -> Scene:
    """Read a scene file (TOML)."""
    return Scene.from_mapping(read_tables(path), where=str(path))


def scene_from(given: Any) -> Scene | None:
    """Return a scene given as such, as its tables, or by the path of its file; None if none was given."""
    if given is None or isinstance(given, Scene):
        return given
    if isinstance(given, Mapping):
        return Scene.from_mapping(given)
    if not isinstance(given, str | os.PathLike):
        demand = f"scene must be a Scene, a mapping of its tables or a path, got {visible(repr(given)[:80])}"
        raise ProgramError(f"{demand}; name a file")
    return read_scene(Path(given))


def read_tables(path: str | Path) -> dict[str, Any]:
    """Read a small TOML file of a scene or of notes."""
    try:
        with open_regular(path) as file:
            content = file.read(LONGEST + 1) or b""
    except OSError as error:
        raise ProgramError(f"{path}: cannot read the scene file ({error.strerror}); check the name") from error
    if len(content) > LONGEST:
        raise ProgramError(
            f"{path}: expected a scene file of at most {LONGEST} bytes, got a longer one; "
            "name the scene, not the recording"
        )
    text = ""
    try:
        # On Windows, PowerShell 5 writes `springmass scene > bench.toml` in UTF-16, and editors add a byte order mark.
        utf16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        text = content.decode("utf-16" if utf16 else "utf-8-sig")
        return tomllib.loads(text)
    # An integer of thousands of digits raises a plain ValueError; thousands of nested brackets, a RecursionError.
    except (ValueError, RecursionError) as error:
        if unfilled := re.search(r"^\s*(\w+)\s*=[^#\n]*\.\.\.", text, re.MULTILINE):
            demand = f"{unfilled[1]} has no number yet; put yours for the dots, or # before the line"
            raise ProgramError(f"{path}: {demand}") from error
        reason = " ".join(str(error).split())
        demand = f"not a TOML file ({reason}); see the scene file in the reference"
        raise ProgramError(f"{path}: {demand}") from error


def amended(scene: Scene, values: Amendments, *, where: str) -> Scene:
    """Return a scene with some values replaced."""
    tables = scene.to_mapping()
    for (table, key), value in values.items():
        tables.setdefault(table, {})[key] = value
    try:
        return Scene.from_mapping(tables, where=where)
    except SceneError as error:
        raise ProgramError(str(error)) from error


def stated_keys(scene: Scene) -> str:
    """Return the tables and keys that a scene states, as text."""
    return ", ".join(f"[{table}] {key}" for table, keys in scene.to_mapping().items() for key in keys) or "nothing"


def ask_about(scene: Scene, where: str | Path) -> None:
    """Ask on stderr about every implausible value of a scene.

    This is for recordings and simulations, where no finding reports such values.
    """
    for clause in scene.unusual():
        complain(f"{where}: {clause}; check value and unit")


RUNS = (".h5", ".hdf5", ".nxs", ".wire")
"""Suffixes of run files and logs: the stem names their recording."""


@dataclass(frozen=True, slots=True)
class About:
    """The notes next to a recording, whose file may not exist; marks are times in the record, s, with their texts."""

    path: Path
    scene: Scene | None = None
    notes: tuple[str, ...] = ()
    marks: tuple[tuple[float, str], ...] = ()

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
    if recording.suffix.lower() in RUNS:
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
    if unknown := sorted(set(tables) - {"scene", "notes", "marks"}):
        raise ProgramError(f"{path}: unknown key {unknown[0]!r}; allowed are scene, notes, marks")
    try:
        scene = Scene.from_mapping(tables["scene"], where=f"{path} [scene]") if "scene" in tables else None
        marks = tuple((float(mark["t_s"]), str(mark["text"])) for mark in tables.get("marks", ()))
        notes = tuple(str(note) for note in tables.get("notes", ()))
    except SceneError as error:
        raise ProgramError(str(error)) from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        demand = "notes are a list of texts, marks are [[marks]] with t_s and text"
        raise ProgramError(f"{path}: {demand}; mend or remove the file") from error
    return About(path, scene, notes, marks)


def write_about(about: About) -> Path:
    """Write the notes atomically, replacing any earlier file, and return their path.

    Notes that :func:`about_of` would refuse are not written, because they would lock their recording out.
    """
    tables: dict[str, Any] = {"notes": list(about.notes)} if about.notes else {}
    if about.scene is not None and (scene := about.scene.to_mapping()):
        tables["scene"] = scene
    if about.marks:
        tables["marks"] = [{"t_s": t_s, "text": text} for t_s, text in about.marks]
    try:
        content = tomli_w.dumps(tables).encode()
    except UnicodeEncodeError as error:
        raise ProgramError(f"{about.path}: a note is not text in UTF-8; write it in other letters") from error
    if len(content) > LONGEST:
        demand = f"all notes together take at most {LONGEST} bytes, got {len(content)}"
        raise ProgramError(f"{about.path}: {demand}; shorten the new note, or keep long notes in a file of your own")
    return write_whole(about.path, content, overwrite=True)
