"""What phyphox, Logger Pro, Graphical Analysis, CASSY Lab and Tracker save: XML with the numbers of every channel.

- phyphox: the ``init`` attribute of each container lists the numbers of a buffer, and ``<export>`` names the buffers.
- Logger Pro (cmbl) and Graphical Analysis (gambl, a tar archive): a ``DataSet`` is a run, and a ``DataColumn`` has its
  name, its unit and a line for each number in ``ColumnCells``; an empty line, or ``Z1 1:``, is a lost sample.
- CASSY Lab (labx): every ``channel`` has its ``quantity``, ``symbol``, ``unit`` and ``values``; an empty value is a
  lost sample. In the older lab files, text that begins with ``CL4`` or similar, three lines (quantity, symbol, unit)
  and a line of settings describe each channel. A line with the numbers of columns and rows comes before the rows.
- Tracker (trk): each ``PointMass`` lists pixel positions by frame number. ``ImageCoordSystem`` has the origin, the
  scale (pixels per unit of length) and the angle of the x axis (degrees, anticlockwise), for all frames or starting at
  a given frame. Pixels are counted downwards, but y points upwards. ``delta_t`` is the duration of a frame, ms.

What the same programs export as text is in :mod:`acquisition.recordings.families.dialects`.
"""

from __future__ import annotations

import io
import math
import re
import tarfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.families.dialects import logger_pro
from acquisition.recordings.tables.cells import parse_number
from acquisition.recordings.tables.format import ColumnFormat, text_format
from acquisition.recordings.tables.headings import Heading, Role, is_time, name_and_unit, unique
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Column, Table, side_by_side
from acquisition.recordings.tables.text import HEAD_BYTES, Text, decode, head_lines, text_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_PHYPHOX = re.compile(
    r"\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*(?:<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>\s*)?<phyphox[\s>]", re.DOTALL
)
_VERNIER = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<(?:Document|udm)[\s>]")
_CASSY = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<cassylab[\s>]")
_CASSY_TEXT = re.compile(r"CL\d")
_MOST_HEAD_LINES = 1000
_MOST_BYTES = 1 << 26
"""Maximum size of XML, bytes. Files of school programs are smaller; parsing takes about twenty times the memory."""
_EXPORT = 'in Logger Pro "File", "Export As", "CSV"; in Graphical Analysis "Export", "CSV"'
_CASSY_EXPORT = "save it again, or export it as text in CASSY Lab"

_PANEL = b"org.opensourcephysics.cabrillo.tracker.TrackerPanel"
_BLANKS = b"\xef\xbb\xbf \r\n\t"
_LOST = math.nan, math.nan
_MOST_FRAMES = 10**6
_SAVE = "save it again, or export the table of the mass in Tracker"


def _read_markup(path: str, data: bytes, remedy: str) -> Element:
    """Return the root of an XML file without a document type, which may name other files or expand without limit."""
    from xml.etree import ElementTree

    if not data.lstrip(_BLANKS).startswith(b"<?xml"):
        data = decode(data).encode()  # XML without a declaration must be UTF-8, but old programs use other codes

    if len(data) > _MOST_BYTES:
        raise FormatError(path, f"expected at most {_MOST_BYTES} bytes of XML, got {len(data)}", remedy)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise FormatError(path, "expected plain XML, got a document type", remedy)
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FormatError(path, f"expected XML, got {error}", remedy) from error


def _numbers(cells: Iterable[str]) -> F8:
    """Return the numbers in cells; NaN for cells that are not numbers."""
    return np.array([np.nan if x is None else x for x in (parse_number(cell.strip()) for cell in cells)], np.float64)


def _tables_of(columns: Sequence[tuple[Heading, F8]], run: str = "") -> list[Table]:
    """Return the tables of columns that have been read; shorter ones end in NaN."""
    read = tuple(Column(each.name, each.unit, values) for each, values in columns)
    return side_by_side(Table(read), [each for each, _ in columns], run)


def _begins(head: bytes, root: re.Pattern[str]) -> bool:
    return bool(root.match("\n".join(head_lines(head))))


def _phyphox_tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    root = _read_markup(path, text.data, "save the experiment in phyphox again")
    buffers = {}
    for each in root.iter("container"):
        values = _numbers(cell for cell in each.get("init", "").split(",") if cell.strip())
        if values.size and each.text:
            buffers[each.text.strip()] = values
    title = next((each.text.strip() for each in root.iter("title") if each.text), "")
    tables: list[Table] = []
    sets = list(root.iter("set"))
    for each in sets:  # each with its own times
        named = [(name_and_unit(data.get("name", "")), (data.text or "").strip()) for data in each.iter("data")]
        columns = [(Heading(*heading), buffers[buffer]) for heading, buffer in named if buffer in buffers]
        tables += _tables_of(columns, each.get("name", "") if len(sets) > 1 else "")
    if not tables:
        problem = "expected buffers with numbers and an export that names them, got none"
        raise FormatError(path, problem, "save the state after recording, or export the data as CSV")
    return [replace(each, title=title) for each in tables]


