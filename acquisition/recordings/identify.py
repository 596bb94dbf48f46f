"""The formats of recordings, the identification of a file's format, and a remedy for known files that none reads.

The module of a format is imported on demand. Another package adds a format with an entry point in the group
``springmass.formats``; a user can declare one without code (:mod:`acquisition.recordings.families.user_dialects`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path, PurePath
from typing import cast

from platformdirs import user_config_path

from acquisition.errors import AcquisitionError, FormatError, UnknownFormat
from acquisition.recordings.reading import READ_DEFAULTS, ReadOptions
from acquisition.recordings.recording import Format, Recording, Survey, SurveyFormat
from acquisition.recordings.tables.text import HEAD_BYTES, decode, head_lines, is_text, restated
from acquisition.regular_file import open_regular
from failure.extensions import entry_points_of, load_entry

_MODULES = {
    "motion-sensor": "motion_sensor",
    "lvm": "lvm",
    "tdms": "tdms",
    "workbook": "workbook",
    "arrays": "arrays",
    "wav": "wav",
    "json": "json_text",
    "labchart": "lab_text:LABCHART",
    "acqknowledge": "lab_text:ACQKNOWLEDGE",
    "zip": "archive",
    "capstone": "pasco:CAPSTONE",
    "datastudio": "pasco:DATASTUDIO",
    "vernier": "vernier:VERNIER",
    "logger-pro": "vernier:LOGGER_PRO",
    "phyphox": "phyphox",
    "cassy": "cassy",
    "tracker": "tracker",
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
        names = ", ".join(loaders)
        raise UnknownFormat(f'format "{name}"', f"must be one of {names}", "name one of these or leave it out")
    return loaders[name]()


def sniff(path: str | os.PathLike[str]) -> str:
    """Return the name of a file's format, identified by its first bytes."""
    return _recognise(os.fspath(path), read_bytes(path, HEAD_BYTES)).name


def open_recording(path: str | os.PathLike[str], reading: ReadOptions = READ_DEFAULTS) -> Recording:
    """Read a recording of another program; if anything is missing or faulty, the error says so in one line.

    The format is identified by content. ``reading`` states what the file does not state or leaves open. A
    velocity file is joined with the position file by time. The separator of cells and the decimal mark of a text are
    found out unless they are stated.
    """
    name = os.fspath(path)
    reader, original, data = _opened(name, reading)
    of_format = replace(reading, velocity=None, delimiter=None, decimal=None)
    if reading.velocity is not None:
        read_pair = getattr(reader, "read_pair", None)
        if read_pair is None:
            problem = f"format {reader.name} has no velocity files, got {os.fspath(reading.velocity)}"
            raise UnknownFormat(name, problem, "leave the velocity file out")
        if others := sorted(of_format.given().keys() - {"rate_hz"}):
            problem = f"position and velocity files state all but their rate, got {', '.join(others)} too"
            raise FormatError(name, problem, "leave that out")
        velocity = (os.fspath(reading.velocity), read_bytes(reading.velocity))
        return cast(Recording, read_pair((name, data), velocity, of_format))
    recording = reader.read(name, data, of_format)
    if data is original:
        return recording
    return replace(recording, originals=(replace(recording.originals[0], data=original), *recording.originals[1:]))


def inspect(path: str | os.PathLike[str], reading: ReadOptions = READ_DEFAULTS) -> Inspection:
    """Return the format and the content of a file, before a channel is chosen."""
    name = os.fspath(path)
    reader, _, data = _opened(name, reading)
    if not isinstance(reader, SurveyFormat):
        return Inspection(reader.name, reader.title, "", ())
    return Inspection(reader.name, reader.title, reader.evidence(data[:HEAD_BYTES]), reader.survey(name, data))


def _opened(path: str, reading: ReadOptions) -> tuple[Format, bytes, bytes]:
    """Return the format of a file, its bytes, and its bytes as they are to be read."""
    if reading.delimiter or reading.decimal:
        original = read_bytes(path)
        data = restated(path, original, reading.delimiter, reading.decimal)
        return _recognise(path, data[:HEAD_BYTES]), original, data
    reader = _recognise(path, read_bytes(path, HEAD_BYTES))
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
        for each in import_module("acquisition.recordings.families.user_dialects").dialects():
            if each.name in (*_MODULES, "table", "sketch"):
                where = folder / f"{each.name}.toml"
                raise AcquisitionError(f'{where}: expected a new name, got the format "{each.name}"', "rename the file")
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


_TEXT = 'export time and position as text, tab separated, under a line "Time (s)<TAB>Distance (m)"'
_AS_CSV = "save the sheet as xlsx or CSV"


