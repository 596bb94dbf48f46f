"""The formats of recordings, and the identification of a file's format.

The module of a format is imported on demand. Another package adds a format with an entry point in the group
``springmass.formats``; a user can declare one without code (:mod:`acquisition.recordings.families.declared`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import Any, cast

from acquisition.errors import AcquisitionError, UnknownFormat
from acquisition.recordings.base import Format, Survey, SurveyFormat, dialect_folder, read_bytes
from acquisition.recordings.foreign import unknown_format
from acquisition.recordings.recording import Recording
from acquisition.recordings.tables.text import HEAD_BYTES, restated
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
    if delimiter or decimal:
        original = read_bytes(path)
        data = restated(name, original, delimiter, decimal)
        reader = get_format(format) if format else _recognise(name, data[:HEAD_BYTES])
        recording = _read(reader, name, data, answers)
        return replace(recording, originals=(replace(recording.originals[0], data=original), *recording.originals[1:]))
    reader = get_format(format) if format else _recognise(name, read_bytes(path, HEAD_BYTES))
    data = read_bytes(path)
    if velocity_path is not None:
        read_pair = getattr(reader, "read_pair", None)
        if read_pair is None:
            problem = f"format {reader.name} has no velocity files, got {os.fspath(velocity_path)}"
            raise UnknownFormat(name, problem, "leave the velocity file out")
        velocity = (os.fspath(velocity_path), read_bytes(velocity_path))
        return cast(Recording, read_pair((name, data), velocity, rate_hz=answers.get("rate_hz")))
    return _read(reader, name, data, answers)


def _read(reader: Format, name: str, data: bytes, answers: Mapping[str, Any]) -> Recording:
    return reader.read(name, data, **{name: answer for name, answer in answers.items() if answer is not None})


def inspect(path: str | os.PathLike[str], *, delimiter: str | None = None, decimal: str | None = None) -> Inspection:
    """Return the format and the content of a file, before a channel is chosen."""
    if delimiter or decimal:
        data = restated(os.fspath(path), read_bytes(path), delimiter, decimal)
        head = data[:HEAD_BYTES]
    else:
        data, head = b"", read_bytes(path, HEAD_BYTES)
    reader = _recognise(os.fspath(path), head)
    if not isinstance(reader, SurveyFormat):
        return Inspection(reader.name, reader.title, "", ())
    surveys = reader.survey(os.fspath(path), data or read_bytes(path))
    return Inspection(reader.name, reader.title, reader.evidence(head), surveys)


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
            loaders[each.name] = partial(_declared, each)
    loaders |= {name: partial(_built_in, module) for name, module in _MODULES.items()}
    for name, entry in entry_points_of("springmass.formats").items():
        loaders.setdefault(name, partial(load_entry, entry, f'format "{name}"', AcquisitionError))
    return {**loaders, "table": partial(_built_in, "any_table"), "sketch": partial(_built_in, "sketch")}


def _declared(each: Format) -> Format:
    return each


def _built_in(module: str) -> Format:
    name, _, variable = module.partition(":")
    return cast(Format, getattr(import_module(f"acquisition.recordings.families.{name}"), variable or "FORMAT"))
