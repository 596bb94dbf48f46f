"""The formats of recordings, and the identification of a file's format.

The module of a format is imported on demand. Another package adds a format with an entry point in the group
``springmass.formats``; a user can declare one without code (:mod:`acquisition.recordings.families.declared`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, cast

from acquisition.errors import AcquisitionError, UnknownFormat
from acquisition.extensions import entry_points_of, load_entry
from acquisition.recordings.base import Format, PairFormat, Survey, SurveyFormat, dialect_folder, read_bytes, read_head
from acquisition.recordings.foreign import unknown_format
from acquisition.recordings.recording import Recording

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "springmass.formats"

_TABLE = {
    "motion-sensor": "motion_sensor",
    "lvm": "lvm",
    "tdms": "tdms",
    "workbook": "workbook",
    "zip": "archive",
    "capstone": "dialects:CAPSTONE",
    "datastudio": "dialects:DATASTUDIO",
    "vernier": "dialects:VERNIER",
    "logger-pro": "logger_pro",
    "phyphox": "phyphox",
    "cassy": "cassy",
    "tracker": "tracker",
    "table": "any_table",
}
"""For each name of a format its module in ``families``, and the format's name there if it is not FORMAT."""
_LAST = "table"  # accepts any rows of numbers, so all other formats are tried first


@dataclass(frozen=True, slots=True)
class Inspection:
    """The family of a file and the evidence for it, and its channels; none if the family cannot list them."""

    format: str
    title: str
    why: str
    surveys: tuple[Survey, ...]


def formats() -> tuple[Format, ...]:
    """Return all formats, from the user's declarations, this package and other packages.

    >>> "motion-sensor" in [each.name for each in formats()]
    True
    """
    return tuple(_every())


def get_format(name: str) -> Format:
    """Return the format with a given name."""
    if name in _TABLE:
        return _built_in(name)
    declared = {each.name: each for each in _declared()}
    if name in declared:
        return declared[name]
    entries = _entry_points()
    if name in entries:
        return _load(entries[name])
    known = ", ".join([*declared, *_TABLE, *entries])
    raise UnknownFormat(f'format "{name}"', f"must be one of {known}", "name one of these or leave it out")


def sniff(path: str | os.PathLike[str]) -> str:
    """Return the name of a file's format, identified by its first bytes."""
    return _recognise(os.fspath(path), read_head(path)).name


def open_recording(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    channel: str | None = None,
    rate_hz: float | None = None,
    unit: str | None = None,
    run: str | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    velocity_path: str | os.PathLike[str] | None = None,
) -> Recording:
    """Read a recording of another program; if anything is missing or faulty, the error says so in one line.

    By default the format is identified by content. ``channel``, ``rate_hz``, ``unit``, ``run``, ``time`` and
    ``time_unit`` are what the file does not state or leaves open; see :meth:`springmass.extend.Format.read`. A
    velocity file is joined with the position file by time.
    """
    name = os.fspath(path)
    reader = get_format(format) if format else _recognise(name, read_head(path))
    data = read_bytes(path)
    optional = {"run": run, "time": time, "time_unit": time_unit}
    answers = {name: value for name, value in optional.items() if value is not None}
    if velocity_path is None:
        return reader.read(name, data, channel=channel, rate_hz=rate_hz, unit=unit, **answers)
    if not hasattr(reader, "read_pair"):
        problem = f"format {reader.name} has no velocity files, got {os.fspath(velocity_path)}"
        raise UnknownFormat(name, problem, "leave the velocity file out")
    velocity = (os.fspath(velocity_path), read_bytes(velocity_path))
    return cast("PairFormat", reader).read_pair((name, data), velocity, rate_hz=rate_hz)


def inspect(path: str | os.PathLike[str]) -> Inspection:
    """Return the format and the content of a file, before a channel is chosen."""
    name = os.fspath(path)
    head = read_head(path)
    reader = _recognise(name, head)
    why = getattr(reader, "evidence", lambda _: "")(head)
    surveys = reader.survey(name, read_bytes(path)) if isinstance(reader, SurveyFormat) else ()
    return Inspection(reader.name, reader.title, why, surveys)


def _recognise(path: str, head: bytes) -> Format:
    names = []
    for candidate in _every():
        if candidate.recognises(head):
            return candidate
        names.append(candidate.name)
    raise unknown_format(path, head, tuple(names))


def _every() -> Iterator[Format]:
    """Yield all formats in the order in which they are tried.

    The user's declarations come first, then the formats of this package, then entry points; ``table`` comes last.
    """
    yield from _declared()
    for name in _TABLE:
        if name != _LAST:
            yield _built_in(name)
    for name, entry in _entry_points().items():
        if name not in _TABLE:
            yield _load(entry)
    yield _built_in(_LAST)


def _declared() -> Iterator[Format]:
    """Yield the user's dialects; their reader is imported only if the folder of dialects exists."""
    if not dialect_folder().is_dir():
        return
    for each in import_module("acquisition.recordings.families.declared").dialects():
        if each.name in _TABLE:
            where = dialect_folder() / f"{each.name}.toml"
            raise AcquisitionError(f'{where}: expected a new name, got the format "{each.name}"; rename the file')
        yield each


def _built_in(name: str) -> Format:
    module, _, variable = _TABLE[name].partition(":")
    return cast(Format, getattr(import_module(f"acquisition.recordings.families.{module}"), variable or "FORMAT"))


def _entry_points() -> dict[str, EntryPoint]:
    return entry_points_of(GROUP)


def _load(entry: EntryPoint) -> Format:
    return cast(Format, load_entry(entry, f'format "{entry.name}"', AcquisitionError))
