"""What is noted of a recording afterwards: scene, remarks and marks in ``NAME.about.toml`` beside it.

Recordings and run files are never changed; this file is. Every command that reads the recording uses it, and says so.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w

from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from springmass.errors import USAGE, ProgramError
from springmass.runs.scenes import read_tables
from storage.atomic import write_whole

__all__ = ["About", "about_of", "about_path", "remember_scene", "write_about"]


@dataclass(frozen=True, slots=True)
class About:
    """What is noted beside a recording.

    Parameters
    ----------
    path : Path
        Of the notes, whether they are there or not.
    scene : Scene or None
    notes : tuple of str
    marks : tuple of (float, str)
        Seconds of the record, and texts.
    """

    path: Path
    scene: Scene | None = None
    notes: tuple[str, ...] = ()
    marks: tuple[tuple[float, str], ...] = ()

    def with_more(self, scene: Scene | None, notes: Sequence[str], marks: Sequence[tuple[float, str]]) -> About:
        """Return it with another scene, where one is given, and with more notes and marks."""
        together = tuple(sorted({*self.marks, *marks}))
        return replace(self, scene=scene or self.scene, notes=(*self.notes, *notes), marks=together)

    def described(self) -> str:
        """Return what it holds, in words; empty where it holds nothing."""
        parts = ["its scene"] if self.scene is not None else []
        parts += [f"{len(self.notes)} notes"] if self.notes else []
        parts += [f"{len(self.marks)} marks"] if self.marks else []
        return ", ".join(parts)


def about_path(recording: Path) -> Path:
    """Return where what is noted of a recording stands, or would."""
    return recording.with_name(f"{recording.stem}.about.toml")


def about_of(recording: Path) -> About:
    """Read what is noted beside a recording; nothing where there is no such file.

    Raises
    ------
    ProgramError
        With exit code 2 if the file is there and says something that it cannot.
    """
    path = about_path(recording)
    if not os.path.exists(path):  # Path.exists would raise for a name that is too long
        return About(path)
    tables = read_tables(path)
    if unknown := sorted(set(tables) - {"scene", "notes", "marks"}):
        raise ProgramError(f"{path}: unknown key {unknown[0]!r}; allowed are scene, notes, marks", USAGE)
    try:
        scene = Scene.from_mapping(tables["scene"], where=f"{path} [scene]") if "scene" in tables else None
        marks = tuple((float(mark["t_s"]), str(mark["text"])) for mark in tables.get("marks", ()))
        notes = tuple(str(note) for note in tables.get("notes", ()))
    except SceneError as error:
        raise ProgramError(str(error), USAGE) from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        demand = "notes are a list of texts, marks are [[marks]] with t_s and text"
        raise ProgramError(f"{path}: {demand}; mend or remove the file", USAGE) from error
    return About(path, scene, notes, marks)


def remember_scene(recording: Path, own: Mapping[str, Any] | None, used: Scene) -> Path | None:
    """Note beside a recording the scene that was used with it, so that the next command uses it too.

    Parameters
    ----------
    recording : Path
    own : mapping or None
        The scene that is used with it anyway, as its file or the notes beside it say.
    used : Scene

    Returns
    -------
    Path or None
        The notes; None where they say so already.

    Raises
    ------
    storage.errors.WriteFailed
        If nothing can be written there.
    """
    if used.to_mapping() == Scene.from_mapping(own or {}, where=str(recording)).to_mapping():
        return None
    return write_about(about_of(recording).with_more(used, (), ()))


def write_about(about: About) -> Path:
    """Write the notes whole, in place of those that stood there; return their path."""
    tables: dict[str, Any] = {"notes": list(about.notes)} if about.notes else {}
    if about.scene is not None and (scene := about.scene.to_mapping()):
        tables["scene"] = scene
    if about.marks:
        tables["marks"] = [{"t_s": t_s, "text": text} for t_s, text in about.marks]
    return write_whole(about.path, tomli_w.dumps(tables), overwrite=True)
