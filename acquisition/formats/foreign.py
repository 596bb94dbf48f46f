"""Families of recordings that are recognised but not read here, and what a user can do about each."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from acquisition.errors import FormatError, NeedsAnswer, UnknownFormat
from acquisition.formats.text import decode, guess_delimiter, is_text, parse_number, split_cells, unify

__all__ = ["refuse"]

_TEXT = 'export time and position as text, tab separated, under a line "Time (s)<TAB>Distance (m)"'
_PHYPHOX = re.compile(r'"Time \(s\)"[,\t;]|<phyphox')
_CAPSTONE = re.compile(r'"[^"\n]*\([^"\n]*\) Run #\d+"|time;position;velocity')
_DATASTUDIO = re.compile(r"[^\n]*, Ch[A-Z], Run #\d+")


@dataclass(frozen=True, slots=True)
class _Family:
    title: str
    matches: Callable[[bytes, str], bool]
    remedy: str = _TEXT


def _is_hdf5(head: bytes, _: str) -> bool:
    return any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048, 4096))


_FAMILIES = (
    _Family("HDF5 file", _is_hdf5, "if it is a run file, open it as a run; it is not an old recording"),
    _Family("TDMS file (LabVIEW)", lambda head, _: head[:4] in (b"TDSm", b"TDSh")),
    _Family("LVM file (LabVIEW Measurement)", lambda _, text: text.startswith("LabVIEW Measurement")),
    _Family("Vernier Format 2 file", lambda _, text: text.startswith("Vernier Format 2")),
    _Family("Logger Pro CSV file", lambda _, text: "Latest: " in text.partition("\n")[0]),
    _Family("phyphox export", lambda _, text: _PHYPHOX.match(text.lstrip()) is not None),
    _Family("PASCO Capstone CSV file", lambda _, text: _CAPSTONE.match(text) is not None),
    _Family("PASCO DataStudio file", lambda _, text: _DATASTUDIO.match(text) is not None),
)


def refuse(path: str, head: bytes, names: tuple[str, ...]) -> FormatError:
    """Return the error for a file that no format recognises.

    Parameters
    ----------
    path : str
    head : bytes
        The start of the file.
    names : tuple of str
        The formats that were tried.

    Returns
    -------
    UnknownFormat
        Naming the family where it is a known one.
    NeedsAnswer
        For numbers without a word on what they are: that is never guessed.
    """
    text = unify(decode(head)) if is_text(head) else ""
    for family in _FAMILIES:
        if family.matches(head, text):
            return UnknownFormat(path, f"this is a {family.title}, which is not read by this version", family.remedy)
    if not text.strip("\0 \n\t"):
        return UnknownFormat(path, "expected a recording, got binary data or nothing", _TEXT)
    if _bare_numbers(text):
        demand = "bare numbers, and nothing says what quantity and unit they are"
        remedy = 'put the line "Time (s)<TAB>Distance (cm)", with the unit that is right, above them'
        return NeedsAnswer(path, demand, remedy, line=1)
    if head.count(b"\n") + head.count(b"\r") == 0 and len(head) > 4096:
        return UnknownFormat(path, "expected lines of text, got one line without end", _TEXT)
    return UnknownFormat(path, f"no format recognises it (tried {', '.join(names)})", _TEXT)


def _bare_numbers(text: str) -> bool:
    line = next((line for line in text.split("\n") if line.strip()), "")
    cells = split_cells(line, guess_delimiter(line))
    return bool(cells) and all(parse_number(cell) is not None for cell in cells)
