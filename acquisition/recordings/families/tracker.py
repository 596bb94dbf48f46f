"""Tracker: positions of a mass on video, as a table or in the program's own format (trk).

The table has an optional line ``mass A`` and a line ``t x y``, without units. Lengths have the unit of the calibration
stick, so the user must state it. Times are frame numbers at 25 or 30 per second. The name of the mass is in the user's
language.

A trk file is XML. Each ``PointMass`` lists pixel positions by frame number. ``ImageCoordSystem`` has the origin, the
scale (pixels per unit of length) and the angle of the x axis (degrees, anticlockwise), for all frames or starting at a
given frame. Pixels are counted downwards, but y points upwards. ``delta_t`` is the duration of a frame, ms.
``length_unit`` is the unit, if it was set.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Contents, Heading, Sheet, channels_of, name_and_unit, split_heading
from acquisition.recordings.tables.markup import read_markup, side_by_side
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Line, Text, guess_delimiter, head_lines, parse_number, text_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["FORMAT"]

_PANEL = b"org.opensourcephysics.cabrillo.tracker.TrackerPanel"
_LOST = math.nan, math.nan
_MOST_FRAMES = 10**6
_SAVE = "save it again, or export the table of the mass in Tracker"
_COORDINATES = frozenset(("x", "y", "r"))


def _cells(line: str) -> tuple[list[str], str]:
    if "\t" in line or ";" in line or "," in line:
        return split_heading(line)
    return line.split(), ""


def _find(lines: Sequence[str]) -> int:
    """Return the index (0 or 1) of the line of headings; -1 if there is none, or no row follows it."""
    for at, line in enumerate(lines[:2]):
        cells, mark = _cells(line)
        names = [name_and_unit(cell)[0] for cell in cells]
        if len(names) > 1 and names[0] == "t" and _COORDINATES & set(names):
            above = [cell for cell in _cells(lines[0])[0] if cell] if at else []
            row = lines[at + 1].split(mark or None) if len(lines) > at + 1 else []
            numbers = [parse_number(cell.strip()) for cell in row if cell.strip()]
            return at if (not at or len(above) <= 2) and numbers and None not in numbers[:1] else -1
    return -1


def _evidence(head: bytes) -> str:
    if _PANEL in head and head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<"):
        return "it is XML of Tracker's panel"
    lines = head_lines(head)
    at = _find(lines)
    if at < 0:
        return ""
    mass = f' below "{_mass(lines[0])}"' if at else ""
    return f'line {at + 1} is "{" ".join(_cells(lines[at])[0])}"{mass}'


def _mass(line: str) -> str:
    return " ".join(cell for cell in _cells(line)[0] if cell)


def _contents(path: str, data: bytes) -> Contents:
    if _PANEL in data[:8192]:
        return _of_markup(path, data)
    text = text_of(path, data)
    head = text.head(3)
    at = _find([line.text for line in head])
    if at < 0:
        raise FormatError(path, 'expected a line "t x y"', "export the table again, times first", line=1)
    cells, mark = _cells(head[at].text)
    headings = [Heading(*name_and_unit(cell)) for cell in cells]
    sheet = Sheet(text, head[at].next, text.stop, at + 2, mark or _row_mark(text, head[at]))
    title = _mass(head[0].text) if at else ""
    return Contents(channels_of(sheet, headings, clock="device"), title=title, zeros=text.zeros)


def _row_mark(text: Text, headings: Line) -> str:
    """Return the separator of cells in the first row, needed if the headings are separated by blanks."""
    row = next(text.lines(headings.next), None)
    return guess_delimiter(row.text) if row else ""


def _of_markup(path: str, data: bytes) -> Contents:
    root = read_markup(path, data, _SAVE)
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
    channels = []
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
        columns = [("t", "s", t), ("x", unit, world[:, 0]), ("y", unit, world[:, 1])]
        channels.extend(side_by_side(columns, [0], name if len(masses) > 1 else ""))
    if not channels:
        raise FormatError(path, "expected a point mass with marks, got none", _SAVE)
    return Contents(tuple(channels), title=next((n for m in masses for n in _texts(m, "name")), ""))


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


FORMAT = ColumnFormat("tracker", "Tracker: table t x y of a mass on video, or saved as trk (XML)", _evidence, _contents)
