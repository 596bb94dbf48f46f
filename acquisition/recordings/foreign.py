"""Known kinds of files that cannot be read here, and a remedy for each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import PurePath

from acquisition.errors import FormatError, UnknownFormat
from acquisition.recordings.tables.text import HEAD_BYTES, head_lines, is_text

_TEXT = 'export time and position as text, tab separated, under a line "Time (s)<TAB>Distance (m)"'
_AS_CSV = "save the sheet as xlsx or CSV"


def _is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048, 4096))


def _begins(with_bytes: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(with_bytes)


_CONTENTS = (
    ("a MATLAB file", _begins(b"MATLAB 5.0 MAT"), 'in MATLAB writematrix([t x], "run.csv")'),
    ("an HDF5 file", _is_hdf5, "if it is a run file of springmass, open it as a run file"),
    ("an OpenDocument file", lambda head: b"application/vnd.oasis.opendocument" in head[:200], _AS_CSV),
    ("a TDMS index", _begins(b"TDSh"), "name the .tdms file next to it"),
    ("a numpy file", _begins(b"\x93NUMPY"), 'in Python numpy.savetxt("run.csv", array, delimiter=",")'),
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
    """Return the error for a known file that cannot be read, given its first bytes; None for an unknown file."""
    for title, matches, remedy in _CONTENTS:
        if matches(head):
            return UnknownFormat(path, f"expected a recording, got {title}", remedy)
    title, remedy = _PROGRAMS.get(PurePath(path).suffix.lower(), ("", ""))
    return UnknownFormat(path, f"expected a recording, got {title}", remedy) if title else None


def unknown_format(path: str, head: bytes, names: tuple[str, ...]) -> FormatError:
    """Return the error for a file that none of the named formats recognises."""
    if (known := foreign_format(path, head)) is not None:
        return known
    if not "".join(head_lines(head)).strip("\0 \t"):
        return UnknownFormat(path, "expected a recording, got binary data or nothing", _TEXT)
    if head.count(b"\n") + head.count(b"\r") == 0 and len(head) > 4096:
        return UnknownFormat(path, "expected lines of text, got one line without end", _TEXT)
    lines = [line.strip() for line in head_lines(head) if line.strip()]
    if len(head) < HEAD_BYTES and len(lines) > 1 and is_text(head):
        looks = f'{len(lines)} lines of text, the first "{lines[0][:40]}"'
        return UnknownFormat(path, f"not a recording: no format recognises it, it looks like {looks}", _TEXT)
    return UnknownFormat(path, f"not a recording that a format recognises (tried {', '.join(names)})", _TEXT)
