"""Tracker: saved analyses of videos, trk (XML).

Each ``PointMass`` lists pixel positions by frame number. ``ImageCoordSystem`` has the origin, the scale (pixels per
unit of length) and the angle of the x axis (degrees, anticlockwise), for all frames or starting at a given frame.
Pixels are counted downwards, but y points upwards. ``delta_t`` is the duration of a frame, ms.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.families.markup import BLANKS, read_markup, tables_of
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.table import Table

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_PANEL = b"org.opensourcephysics.cabrillo.tracker.TrackerPanel"
_LOST = math.nan, math.nan
_MOST_FRAMES = 10**6
_SAVE = "save it again, or export the table of the mass in Tracker"


def _tables(path: str, data: bytes) -> list[Table]:
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
        tables += tables_of(columns, name if len(masses) > 1 else "")
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


FORMAT = ColumnFormat(
    "tracker",
    "Tracker: saved as trk (XML)",
    lambda head: "it is XML of Tracker's panel" if _PANEL in head and head.lstrip(BLANKS)[:1] == b"<" else "",
    _tables,
)
