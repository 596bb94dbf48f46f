"""Which formats of recordings there are, and which one a file is of.

The table holds names only: a format's module is imported when it is asked. A package elsewhere adds one with
an entry point in the group ``springmass.formats`` that names an object like
:class:`acquisition.recordings.base.Format`; a user declares one without code
(:mod:`acquisition.recordings.families.declared`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from typing import TYPE_CHECKING, cast

from acquisition.errors import AcquisitionError, UnknownFormat
from acquisition.extensions import entry_points_of, load_entry
from acquisition.recordings.base import (
    HEAD_BYTES,
    Format,
    PairFormat,
    SurveyFormat,
    dialect_folder,
    read_bytes,
    read_head,
)
from acquisition.recordings.foreign import refuse
from acquisition.recordings.inspection import Inspection
from acquisition.recordings.recording import Recording

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["formats", "get_format", "inspect", "open_recording", "sniff"]

GROUP = "springmass.formats"

_TABLE = {
    "motion-sensor": "motion_sensor",
    "lvm": "lvm",
    "tdms": "tdms",
    "workbook": "workbook",
    "zip": "archive",
    "capstone": "capstone",
    "datastudio": "datastudio",
    "vernier": "vernier",
    "logger-pro": "logger_pro",
    "phyphox": "phyphox",
    "cassy": "cassy",
    "tracker": "tracker",
    "csv": "csv_units",
    "bare": "bare",
    "table": "any_table",
}
"""The module in ``families`` of each name."""
_LAST = "table"  # takes any rows of numbers, so that everybody else is asked before


def formats() -> tuple[Format, ...]:
    """Return every format: those that the user declares, those of this package, those of others.

    Examples
    --------
    >>> "motion-sensor" in [each.name for each in formats()]
    True
    """
    return tuple(_every())


def get_format(name: str) -> Format:
    """Return the format of that name.

    Raises
    ------
    UnknownFormat
        If there is none.
    """
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
    """Tell the name of a file's format from its first bytes.

    Raises
    ------
    FormatError
        If it cannot be opened, or no format recognises it.
    """
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
    """Read an old recording.

    Parameters
    ----------
    path : path
    format : str, optional
        Name of the format; told by content if left out.
    channel, rate_hz, unit, run, time, time_unit : optional
        What the file leaves out or leaves open; see :meth:`acquisition.recordings.base.Format.read`.
    velocity_path : path, optional
        The velocity file that belongs to a position file, joined to it by time.

    Returns
    -------
    Recording

    Raises
    ------
    FormatError
        With one line for the user, whatever is wrong with the file.
    """
    name = os.fspath(path)
    reader = get_format(format) if format else _recognise(name, read_head(path))
    data = read_bytes(path)
    rare = {"run": run, "time": time, "time_unit": time_unit}
    said = {name: value for name, value in rare.items() if value is not None}
    if velocity_path is None:
        return reader.read(name, data, channel=channel, rate_hz=rate_hz, unit=unit, **said)
    if not hasattr(reader, "read_pair"):
        demand = f"format {reader.name} has no velocity files, got {os.fspath(velocity_path)}"
        raise UnknownFormat(name, demand, "leave the velocity file out")
    velocity = (os.fspath(velocity_path), read_bytes(velocity_path))
    return cast("PairFormat", reader).read_pair((name, data), velocity, rate_hz=rate_hz)


def inspect(path: str | os.PathLike[str]) -> Inspection:
    """Tell what a file is and what it holds, with nothing chosen and nothing given.

    Raises
    ------
    FormatError
        If it cannot be opened, no format recognises it, or its content cannot be read.
    """
    name = os.fspath(path)
    head = read_head(path)
    reader = _recognise(name, head)
    why = getattr(reader, "evidence", lambda _: "")(head)
    surveys = reader.survey(name, read_bytes(path)) if isinstance(reader, SurveyFormat) else ()
    return Inspection(reader.name, reader.title, why, surveys)


def _recognise(path: str, head: bytes) -> Format:
    names = []
    for candidate in _every():
        if candidate.recognises(head[:HEAD_BYTES]):
            return candidate
        names.append(candidate.name)
    raise refuse(path, head, tuple(names))


def _every() -> Iterator[Format]:
    """Yield one format after the other, what the user declares first; entry points only if the table is used up."""
    yield from _declared()
    for name in _TABLE:
        if name != _LAST:
            yield _built_in(name)
    for name, entry in _entry_points().items():
        if name not in _TABLE:
            yield _load(entry)
    yield _built_in(_LAST)


def _declared() -> Iterator[Format]:
    """Yield the user's own dialects; their reader is imported where there are any."""
    if not dialect_folder().is_dir():
        return
    for each in import_module("acquisition.recordings.families.declared").dialects():
        if each.name in _TABLE:
            where = dialect_folder() / f"{each.name}.toml"
            raise AcquisitionError(f'{where}: "{each.name}" is a family already; give the file another name')
        yield each


def _built_in(name: str) -> Format:
    return cast(Format, import_module(f"acquisition.recordings.families.{_TABLE[name]}").FORMAT)


def _entry_points() -> dict[str, EntryPoint]:
    return entry_points_of(GROUP)


def _load(entry: EntryPoint) -> Format:
    return cast(Format, load_entry(entry, f'format "{entry.name}"', AcquisitionError))
