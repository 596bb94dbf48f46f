"""Scene files: one for all runs, or one for each."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acquisition.regular import open_regular
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from springmass.errors import USAGE, ProgramError, complain

__all__ = ["ask_about", "read_scene", "read_scenes", "scene_beside"]

LONGEST_SCENE = 1 << 14  # bytes; of longer ones some take seconds to parse


def read_scenes(paths: Sequence[str], count: int) -> list[Scene | None]:
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


def scene_beside(path: Path) -> Scene | None:
    """Return the scene that was noted beside a recording after it was made, if there is one.

    Parameters
    ----------
    path : Path
        Of ``NAME.h5``, say: the table ``[scene]`` of ``NAME.about.toml`` holds what a scene file does.

    Raises
    ------
    ProgramError
        As :func:`read_scene`.
    """
    about = path.with_suffix(".about.toml")
    if not about.exists():
        return None
    tables = _read_tables(about)
    return _scene_of(tables["scene"], f"{about} [scene]") if "scene" in tables else None


def read_scene(path: str | Path) -> Scene:
    """Read a scene file (TOML).

    Raises
    ------
    ProgramError
        With exit code 2 if it is absent, no TOML, or says something impossible; the line names file, key and value.
    """
    return _scene_of(_read_tables(path), str(path))


def _read_tables(path: str | Path) -> dict[str, Any]:
    try:
        with open_regular(path) as file:
            content = file.read(LONGEST_SCENE + 1) or b""
        if len(content) > LONGEST_SCENE:
            raise ProgramError(
                f"{path}: a scene file of at most {LONGEST_SCENE} bytes was demanded, got a longer one; "
                "name the scene, not the recording",
                USAGE,
            )
        return tomllib.loads(content.decode())
    except OSError as error:
        raise ProgramError(
            f"{path}: a scene file was demanded, got none ({error.strerror}); check the name", USAGE
        ) from error
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


def ask_about(scene: Scene, where: str | Path) -> None:
    """Ask on stderr about every value that no bench has, where no finding does: a recording, a simulation."""
    for clause in scene.unusual():
        complain(f"{where}: {clause}; check value and unit")