def _is_tar(head: bytes) -> bool:
    return head[257:262] == b"ustar" and b".udm" in head


def _vernier_evidence(head: bytes) -> str:
    if _is_tar(head):
        return "it is a tar archive with a .udm file, as Graphical Analysis saves"
    if _begins(head, _VERNIER) and (b"Vernier" in head or b"<DataSet>" in head):
        return "it is XML with the root <Document>, by Vernier"
    return ""


def _vernier_tables(path: str, data: bytes) -> list[Table]:
    root = _read_markup(path, _unpacked(path, data) if _is_tar(data[:HEAD_BYTES]) else data, _EXPORT)
    sets = [each for each in root.iter("DataSet") if each.find("DataColumn") is not None]
    taken: set[str] = set()
    runs = [unique((each.findtext("DataSetName") or "").strip() or "Data Set", taken) for each in sets]
    tables = [table for run, each in zip(runs, sets, strict=True) for table in _of_set(each, run)]
    if not tables:
        raise FormatError(path, "expected columns with numbers, got none", _EXPORT)
    return tables


def _unpacked(path: str, data: bytes) -> bytes:
    try:
        with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as archive:
            for each in archive:
                file = archive.extractfile(each) if each.isreg() and each.name.endswith(".udm") else None
                if file is not None and each.size <= _MOST_BYTES:
                    return file.read()
    except (tarfile.TarError, EOFError, ValueError) as error:
        raise FormatError(path, f"cannot be unpacked ({error})", _EXPORT) from error
    raise FormatError(path, f"expected a .udm file of at most {_MOST_BYTES} bytes in the archive, got none", _EXPORT)


def _of_set(data_set: Element, run: str) -> list[Table]:
    columns = []
    for each in data_set.iter("DataColumn"):
        values = _numbers((each.findtext("ColumnCells") or "").strip("\n").split("\n"))
        if np.isfinite(values).any():
            name, unit = ((each.findtext(tag) or "").strip() for tag in ("DataObjectName", "ColumnUnits"))
            columns.append((Heading(name, unit.strip("()")), values))
    return _tables_of(columns, run)


def _cassy_evidence(head: bytes) -> str:
    lines = head_lines(head)
    if _begins(head, _CASSY):
        return "it is XML with the root <cassylab>"
    if _CASSY_TEXT.fullmatch(lines[0].strip()) and len(lines) > 3:
        return f'line 1 is "{lines[0].strip()}"'
    return ""


def _cassy_tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    if not _begins(data[:HEAD_BYTES], _CASSY):
        return _cassy_text(path, text)
    columns = []
    for each in _read_markup(path, text.data, _CASSY_EXPORT).iter("channel"):
        values = _numbers(value.text or "" for value in each.iter("value"))
        if values.size:
            described = ((each.findtext(tag) or "").strip() for tag in ("quantity", "symbol", "unit"))
            columns.append((_heading(*described), values))
    tables = _tables_of(columns)
    if not tables:
        raise FormatError(path, "expected channels with values, got none", _CASSY_EXPORT)
    return tables


def _heading(name: str, symbol: str, unit: str) -> Heading:
    role: Role = "time" if is_time(name) else "aside" if name == "Index" else "channel"
    return Heading(f"{name} {symbol}".strip(), unit, role=role)


_COMPUTED = re.compile(r"10( -?\d+){3}")


def _cassy_text(path: str, text: Text) -> list[Table]:
    lines = text.head(_MOST_HEAD_LINES)
    for at, line in enumerate(lines[:-1]):
        size = re.fullmatch(r"(\d+) (\d+)", line.strip())
        row = lines[at + 1].rstrip("\t").split("\t")
        if size and len(row) == int(size[1]) > 1 and all(parse_number(cell) is not None for cell in row if cell):
            break
    else:
        raise FormatError(path, "expected the numbers of columns and rows, and the rows below", _CASSY_EXPORT)
    # Settings follow the rows and contain no tabs; if their first line has no end, it is an incomplete row.
    tab = text.at(text.data.rfind(b"\t"))
    stop = tab + 1 if tab + 2 < len(text) or text.ended else len(text)
    table = read_rows(path, text, at + 1, stop, "\t")
    return side_by_side(replace(table, ragged=True), _described(path, lines[:at], len(row)))


def _described(path: str, above: Sequence[str], width: int) -> list[Heading]:
    """Return the headings: three lines of words and one line of sixteen settings describe a channel.

    The axis of the spectrum is described after index and time, but has no column; nor have the channels that are
    computed, whose description begins with a line like ``10 4 0 0``, if there are fewer columns than channels.
    """
    places = [
        at
        for at, line in enumerate(above)
        if at >= 3 and len(cells := line.split()) == 16 and all(parse_number(cell) is not None for cell in cells)
    ]
    described = [tuple(above[at - back].strip() for back in (3, 2, 1)) for at in places]
    computed = [
        any(_COMPUTED.fullmatch(line.strip()) for line in above[before + 1 : at])
        for before, at in pairwise([-1, *places])
    ]
    if len(described) > width and described[2][2] == "Hz":
        del described[2], computed[2]
    for at in [at for at, own in enumerate(computed) if own][::-1]:
        if len(described) > width:
            del described[at]
    if len(described) != width:
        raise FormatError(path, f"expected {width} channels above the rows, got {len(described)}", _CASSY_EXPORT)
    return [_heading(*each) for each in described]


