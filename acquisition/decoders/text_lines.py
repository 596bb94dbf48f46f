r"""Text lines from a microcontroller's sketch, with the reading as a number in a column or after a name.

Examples are ``12.34``, ``512;12.34`` and ``t=512 d=12.34 cm``. Options state the column, the unit and the separator,
because the lines do not. The port may be opened in the middle of a line, and the last digits of a number look like a
complete number. So the first line is dropped and counted as ``partial_line``. A line without the expected number is
counted as ``bad_frame``.
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
"""Maximum length of a line, bytes."""

LENGTHS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
TIMES_US = {"us": 1.0, "ms": 1e3, "s": 1e6}

_FARTHEST_M = 20.0  # no rangefinder in air receives an echo from this distance
_LATEST_US = 38_000.0  # an HC-SR04 reports this value if there was no echo

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
    """The columns of a line; the parameters are the options of the family.

    Parameters
    ----------
    column, sequence, time, temperature : int or str, optional
        Number (from 0) or name of each column.
    unit : str
        Unit of the reading: m, cm, mm, in, or us for a round-trip echo time.
    separator : str, optional
        One character; by default blanks, commas and semicolons are separators.
    time_unit : str
        Unit of the time: us, ms or s.

    Raises
    ------
    SensorError
        If the value of an option is not allowed.
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
        Options of the family.

    Raises
    ------
    SensorError
        If the value of an option is not allowed.

    Notes
    -----
    There is no checksum. A number in a completely received line gives a reading, so a flipped bit that changes a digit
    to another digit cannot be detected. Zero, negative numbers, echo times of 38 ms or more and distances of 20 m or
    more are missing samples.
    """

    def __init__(self, **options: Any) -> None:
        self._form = _Form(**options)
        faults = {"garbage_bytes": 0, "bad_frame": 0, "partial_line": 0, "blank_line": 0}
        super().__init__(LineSplitter(b"\n", LONGEST, faults, skip_first=True))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line, or None; count the fault of a line without a reading."""
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
    """Return the scaled whole number in a column; -1 without a column, None without a valid number of at least 0."""
    if column is None:
        return -1
    value = column.number(text, cells)
    return None if value is None or not 0 <= value * scale < 2**63 else round(value * scale)


def _factor(option: str, unit: str, known: Mapping[str, float], *more: str) -> float:
    if unit not in known:
        raise SensorError(f"{option} of text-lines must be one of {', '.join([*known, *more])}, got {unit!r}")
    return known[unit]


class TextLinesEncoder:
    """Encodes readings as text lines for a decoder with the same options."""

    def __init__(self, **options: Any) -> None:
        self._form = form = _Form(**options)
        chosen = {"column": form.reading, "sequence": form.sequence, "time": form.time, "temperature": form.temperature}
        self._columns = {what: column for what, column in chosen.items() if column is not None}

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one line; the value 0 means no target."""
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
    limits="Column and unit come from options, and a changed digit in a line cannot be detected.",
    decoder=TextLinesDecoder,
    encoder=TextLinesEncoder,
    options=_OPTIONS,
    source="the sketch",
)
