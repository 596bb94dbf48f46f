"""The formats of recordings, and the identification of a file's format.

The module of a format is imported on demand. Another package adds a format with an entry point in the group
``springmass.formats``; a user can declare one without code (:mod:`acquisition.recordings.families.declared`).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from platformdirs import user_config_path

from acquisition.errors import AcquisitionError, FormatError, UnknownFormat
from acquisition.recordings.foreign import unknown_format
from acquisition.recordings.recording import Format, Recording, Survey, SurveyFormat
from acquisition.recordings.tables.text import HEAD_BYTES, restated
from acquisition.regular_file import open_regular
from failure.extensions import entry_points_of, load_entry

_MODULES = {
    "motion-sensor": "motion_sensor",
    "lvm": "lvm",
    "tdms": "tdms",
    "workbook": "workbook",
    "zip": "archive",
    "capstone": "dialects:CAPSTONE",
    "datastudio": "dialects:DATASTUDIO",
    "vernier": "dialects:VERNIER",
    "logger-pro": "saved:LOGGER_PRO",
    "phyphox": "saved:PHYPHOX",
    "cassy": "saved:CASSY",
    "tracker": "saved:TRACKER",
}
"""For each name of a format its module in ``families``, and the format's name there if it is not FORMAT."""


@dataclass(frozen=True, slots=True)
class Inspection:
    """The family of a file and the evidence for it, and its channels; none if the family cannot list them."""

    format: str
    title: str
    why: str
    surveys: tuple[Survey, ...]


def formats() -> tuple[Format, ...]:
    """Return all formats in the order in which they are tried."""
    return tuple(load() for load in _loaders().values())


def get_format(name: str) -> Format:
    """Return the format with a given name."""
    loaders = _loaders()
    if name not in loaders:
        known = ", ".join(loaders)
        raise UnknownFormat(f'format "{name}"', f"must be one of {known}", "name one of these or leave it out")
    return loaders[name]()


def sniff(path: str | os.PathLike[str]) -> str:
    """Return the name of a file's format, identified by its first bytes."""
    return _recognise(os.fspath(path), read_bytes(path, HEAD_BYTES)).name


def open_recording(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    velocity_path: str | os.PathLike[str] | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    **answers: Any,
) -> Recording:
    """Read a recording of another program; if anything is missing or faulty, the error says so in one line.

    By default the format is identified by content. The answers are what the file does not state or leaves open; see
    :meth:`springmass.extend.Format.read`. A velocity file is joined with the position file by time. The separator of
    cells and the decimal mark of a text are found out unless they are stated.
    """
    name = os.fspath(path)
    reader, original, data = _opened(name, format, delimiter, decimal)
    if velocity_path is not None:
        read_pair = getattr(reader, "read_pair", None)
        if read_pair is None:
            problem = f"format {reader.name} has no velocity files, got {os.fspath(velocity_path)}"
            raise UnknownFormat(name, problem, "leave the velocity file out")
        velocity = (os.fspath(velocity_path), read_bytes(velocity_path))
        return cast(Recording, read_pair((name, data), velocity, rate_hz=answers.get("rate_hz")))
    recording = reader.read(name, data, **{name: answer for name, answer in answers.items() if answer is not None})
    if data is original:
        return recording
    return replace(recording, originals=(replace(recording.originals[0], data=original), *recording.originals[1:]))


def inspect(path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str | None = None) -> Inspection:
    """Return the format and the content of a file, before a channel is chosen."""
    name = os.fspath(path)
    reader, _, data = _opened(name, None, delimiter, decimal)
    if not isinstance(reader, SurveyFormat):
        return Inspection(reader.name, reader.title, "", ())
    return Inspection(reader.name, reader.title, reader.evidence(data[:HEAD_BYTES]), reader.survey(name, data))


def _opened(path: str, format: str | None, delimiter: str | None, decimal: str | None) -> tuple[Format, bytes, bytes]:
    """Return the format of a file, its bytes, and its bytes as they are to be read."""
    if delimiter or decimal:
        original = read_bytes(path)
        data = restated(path, original, delimiter, decimal)
        return get_format(format) if format else _recognise(path, data[:HEAD_BYTES]), original, data
    reader = get_format(format) if format else _recognise(path, read_bytes(path, HEAD_BYTES))
    data = read_bytes(path)
    return reader, data, data


def _recognise(path: str, head: bytes) -> Format:
    loaders = _loaders()
    for load in loaders.values():
        if (candidate := load()).recognises(head):
            return candidate
    raise unknown_format(path, head, tuple(loaders))


def _loaders() -> dict[str, Callable[[], Format]]:
    """Return what loads each format, in the order in which they are tried: the user's first, the general ones last."""
    loaders: dict[str, Callable[[], Format]] = {}
    if (folder := dialect_folder()).is_dir():
        for each in import_module("acquisition.recordings.families.declared").dialects():
            if each.name in (*_MODULES, "table", "sketch"):
                where = folder / f"{each.name}.toml"
                raise AcquisitionError(f'{where}: expected a new name, got the format "{each.name}"; rename the file')
            loaders[each.name] = partial(cast, Format, each)
    loaders |= {name: partial(_built_in, module) for name, module in _MODULES.items()}
    for name, entry in entry_points_of("springmass.formats").items():
        loaders.setdefault(name, partial(load_entry, entry, f'format "{name}"', AcquisitionError))
    return {**loaders, "table": partial(_built_in, "any_table"), "sketch": partial(_built_in, "sketch")}


def _built_in(module: str) -> Format:
    name, _, variable = module.partition(":")
    return cast(Format, getattr(import_module(f"acquisition.recordings.families.{name}"), variable or "FORMAT"))


def dialect_folder() -> Path:
    """Return the folder of a user's dialects inside the system's folder for settings."""
    return user_config_path("springmass", appauthor=False, roaming=True) / "dialects"


def read_bytes(path: str | os.PathLike[str], limit: int = -1) -> bytes:
    """Return the first bytes of a file, or all; raise an error if it cannot be read or is empty."""
    name = os.fspath(path)
    try:
        with open_regular(name) as file:
            data = file.read(limit)
    except OSError as error:
        problem = f"cannot be opened ({error.strerror or error})"
        raise FormatError(name, problem, "check its name and permissions") from error
    except ValueError as error:  # the name contains a NUL character
        raise FormatError(repr(name), f"not a valid file name ({error})", "check the name") from error
    if not data:
        raise FormatError(name, "expected a recording, got an empty file", "check that the export ended")
    return data