def _begins(with_bytes: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(with_bytes)


_AS_XLSX = "open it in a spreadsheet and save it as xlsx or CSV"
_HTML = re.compile(rb"(?:\xef\xbb\xbf)?\s*<(?:!doctype html|html|head|body|table|meta)\b", re.IGNORECASE)
_JSON = re.compile(rb'\s*(?:\{\s*"|\[\s*[\[{"])')
_CONTENTS = (
    ("an OpenDocument file", lambda head: b"application/vnd.oasis.opendocument" in head[:200], _AS_CSV),
    ("a TDMS index", _begins(b"TDSh"), "name the .tdms file next to it"),
    ("a parquet file", _begins(b"PAR1"), 'in Python pandas.read_parquet("run.parquet").to_csv("run.csv")'),
    ("XML of Excel 2003", lambda head: b"urn:schemas-microsoft-com:office:spreadsheet" in head, _AS_XLSX),
    ("a web page (HTML)", lambda head: bool(_HTML.match(head)), _AS_XLSX),
    ("JSON without times", lambda head: bool(_JSON.match(head)), 'save lists, as {"t": [...], "x": [...]}'),
    ("a page (PDF)", _begins(b"%PDF"), _TEXT),
    ("a picture", lambda head: head.startswith((b"\x89PNG", b"\xff\xd8\xff", b"GIF8")), _TEXT),
    (
        "a video",
        lambda head: head[4:8] == b"ftyp" or head[8:12] == b"AVI ",
        "follow the mass in Tracker, and save there",
    ),
)
_PROGRAMS = {
    ".cap": ("a Capstone workbook", 'in Capstone "File", "Export Data", "CSV"'),
    ".spk": ("a SPARKvue lab", 'in SPARKvue "Export Data", "CSV"'),
    ".spklab": ("a SPARKvue lab", 'in SPARKvue "Export Data", "CSV"'),
    ".pasco": ("a workbook of PASCO", 'in Capstone or SPARKvue "Export Data", "CSV"'),
    ".ds": ("a DataStudio activity", 'in DataStudio "File", "Export Data"'),
    ".qmbl": ("a LabQuest file", 'open it in Logger Pro or Graphical Analysis, and "Export", "CSV"'),
    ".psdata": ("a PicoScope file", 'in PicoScope "File", "Save As", "CSV"'),
    ".dwf3work": ("a WaveForms workspace", 'in WaveForms "File", "Export", "CSV"'),
    ".wfm": ("an oscilloscope's waveform", "save it as CSV at the oscilloscope"),
    ".isf": ("an oscilloscope's waveform", "save it as CSV at the oscilloscope"),
    ".opj": ("an Origin project", 'in Origin "File", "Export", "ASCII"'),
    ".opju": ("an Origin project", 'in Origin "File", "Export", "ASCII"'),
    ".sr": ("a capture of sigrok", 'in PulseView "Save", "Export", "CSV"'),
    ".numbers": ("a Numbers sheet", 'in Numbers "File", "Export To", "CSV"'),
    ".mat": ("a MATLAB file", 'in MATLAB writematrix([t x], "run.csv")'),
    ".pkl": ("a pickle of Python", "save the numbers as CSV where they were made"),
}
"""Kind and remedy, by suffix, of program files that cannot be identified by their first bytes."""


def foreign_format(path: str, head: bytes) -> UnknownFormat | None:
    """Return the error for a known file that cannot be read, given its first bytes; None for an unknown file."""
    page = decode(head).encode() if is_text(head) else head
    for title, matches, remedy in _CONTENTS:
        if matches(page):
            return UnknownFormat(path, f"expected a recording, got {title}", remedy)
    title, remedy = _PROGRAMS.get(PurePath(path).suffix.lower(), ("", ""))
    return UnknownFormat(path, f"expected a recording, got {title}", remedy) if title else None


def unknown_format(path: str, head: bytes, names: tuple[str, ...]) -> FormatError:
    """Return the error for a file that none of the named formats recognises."""
    if (foreign := foreign_format(path, head)) is not None:
        return foreign
    if not "".join(head_lines(head)).strip("\0 \t"):
        return UnknownFormat(path, "expected a recording, got binary data or nothing", _TEXT)
    if head.count(b"\n") + head.count(b"\r") == 0 and len(head) > 4096:
        return UnknownFormat(path, "expected lines of text, got one line without end", _TEXT)
    lines = [line.strip() for line in head_lines(head) if line.strip()]
    if len(head) < HEAD_BYTES and len(lines) > 1 and is_text(head):
        looks = f'{len(lines)} lines of text, the first "{lines[0][:40]}"'
        return UnknownFormat(path, f"not a recording: no format recognises it, it looks like {looks}", _TEXT)
    return UnknownFormat(path, f"not a recording that a format recognises (tried {', '.join(names)})", _TEXT)
