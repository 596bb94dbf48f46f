"""Find the files that an input names: the file itself, or the recordings in a folder; tell what a file is."""

import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from acquisition.errors import AcquisitionError, UnknownFormat
from acquisition.recordings.identify import sniff
from acquisition.regular_file import open_regular
from springmass.errors import UNREADABLE, ProgramError
from springmass.typeset import count
from storage.run_file.layout import HDF5_MAGIC
from storage.run_file.reading import may_be_run
from storage.wire_log.records import WIRE_MAGIC

RUN_SUFFIXES = (".h5", ".hdf5", ".nxs")
"""Suffixes of run files."""
FILES_NAMED = 5  # maximum number of files that a message names


@dataclass(frozen=True, slots=True)
class InputFile:
    """One file to analyse, the velocity file next to it, and the index of the input that named it."""

    path: str
    velocity: str | None = None
    of: int = 0


def files_of(
    inputs: Sequence[str], *, deep: bool = False, known: Collection[str] = (), but: Collection[str] = ()
) -> tuple[list[InputFile], list[str]]:
    """Return the files that the inputs name, and messages about the files in folders that are not recordings.

    ``known`` absolute paths count as recordings without being opened; ``but`` are files and subfolders to leave out.
    In a folder, ``X_velocity.txt`` belongs to ``X_position.txt``, and a log belongs to the run file of the same name.
    """
    named: list[InputFile] = []
    messages: list[str] = []
    for number, text in enumerate(inputs):
        if not Path(text).is_dir():
            named.append(InputFile(text, None, number))
            continue
        taken: list[InputFile] = []
        others: list[str] = []
        for folder in _folders(Path(text), but) if deep else (Path(text),):
            in_it, not_in_it = _in_folder(folder, number, known, but)
            taken += in_it
            others += [str((folder / name).relative_to(text)) for name in not_in_it]
        if not taken:
            raise ProgramError(
                f"{text}: expected a folder with recordings, got none{_named(others)}", exit_code=UNREADABLE
            )
        numbers = f"{count(len(taken), 'recording')}; {count(len(others), 'other file')}"
        messages.append(f"{text}: {numbers}{_named(others)}")
        named += taken
    return named, messages


def _named(others: Sequence[str]) -> str:
    if not others:
        return ""
    more = f" and {len(others) - FILES_NAMED} more" if len(others) > FILES_NAMED else ""
    return f": {', '.join(others[:FILES_NAMED])}{more}"


def _folders(top: Path, but: Collection[str]) -> Iterator[Path]:
    """Yield a folder and all its subfolders, sorted by name, without hidden folders and results of analyses."""
    for here, inner, _ in os.walk(top):
        inner[:] = sorted(
            name
            for name in inner
            if not name.startswith(".")
            and not name.endswith(".results")
            and os.path.abspath(os.path.join(here, name)) not in but
        )
        yield Path(here)


def _in_folder(
    folder: Path, number: int, known: Collection[str], but: Collection[str]
) -> tuple[list[InputFile], list[str]]:
    try:
        files = sorted(
            path
            for path in folder.iterdir()
            if path.is_file() and not path.name.startswith(".") and not (but and os.path.abspath(path) in but)
        )
    except OSError as error:
        raise ProgramError(
            f"{folder}: cannot read the folder ({error.strerror})", "name another", UNREADABLE
        ) from error
    names = {path.name for path in files}
    velocities = {path.name: name for path in files if (name := _velocity_of(path)) in names}
    logs = {path.name for path in files if path.suffix == ".wire" and f"{path.stem}.h5" in names}
    parts, taken, others = logs.union(velocities.values()), list[InputFile](), list[str]()
    for path in (path for path in files if path.name not in parts):
        if os.path.abspath(path) in known or is_recording(path):
            velocity = str(folder / velocities[path.name]) if path.name in velocities else None
            taken.append(InputFile(str(path), velocity, number))
        else:
            others.append(path.name)
    return taken, others


def _velocity_of(path: Path) -> str:
    """Return the name of the velocity file that would belong to a position file; empty for any other."""
    stem = path.stem.removesuffix("_position")
    return "" if stem == path.stem else f"{stem}_velocity{path.suffix}"


def kind_of(path: str | os.PathLike[str]) -> Literal["run", "wire", "recording"]:
    """Return whether a file is a run file, a wire log or a recording, by its first bytes."""
    try:
        with open_regular(path) as file:
            head = file.read(len(HDF5_MAGIC))
    except (OSError, ValueError):
        return "recording"  # the format registry reports the problem
    if head == HDF5_MAGIC:
        return "run" if may_be_run(path) else "recording"
    return "wire" if head.startswith(WIRE_MAGIC) else "recording"


def is_recording(path: Path) -> bool:
    """Return whether a file is a run file, a log, or recognised by a family.

    A file that cannot be opened counts as a recording; the error is reported when it is read.
    """
    if kind_of(path) != "recording":
        return True
    try:
        sniff(path)
    except AcquisitionError as error:
        return not isinstance(error, UnknownFormat)
    return True
