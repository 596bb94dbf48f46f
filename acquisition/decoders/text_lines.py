r"""Lines of text from a microcontroller's sketch: a number in a column, or after a name.

``12.34``, ``512;12.34``, ``t=512 d=12.34 cm``: which column, which unit and which separator is said by options,
because no line says it. A first line may have begun before the port was opened, and the end of a number is a number:
it is dropped and counted as ``partial_line``. A line without a number where one belongs is counted as ``bad_frame``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from acquisition.decoders.columns import Column, as_column, as_separator, split
from acquisition.decoders.family import Family
from acquisition.decoders.lines import LineSplitter
from acquisition.decoders.rows import NAN, rows
from acquisition.errors import SensorError
from acquisition.readings import Readings

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


class TextLinesDecoder:
    """Decodes text lines.

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

    Notes
    -----
    There is no checksum. A reading is a number in a line that was received from its beginning to its end; a flipped
    bit that makes another digit cannot be seen. Zero, a negative number, an echo from 38 ms and a distance from 20 m
    are missing samples.
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
        self._separator = as_separator(separator)
        self._is_echo = unit == "us"
        self._scale = 1.0 if self._is_echo else _factor("unit", unit, LENGTHS_M, "us")
        self._time_us = _factor("time_unit", time_unit, TIMES_US)
        self._reading = as_column("column", column, unit)
        self._sequence = None if sequence is None else as_column("sequence", sequence)
        self._time = None if time is None else as_column("time", time, time_unit)
        self._temperature = None if temperature is None else as_column("temperature", temperature, "C")
        self._faults = {"garbage_bytes": 0, "bad_frame": 0, "partial_line": 0, "blank_line": 0}
        self._lines = LineSplitter(b"\n", LONGEST, self._faults, skip_first=True)

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what was no reading."""
        return MappingProxyType(self._faults)

    @property
    def pending(self) -> int:
        """Bytes held until the line they began is whole."""
        return self._lines.pending

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the readings whose lines these bytes end."""
        found = [row for line in self._lines.split(data) if (row := self._row(line)) is not None]
        if not found:
            return rows(host_ns, distance_m=[])
        value, sequence, device_us, temperature_c = zip(*found, strict=True)
        return rows(
            host_ns,
            echo_us=value if self._is_echo else None,
            distance_m=None if self._is_echo else value,
            sequence=sequence,
            device_us=device_us,
            temperature_c=temperature_c,
        )

    def flush(self) -> None:
        """Forget a half-received line, and the one after: it may be the rest of it."""
        self._lines.flush()

    def _row(self, line: bytes) -> tuple[float, int, int, float] | None:
        """Return reading, sequence, device us and degC of a line, or count why there is none."""
        text = line.strip(b"\r ")
        if not text:
            self._faults["blank_line"] += 1
            return None
        cells = split(text, self._separator)
        value = self._reading.number(text, cells)
        sequence, time = _whole(self._sequence, text, cells, 1.0), _whole(self._time, text, cells, self._time_us)
        if value is None or sequence is None or time is None:
            self._faults["bad_frame"] += 1
            self._faults["garbage_bytes"] += len(line) + 1
            return None
        celsius = NAN if self._temperature is None else self._temperature.number(text, cells)
        return self._measured(value), sequence, time, NAN if celsius is None else celsius

    def _measured(self, value: float) -> float:
        scaled = value * self._scale
        return scaled if 0 < scaled < (_LATEST_US if self._is_echo else _FARTHEST_M) else NAN


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
        self._separator = as_separator(separator) or b","
        self._unit = unit
        self._scale = 1.0 if unit == "us" else _factor("unit", unit, LENGTHS_M, "us")
        self._time_us = _factor("time_unit", time_unit, TIMES_US)
        asked = {"column": column, "sequence": sequence, "time": time, "temperature": temperature}
        self._columns = {what: as_column(what, where) for what, where in asked.items() if where is not None}

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one line; 0 for no target."""
        value = echo_us if self._unit == "us" else distance_m / self._scale
        numbers = {
            "column": b"0" if math.isnan(distance_m) or math.isnan(value) else b"%.8g" % value,
            "sequence": b"%d" % sequence,
            "time": b"%.10g" % (device_us / self._time_us),
            "temperature": b"%.2f" % temperature_c,
        }
        placed = {column.index: numbers[what] for what, column in self._columns.items() if column.index is not None}
        cells = [placed.get(index, b"0") for index in range(max(placed, default=-1) + 1)]
        named = [column.name + b"=" + numbers[what] for what, column in self._columns.items() if column.index is None]
        return self._separator.join(cells + named) + b"\r\n"


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