def _tracker_tables(path: str, data: bytes) -> list[Table]:
    root = _read_markup(path, data, _SAVE)
    unit = next(iter(_texts(root, "length_unit")), "")
    control, clip = _object(root, "ClipControl"), _object(root, "VideoClip")
    frame_s = 1e-3 * _number(path, control, "delta_t")
    start_frame = _number(path, clip, "startframe", 0.0)
    start_s = 1e-3 * _number(path, clip, "starttime", 0.0)
    step = max(int(_number(path, clip, "stepsize", 1.0)), 1)
    axes = _object(root, "ImageCoordSystem")
    systems = [] if axes is None else sorted(_frames(path, axes, ("xorigin", "yorigin", "angle", "xscale", "yscale")))
    if not systems:
        raise FormatError(path, "expected a coordinate system, got none", _SAVE)
    tables: list[Table] = []
    masses = [each for each in root.iter("object") if each.get("class", "").endswith(".PointMass")]
    for mass in masses:
        marks = dict(_frames(path, mass, ("x", "y")))
        if not marks:
            continue
        frames = sorted(marks)
        if 0 < (frames[-1] - frames[0]) / step < _MOST_FRAMES:
            frames = sorted({*marks, *range(frames[0], frames[-1], step)})  # a frame without a mark is a lost sample
        t = np.array([start_s + (frame - start_frame) * frame_s for frame in frames])
        world = np.array([_world(frame, marks.get(frame, _LOST), systems) for frame in frames])
        name = next(iter(_texts(mass, "name")), "")
        columns = [(Heading("t", "s"), t), (Heading("x", unit), world[:, 0]), (Heading("y", unit), world[:, 1])]
        tables += _tables_of(columns, name if len(masses) > 1 else "")
    if not tables:
        raise FormatError(path, "expected a point mass with marks, got none", _SAVE)
    title = next((name for mass in masses for name in _texts(mass, "name")), "")
    return [replace(each, title=title) for each in tables]


def _texts(of: Element, name: str) -> Iterator[str]:
    return ((each.text or "").strip() for each in of.findall("property") if each.get("name") == name and each.text)


def _object(root: Element, kind: str) -> Element | None:
    """Return the first object whose class name ends with ``kind``."""
    return next((each for each in root.iter("object") if each.get("class", "").endswith(kind)), None)


def _number(path: str, of: Element | None, name: str, default: float = math.nan) -> float:
    cell = "" if of is None else next(iter(_texts(of, name)), "")
    value = parse_number(cell) if cell else default
    if value is None or not math.isfinite(value):
        raise FormatError(path, f'expected a number as {name}, got "{cell or "nothing"}"', _SAVE)
    return value


def _frames(path: str, of: Element, names: Sequence[str]) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield the frame number and the named values of each entry in an object's ``framedata``."""
    for array in of.findall("property"):
        for each in array.findall("property") if array.get("name") == "framedata" else ():
            frame, mark = re.fullmatch(r"\[(\d{1,9})\]", each.get("name", "")), each.find("object")
            if frame and mark is not None:
                yield int(frame[1]), tuple(_number(path, mark, name) for name in names)


def _world(frame: int, pixel: Sequence[float], systems: Sequence[tuple[int, Sequence[float]]]) -> tuple[float, float]:
    """Convert pixels to x and y in units of length, by the origin, angle and scale of the axes."""
    x0, y0, degrees, x_scale, y_scale = next(
        (system for first, system in reversed(systems) if first <= frame), systems[0][1]
    )
    turn = math.radians(degrees)
    x, y = pixel[0] - x0, y0 - pixel[1]
    along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    return (along / x_scale if x_scale else math.nan, across / y_scale if y_scale else math.nan)


_TITLE = "Logger Pro, Graphical Analysis: CSV, or saved as cmbl or gambl"
_TEXT = text_format("logger-pro", _TITLE, logger_pro, expected='headings like "Latest: Position (m)"')
LOGGER_PRO = replace(
    _TEXT,
    evidence=lambda head: _vernier_evidence(head) or _TEXT.evidence(head),
    tables=lambda path, data: (_vernier_tables if _vernier_evidence(data[:HEAD_BYTES]) else _TEXT.tables)(path, data),
)
PHYPHOX = ColumnFormat(
    "phyphox",
    "phyphox: saved state as XML",
    lambda head: "it is XML with the root <phyphox>" if _begins(head, _PHYPHOX) else "",
    _phyphox_tables,
)
TRACKER = ColumnFormat(
    "tracker",
    "Tracker: saved as trk (XML)",
    lambda head: "it is XML of Tracker's panel" if _PANEL in head and head.lstrip(_BLANKS)[:1] == b"<" else "",
    _tracker_tables,
)
CASSY = ColumnFormat("cassy", "CASSY Lab: saved as labx (XML) or lab (text)", _cassy_evidence, _cassy_tables)
