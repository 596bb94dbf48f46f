r"""Text lines from a microcontroller's sketch, with the reading as a number in a column or after a name.

Examples are ``12.34``, ``512;12.34`` and ``t=512 d=12.34 cm``. Options state the column, the unit and the separator,
because the lines do not. The port may be opened in the middle of a line, and the last digits of a number look like a
complete number. So the first line is dropped and counted as ``partial_line``. A line without the expected number is
counted as ``bad_frame``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from acquisition.decoders.family import Family
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.lines import LineSplitter
from acquisition.errors import SensorError
from acquisition.readings import NAN, Reading

LONGEST = 256  # maximum length of a line, bytes

LENGTHS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
TIMES_US = {"us": 1.0, "ms": 1e3, "s": 1e6}
SEPARATORS = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";", None: "", "any": ""}

_FARTHEST_M = 20.0  # no rangefinder in air receives an echo from this distance
_LATEST_US = 38_000.0  # an HC-SR04 reports this value if there was no echo

# float() alone would also accept "nan", "inf" and "1_0".
_NUMBER = rb"[+-]?(?:[0-9]{1,15}(?:\.[0-9]{0,12})?|\.[0-9]{1,12})(?:[eE][+-]?[0-9]{1,2})?"
_NAME = re.compile(r"[A-Za-z_][\w .-]{0,31}", re.ASCII)
_ANY = re.compile(rb"[\s,;]+")

Finder = Callable[[bytes, list[bytes]], float | None]
"""Finds a number in a line, which is given whole and as its cells."""


class TextLinesDecoder(FramedDecoder):
    """Decodes text lines; the arguments are the options of the family.

    There is no checksum. A number in a completely received line gives a reading, so a flipped bit that changes a digit
    to another digit cannot be detected. Zero, negative numbers, echo times of 38 ms or more and distances of 20 m or
    more are missing samples.
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
        faults = {"garbage_bytes": 0, "bad_frame": 0, "partial_line": 0, "blank_line": 0}
        super().__init__(LineSplitter(b"\n", LONGEST, faults, skip_first=True))
        self._separator = _separator(separator)
        self._is_echo = unit == "us"
        self._scale = 1.0 if self._is_echo else _factor("unit", unit, LENGTHS_M, "us")
        self._time_us = _factor("time_unit", time_unit, TIMES_US)
        self._value = _finder("column", column, unit)
        self._sequence = None if sequence is None else _finder("sequence", sequence)
        self._time = None if time is None else _finder("time", time, time_unit)
        self._temperature = None if temperature is None else _finder("temperature", temperature, "C")

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line, or None; count the fault of a line without a reading."""
        text = frame.strip(b"\r ")
        if not text:
            self._count("blank_line", 0)
            return None
        cells = text.split(self._separator) if self._separator else _ANY.split(text)
        value = self._value(text, cells)
        sequence = _whole(self._sequence, text, cells, 1.0)
        device_us = _whole(self._time, text, cells, self._time_us)
        if value is None or sequence is None or device_us is None:
            self._count("bad_frame", len(frame) + 1)
            return None
        celsius = None if self._temperature is None else self._temperature(text, cells)
        scaled = value * self._scale
        measured = scaled if 0 < scaled < (_LATEST_US if self._is_echo else _FARTHEST_M) else NAN
        echo_us, distance_m = (measured, NAN) if self._is_echo else (NAN, measured)
        return Reading(host_ns, sequence, device_us, echo_us, distance_m, NAN if celsius is None else celsius)


def _whole(find: Finder | None, text: bytes, cells: list[bytes], scale: float) -> int | None:
    """Return the scaled whole number in a column; -1 without a column, None without a valid number of at least 0."""
    if find is None:
        return -1
    value = find(text, cells)
    return None if value is None or not 0 <= value * scale < 2**63 else round(value * scale)


def _finder(option: str, where: int | str, unit: str = "") -> Finder:
    """Return what finds the number of a column, given by its index or by the name before it.

    Only the given unit may follow the number: a line with "12.3 cm" is refused if the unit is mm.
    """
    text = str(where).strip()
    tail = rb"(?:[ ]?" + re.escape(unit.encode()) + rb")?" if unit else b""
    if text.isdecimal() and text.isascii() and int(text) < 64:
        index, cell = int(text), re.compile(rb"(" + _NUMBER + rb")" + tail)

        def by_index(_: bytes, cells: list[bytes]) -> float | None:
            match = cell.fullmatch(cells[index].strip()) if index < len(cells) else None
            return None if match is None else float(match[1])

        return by_index
    if _NAME.fullmatch(text) is None:
        raise SensorError(f"{option} of text-lines must be a column from 0 to 63 or a name, got {where!r}")
    before, after = rb"(?:^|[\s,;:|])", rb"\s*[=:]\s*(" + _NUMBER + rb")" + tail + rb"(?=$|[\s,;|])"
    no_other_unit = rb"(?!\s+(?:m|cm|mm|in|us|ms|s)(?:$|[\s,;|]))" if unit else b""
    named = re.compile(before + re.escape(text.encode()) + after + no_other_unit)

    def by_name(line: bytes, _: list[bytes]) -> float | None:
        match = named.search(line)
        return None if match is None else float(match[1])

    return by_name


def _separator(text: str | None) -> bytes:
    """Return a separator as bytes; it is empty if blanks, commas and semicolons are all separators."""
    plain = SEPARATORS.get(text, text or "")
    if len(plain) > 1 or not plain.isascii() or (plain and plain in "\r\n.+-"):
        raise SensorError(f"separator of text-lines must be one character, tab or any, got {text!r}")
    return plain.encode()


def _factor(option: str, unit: str, known: Mapping[str, float], *more: str) -> float:
    if unit not in known:
        raise SensorError(f"{option} of text-lines must be one of {', '.join([*known, *more])}, got {unit!r}")
    return known[unit]


FAMILY = Family(
    name="text-lines",
    title="text lines with a number, from a microcontroller's sketch",
    baud=9600,
    rate_hz=20.0,
    resolution_m=1e-3,
    range_m=(0.02, 4.0),
    limits="Column and unit come from options, and a changed digit in a line cannot be detected.",
    decoder=TextLinesDecoder,
    options={
        "column": "of the reading: a number from 0, or a name as in d=12.3 (default 0)",
        "unit": "of the reading: m, cm, mm, in, or us for an echo time (default cm)",
        "separator": "between columns: one character, tab, or nothing for blanks, commas and semicolons",
        "sequence": "column of the device's counter, if it sends one",
        "time": "column of the device's clock, if it sends one",
        "time_unit": "of that clock: us, ms or s (default us)",
        "temperature": "column of a temperature in degC, if it sends one",
    },
    source="the sketch",
)
