"""Scene files: one for all runs, or one for each."""

from __future__ import annotations

import codecs
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from acquisition.regular_file import open_regular
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from springmass.errors import USAGE, ProgramError, complain

__all__ = ["Amendments", "amended", "ask_about", "read_scene", "read_scenes", "read_tables", "stated_keys"]

Amendments = Mapping[tuple[str, str], Mapping[str, float]]
"""Table and key of a scene to the value and its standard uncertainty."""
LONGEST_SCENE = 1 << 14  # bytes; of longer ones some take seconds to parse


def read_scenes(paths: Sequence[str | Path], count: int) -> list[Scene | None]:
    """Read one scene a run: one file for all of them, or one for each in their order; None without a file.

    Raises
    ------
    ProgramError
        With exit code 2 for any other number of files, or as :func:`read_scene`.
    """
    if len(paths) not in (0, 1, count):
        raise ProgramError(
            f"--scene was given {len(paths)} times for {count} runs; give it once for all of them, "
            "or once for each in their order",
            USAGE,
        )
    scenes: list[Scene | None] = [read_scene(path) for path in paths] or [None]
    return scenes * count if len(scenes) == 1 else scenes


def read_scene(path: str | Path) -> Scene:
    """Read a scene file (TOML).

    Raises
    ------
    ProgramError
        With exit code 2 if it is absent, no TOML, or says something impossible; the line names file, key and value.
    """
    return _scene_of(read_tables(path), str(path))


def read_tables(path: str | Path) -> dict[str, Any]:
    """Read a small TOML file of a scene or of notes.

    Raises
    ------
    ProgramError
        With exit code 2 if it is absent, longer than any scene, or no TOML.
    """
    try:
        with open_regular(path) as file:
            content = file.read(LONGEST_SCENE + 1) or b""
        if len(content) > LONGEST_SCENE:
            raise ProgramError(
                f"{path}: expected a scene file of at most {LONGEST_SCENE} bytes, got a longer one; "
                "name the scene, not the recording",
                USAGE,
            )
        # On Windows, PowerShell 5 writes `springmass scene > bench.toml` in UTF-16, and editors add a byte order mark.
        utf16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return tomllib.loads(content.decode("utf-16" if utf16 else "utf-8-sig"))
    except OSError as error:
        raise ProgramError(f"{path}: cannot read the scene file ({error.strerror}); check the name", USAGE) from error
    # A number of thousands of digits is a plain ValueError, brackets nested by the thousand end Python's own reader.
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        demand = f"not a TOML file ({reason}); see the scene file in the reference"
        raise ProgramError(f"{path}: {demand}", USAGE) from error


def _scene_of(tables: Any, where: str) -> Scene:
    try:
        return Scene.from_mapping(tables, where=where)
    except SceneError as error:
        raise ProgramError(str(error), USAGE) from error


def amended(scene: Scene, values: Amendments, *, where: str) -> Scene:
    """Return a scene with some values replaced.

    Parameters
    ----------
    scene : Scene
    values : mapping
        By table and key: ``{"value": ..., "u": ...}``.
    where : str
        Named in errors.

    Raises
    ------
    ProgramError
        With exit code 2 for an impossible value.
    """
    tables = scene.to_mapping()
    for (table, key), value in values.items():
        tables.setdefault(table, {})[key] = dict(value)
    try:
        return Scene.from_mapping(tables, where=where)
    except SceneError as error:
        raise ProgramError(str(error), USAGE) from error


def stated_keys(scene: Scene) -> str:
    """Return what a scene states, in words: tables and keys."""
    return ", ".join(f"[{table}] {key}" for table, keys in scene.to_mapping().items() for key in keys) or "nothing"


def ask_about(scene: Scene, where: str | Path) -> None:
    """Ask on stderr about every value that no bench has, where no finding does: a recording, a simulation."""
    for clause in scene.unusual():
        complain(f"{where}: {clause}; check value and unit")
