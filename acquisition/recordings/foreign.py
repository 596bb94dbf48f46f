"""Known kinds of files that cannot be read here, and a remedy for each."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import PurePath

from acquisition.errors import FormatError, UnknownFormat
from acquisition.recordings.tables.text import head_lines

__all__ = ["foreign_format", "unknown_format"]

_TEXT = 'export time and position as text, tab separated, under a line "Time (s)<TAB>Distance (m)"'
_AS_CSV = "save the sheet as xlsx or CSV"
_YAML = re.compile(
    rb"^\s*[^\W\d][\w .]*:[ \t]*(?:\r?\n(?:[ \t]*- +[-+.\d][-+.\deE]*[ \t]*\r?\n){3}|\[(?:\s*[-+.\deE]+\s*,){3})",
    re.MULTILINE,
)
_YAML_LINE = re.compile(rb"[ \t]*(?:- +[-+.\d]|[^\W\d][\w .]*:[ \t]*\[[-+.\d])")
_JSON = re.compile(rb"[\[{]\s*(?:[\[{(\"]|[-+.\d]+\s*,)")
_LIST = re.compile(rb"^[ \t]*[^\W\d][\w.]*\s*=\s*(?:(?:np\.)?array\(\s*)?\[(?:\s*[-+.\deE]+\s*,){3}", re.MULTILINE)
_TUPLES = re.compile(rb"^\((?:[-+.\deE]+, *)+[-+.\deE]*\),?[ \t]*\r?$", re.MULTILINE)
_BARS = re.compile(rb"^[ \t]*\|.*\|[ \t]*\r?\n[ \t]*\|[-:| \t]+\|[ \t]*\r?$", re.MULTILINE)
_OF_TEXT = 0.3
"""Minimum share of lists in a text that is refused as lists; a program may also contain a few lists."""


def _is_json(head: bytes) -> bool:
    return bool(_JSON.match(head.lstrip(b"\xef\xbb\xbf \r\n\t")))


def _is_lists(head: bytes) -> bool:
    """Return whether a text has a line that is a Python tuple, or consists to a large part of named lists."""
    listed = sum(len(line) for line in head.split(b"\n") if _LIST.match(line))
    return bool(_TUPLES.search(head)) or listed >= max(1, _OF_TEXT * len(head))


def _is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048, 4096))


def _is_yaml(head: bytes) -> bool:
    """Return whether a text is largely YAML lists: numbers after hyphens below a key, or a list after the key."""
    listed = sum(len(line) for line in head.split(b"\n") if _YAML_LINE.match(line))
    return bool(_YAML.search(head)) and listed >= max(1, _OF_TEXT * len(head))


def _begins(with_bytes: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(with_bytes)


_CONTENTS = (
    ("a MATLAB file", _begins(b"MATLAB 5.0 MAT"), 'in MATLAB writematrix([t x], "run.csv")'),
    ("an HDF5 file", _is_hdf5, "if it is a run file of springmass, open it as a run file"),
    ("an OpenDocument file", lambda head: b"application/vnd.oasis.opendocument" in head[:200], _AS_CSV),
    ("a TDMS index", _begins(b"TDSh"), "name the .tdms file next to it"),
    ("a numpy file", _begins(b"\x93NUMPY"), 'in Python numpy.savetxt("run.csv", array, delimiter=",")'),
    ("YAML", _is_yaml, "export its lists as columns of a CSV file, times first"),
    ("JSON", _is_json, 'in Python pandas.read_json(FILE).to_csv("run.csv", index=False)'),
    ("lists of Python", _is_lists, 'in Python numpy.savetxt("run.csv", numpy.transpose([t, x]), delimiter=",")'),
    ("a table of Markdown", lambda head: bool(_BARS.search(head)), "export the rows as CSV, without bars"),
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
    ".numbers": ("a Numbers sheet", 'in Numbers "File", "Export To", "CSV"'),
    ".mat": ("a MATLAB file", 'in MATLAB writematrix([t x], "run.csv")'),
    ".pkl": ("a pickle of Python", "save the numbers as CSV where they were made"),
}
"""Kind and remedy, by suffix, of program files that cannot be identified by their first bytes."""


def foreign_format(path: str, head: bytes) -> UnknownFormat | None:
    """Return the error for a known file that cannot be read; None for an unknown file.

    Parameters
    ----------
    path : str
    head : bytes
        The start of the file.
    """
    for title, matches, remedy in _CONTENTS:
        if matches(head):
            return UnknownFormat(path, f"expected a recording, got {title}", remedy)
    title, remedy = _PROGRAMS.get(PurePath(path).suffix.lower(), ("", ""))
    return UnknownFormat(path, f"expected a recording, got {title}", remedy) if title else None


def unknown_format(path: str, head: bytes, names: tuple[str, ...]) -> FormatError:
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
        It names the kind of file, if that is known.
    """
    if (known := foreign_format(path, head)) is not None:
        return known
    if not "".join(head_lines(head)).strip("\0 \t"):
        return UnknownFormat(path, "expected a recording, got binary data or nothing", _TEXT)
    if head.count(b"\n") + head.count(b"\r") == 0 and len(head) > 4096:
        return UnknownFormat(path, "expected lines of text, got one line without end", _TEXT)
    return UnknownFormat(path, f"no format recognises it (tried {', '.join(names)})", _TEXT)
