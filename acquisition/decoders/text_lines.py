r"""Lines of text from a microcontroller's sketch: a number in a column, or after a name.

``12.34``, ``512;12.34``, ``t=512 d=12.34 cm``: which column, which unit and which separator is said by options,
because no line says it. A first line may have begun before the port was opened, and the end of a number is a number:
it is dropped and counted as ``partial_line``. A line without a number where one belongs is counted as ``bad_frame``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from acquisition.decoders.columns import Column, as_column, as_separator, split
from acquisition.decoders.family import Family
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.lines import LineSplitter
from acquisition.errors import SensorError
from acquisition.readings import NAN, Reading

__all__ = ["FAMILY", "TextLinesDecoder", "TextLinesEncoder"]

LONGEST = 256
"""Longest line, bytes."""

LENGTHS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
TIMES_US = {"us": 1.0, "ms": 1e3, "s": 1e6}

_FARTHEST_M = 20.0  # no rangefinder in air hears an echo from there
_LATEST_US = 38_000.0  # what an HC-SR04 sends when it heard none

_OPTIONS = {
    "column": "of the reading: a number from 0, or a name as in d=12.3 (default 0)",
    "unit": "of the reading: m, cm, mm, in, or us for an echo time (default cm)",
    "separator": "between columns: one character, tab, or nothing for blanks, commas and semicolons",
    "sequence": "column of the device's counter, if it sends one",
    "time": "column of the device's clock, if it sends one",
    "time_unit": "of that clock: us, ms or s (default us)",
    "temperature": "column of a temperature in degC, if it sends one",
}


class _Form:
    """What stands where in a line; the parameters are the family's options.

    Parameters
    ----------
    column, sequence, time, temperature : int or str, optional
        Number from 0 or name of a column.
    unit : str
        m, cm, mm, in, or us for an echo time there and back.
    separator : str, optional
        One character; left out, blanks, commas and semicolons separate.
    time_unit : str
        us, ms or s.

    Raises
    ------
    SensorError
        If an option has no such value.
    """

    def __init__(
        self,
        column: int | str = 0,
        unit: str = "cm",
        separator: str | None = None,
        sequence: int | str | None = None,
        time: int | str | None = None,
        time_unit: str = "us",
        temperature: int | str | None = None,
    ) -> None:
        self.separator = as_separator(separator)
        self.is_echo = unit == "us"
        self.scale = 1.0 if self.is_echo else _factor("unit", unit, LENGTHS_M, "us")
        self.time_us = _factor("time_unit", time_unit, TIMES_US)
        self.reading = as_column("column", column, unit)
        self.sequence = None if sequence is None else as_column("sequence", sequence)
        self.time = None if time is None else as_column("time", time, time_unit)
        self.temperature = None if temperature is None else as_column("temperature", temperature, "C")


class TextLinesDecoder(FramedDecoder):
    """Decodes text lines.

    Parameters
    ----------
    **options
        Those of the family.

    Raises
    ------
    SensorError
        If an option has no such value.

    Notes
    -----
    There is no checksum. A reading is a number in a line that was received from its beginning to its end; a flipped
    bit that makes another digit cannot be seen. Zero, a negative number, an echo from 38 ms and a distance from 20 m
    are missing samples.
    """

    def __init__(self, **options: Any) -> None:
        self._form = _Form(**options)
        faults = {"garbage_bytes": 0, "bad_frame": 0, "partial_line": 0, "blank_line": 0}
        super().__init__(LineSplitter(b"\n", LONGEST, faults, skip_first=True))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return a line's numbers, or count why there are none."""
        text = frame.strip(b"\r ")
        if not text:
            self._count("blank_line", 0)
            return None
        form = self._form
        cells = split(text, form.separator)
        value = form.reading.number(text, cells)
        sequence, device_us = _whole(form.sequence, text, cells, 1.0), _whole(form.time, text, cells, form.time_us)
        if value is None or sequence is None or device_us is None:
            self._count("bad_frame", len(frame) + 1)
            return None
        celsius = None if form.temperature is None else form.temperature.number(text, cells)
        scaled = value * form.scale
        measured = scaled if 0 < scaled < (_LATEST_US if form.is_echo else _FARTHEST_M) else NAN
        echo_us, distance_m = (measured, NAN) if form.is_echo else (NAN, measured)
        return Reading(host_ns, sequence, device_us, echo_us, distance_m, NAN if celsius is None else celsius)


def _whole(column: Column | None, text: bytes, cells: list[bytes], scale: float) -> int | None:
    """Return a column as a whole number from 0, -1 where it is not asked for, None where it is not there."""
    if column is None:
        return -1
    value = column.number(text, cells)
    return None if value is None or not 0 <= value * scale < 2**63 else round(value * scale)


def _factor(option: str, unit: str, known: Mapping[str, float], *more: str) -> float:
    if unit not in known:
        raise SensorError(f"{option} of text-lines must be one of {', '.join([*known, *more])}, got {unit!r}")
    return known[unit]


class TextLinesEncoder:
    """Writes text lines as a decoder with the same options reads them."""

    def __init__(self, **options: Any) -> None:
        self._form = form = _Form(**options)
        asked = {"column": form.reading, "sequence": form.sequence, "time": form.time, "temperature": form.temperature}
        self._columns = {what: column for what, column in asked.items() if column is not None}

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one line; 0 for no target."""
        form = self._form
        value = echo_us if form.is_echo else distance_m / form.scale
        numbers = {
            "column": b"0" if math.isnan(distance_m) or math.isnan(value) else b"%.8g" % value,
            "sequence": b"%d" % sequence,
            "time": b"%.10g" % (device_us / form.time_us),
            "temperature": b"%.2f" % temperature_c,
        }
        placed = {column.index: numbers[what] for what, column in self._columns.items() if column.index is not None}
        cells = [placed.get(index, b"0") for index in range(max(placed, default=-1) + 1)]
        named = [column.name + b"=" + numbers[what] for what, column in self._columns.items() if column.index is None]
        return (form.separator or b",").join(cells + named) + b"\r\n"


FAMILY = Family(
    name="text-lines",
    title="text lines with a number, from a microcontroller's sketch",
    baud=9600,
    rate_hz=20.0,
    resolution_m=1e-3,
    range_m=(0.02, 4.0),
    limits="Column and unit are as the options say, and nothing in a line shows that a digit was changed.",
    decoder=TextLinesDecoder,
    encoder=TextLinesEncoder,
    options=_OPTIONS,
    source="the sketch",
)
