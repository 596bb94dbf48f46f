"""Scenes from files or given in Python: masses, disc, air and sensor of the bench; and values that replace some."""

import codecs
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from acquisition.errors import visible
from acquisition.regular_file import open_regular
from pipeline.bench.plausible import slips
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from springmass.errors import LOG, ProgramError

Amendments = Mapping[tuple[str, str], Any]
"""Mapping of a scene's (table, key) to a value as a scene file states it."""
LONGEST_SCENE = 1 << 14
"""Maximum size of a file of a scene or of notes in bytes, for reading and for writing.

The time and the memory that Python's parser of TOML takes grow with the square of the longest dotted key: one key of
this size takes 3 s, one four times as long takes a minute and gigabytes.
"""


def read_scenes(paths: Sequence[str | Path], count: int) -> list[Scene | None]:
    """Return one scene per run, read from one file for all runs or one file for each in order; None without a file."""
    if len(paths) not in (0, 1, count):
        raise ProgramError(
            f"--scene was given {len(paths)} times for {count} runs",
            "give it once for all of them, or once for each in their order",
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
        raise ProgramError(demand, "name a file")
    return read_scene(Path(given))


def read_tables(path: str | Path) -> dict[str, Any]:
    """Read a small TOML file of a scene or of notes."""
    try:
        with open_regular(path) as file:
            content = file.read(LONGEST_SCENE + 1) or b""
    except OSError as error:
        raise ProgramError(f"{path}: cannot read the scene file ({error.strerror})", "check the name") from error
    if len(content) > LONGEST_SCENE:
        raise ProgramError(
            f"{path}: expected a scene file of at most {LONGEST_SCENE} bytes, got a longer one",
            "name the scene, not the recording",
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
            demand = f"{path}: {unfilled[1]} has no number yet"
            raise ProgramError(demand, "put yours for the dots, or # before the line") from error
        reason = " ".join(str(error).split())
        raise ProgramError(f"{path}: not a TOML file ({reason})", "see the scene file in the reference") from error


def amended(scene: Scene, values: Amendments) -> Scene:
    """Return a scene with some values replaced by those of the command line."""
    tables = scene.to_mapping()
    for (table, key), value in values.items():
        tables.setdefault(table, {})[key] = value
    try:
        return Scene.from_mapping(tables, where="the command line")
    except SceneError as error:
        raise ProgramError(error.problem, error.remedy, where=error.where) from error


def stated_keys(scene: Scene) -> str:
    """Return the tables and keys that a scene states, as text."""
    return ", ".join(f"[{table}] {key}" for table, keys in scene.to_mapping().items() for key in keys) or "nothing"


def ask_about(scene: Scene, where: str | Path) -> None:
    """Ask on stderr about every implausible value of a scene.

    This is for recordings and simulations, where no finding reports such values.
    """
    for slip in slips(scene):
        LOG.warning(f"{where}: {slip.clause}; check value and unit")
