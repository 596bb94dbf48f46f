r"""Text lines from a microcontroller's sketch: the distance has a name or a unit, is alone, or its column is stated.

Examples are ``12.34``, ``Distance: 26.9 cm``, ``(19.124,)``, ``t=512 d=12,34`` and, with ``column=1``, ``512;12.34``;
see :mod:`acquisition.line_numbers`. The port may be opened in the middle of a line, and the last digits of a number
look like a complete number. So the first line is dropped and counted as ``partial_line``. A line without a distance is
counted as ``bad_frame``.
"""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from acquisition.decoders.decoder import Guess
from acquisition.decoders.frames import FramedDecoder, LineSplitter
from acquisition.decoders.sensor import Sensor
from acquisition.errors import SensorError
from acquisition.line_numbers import (
    LENGTHS_M,
    TIMES_US,
    UPTIME,
    Number,
    find_distance,
    has_decimal_comma,
    numbers,
    uncoloured,
)
from acquisition.readings import NAN, Reading

LONGEST_TEXT_LINE = 256  # maximum length of a line, bytes

SEPARATORS = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";", None: "", "any": ""}

_FARTHEST_M = 20.0  # no rangefinder in air receives an echo from this distance
_LATEST_US = 38_000.0  # an HC-SR04 reports this value if there was no echo
_ECHO_M_PER_US = 172e-6
# So many steps in a row of a lone number, equal to this share, are those of a counter, or suspect at the beginning.
_COUNTS, _EVEN, _SUSPECT = 50, 0.02, 12
_NAME = re.compile(r"[A-Za-z_][\w .-]{0,31}", re.ASCII)
OTHER_ENDS = (b"\r", b"*/", b"\x03")  # a carriage return alone, the end of a frame of Serial Studio, and ETX
_NOTED = 1000  # number of first distances that may raise a question
_WORDS = re.compile("[\x80-\xff]+")
_BESIDE_DIGIT = re.compile("[\x80-\xff][0-9.+-]|[0-9.+-][\x80-\xff]|(?<![\x80-\xff])[\x80-\xff](?![\x80-\xff])")
_NO_TARGET = re.compile(
    r"out of range|fuera de|fora d[eo]|au(?:ß|ss)er|hors de|no (?:echo|target)|kein (?:echo|ziel)|timed? ?out",
    re.IGNORECASE,
)

NumberedLine = tuple[str, list[Number], list[tuple[int, int]]]
"""A line, its numbers, and where its cells begin and end."""


class TextLinesDecoder(FramedDecoder):
    """Decodes text lines; the arguments are the options of the family.

    There is no checksum. A number in a completely received line gives a reading, so a flipped bit that changes a digit
    to another digit cannot be detected. Zero, negative numbers, echo times of 38 ms or more, distances of 20 m or more
    and lines such as ``out of range`` are missing samples. A lone number that counts evenly is a clock or a counter.

    ``resolution_m`` is the step of the last digit of the distances so far, m; None before the first.
    """

    def __init__(
        self,
        column: int | str = "auto",
        unit: str | None = None,
        separator: str | None = None,
        sequence: int | str | None = None,
        time: int | str | None = None,
        time_unit: str | None = None,
        temperature: int | str | None = None,
    ) -> None:
        faults = {"garbage_bytes": 0, "bad_frame": 0, "partial_line": 0, "blank_line": 0}
        super().__init__(LineSplitter(b"\n", LONGEST_TEXT_LINE, faults, skip_first=True, other_ends=OTHER_ENDS))
        _demand("unit", unit, {**LENGTHS_M, "us": 1.0})
        _demand("time_unit", time_unit, TIMES_US)
        self._unit, self._clock = unit or "", _PrintedClock(time_unit)
        self._separator = _separator(separator)
        self._column = None if column == "auto" else _place("column", column)
        self._sequence, self._time, self._temperature = (
            None if where is None else _place(option, where)
            for option, where in (("sequence", sequence), ("time", time), ("temperature", temperature))
        )
        self._last = self._step = 0.0
        self._steps = 0
        self._names: Counter[tuple[str, str]] = Counter()  # words before the distances, each with its unit
        self._span: tuple[float, ...] = ()  # the smallest and the largest of the distances without a unit

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line, or None; count the fault of a line without a reading."""
        text = _text(frame)
        if not text:
            noise = bool(frame.strip(b"\r "))
            self._count("bad_frame" if noise else "blank_line", len(frame) + 1 if noise else 0)
            return None
        line = self._numbered(text)
        # Before the first distance nothing shows that such lines stand for one.
        silent = self._column is None and _NO_TARGET.search(text) is not None
        number = None if silent else self._distance(line)
        silent = silent and self.resolution_m is not None
        sequence = _whole(self._sequence, line)
        where: str | int | None = self._time
        if where is None and text.startswith(UPTIME):
            where = UPTIME[:-1]
        device_us = self._clock.read(where, line)
        if sequence is None or device_us is None or (number is None and not silent):
            self._count("bad_frame", len(frame) + 1)
            return None
        celsius = None if self._temperature is None else _at(self._temperature, line)
        warm = celsius.value if celsius is not None and celsius.unit in ("C", "") else NAN
        echo_us = distance_m = NAN
        if number is not None and not self._is_counter(number):
            self._note(number)
            unit = number.unit or self._unit or "cm"
            scale = 1.0 if unit == "us" else LENGTHS_M[unit]
            scaled = number.value * scale
            measured = scaled if 0 < scaled < (_LATEST_US if unit == "us" else _FARTHEST_M) else NAN
            echo_us, distance_m = (measured, NAN) if unit == "us" else (NAN, measured)
            if measured == measured:
                step_m = number.step * (_ECHO_M_PER_US if unit == "us" else scale)
                self.resolution_m = min(step_m, self.resolution_m or step_m)
        return Reading(host_ns, sequence, device_us, echo_us, distance_m, warm)

    @property
    def undecided(self) -> bool:
        """Whether the numbers so far may still be those of a counter or of several sensors."""
        return 1 < self._steps <= _SUSPECT or (len(self._names) > 1 and self._names.total() < _SUSPECT)

    @property
    def refused(self) -> bool:
        """Whether the numbers count evenly, as no distance does for long, are of several sensors, or are metres."""
        return self._steps > _SUSPECT or bool(self._in_turn) or self._may_be_metres

    @property
    def assumed_unit(self) -> str:
        """``cm`` if no unit was printed or stated."""
        return "cm" if self._span else ""

    def _note(self, number: Number) -> None:
        """Note the words before a distance and its size, from which a question may follow."""
        if self._names.total() < _NOTED:
            if self._column is None:
                self._names[" ".join(number.before.split()).strip(" :=>").strip(), number.unit] += 1
            if not (number.unit or self._unit):
                self._span = min((number.value, *self._span)), max((number.value, *self._span))

    @property
    def _in_turn(self) -> list[str]:
        """Names of which each is before at least a quarter of the distances of one unit; empty if it is one name."""
        total = self._names.total()
        often = [key for key, count in self._names.items() if key[0] and count >= max(3, total // 4)]
        named = [name for name, unit in often if sum(unit == each for _, each in often) > 1]
        return sorted(named) if total >= _SUSPECT else []

    @property
    def _may_be_metres(self) -> bool:
        """Whether numbers without a unit would be nearer than any sensor of this kind measures, if they were cm."""
        return bool(self._span) and self._span[0] > 0.0 and self._span[1] < 100.0 * FAMILY.range_m[0]

    def unread(self, data: bytes) -> Guess:
        """Return what the lines look like that gave no reading, and which options would read them."""
        self.feed(0, data)
        if self._in_turn:
            names = ", ".join(self._in_turn)
            return Guess(f"looks like lines of several sensors in turn ({names})", ({"column": self._in_turn[0]},))
        if self._may_be_metres:
            looks = "looks like distances without a unit ({:g} to {:g}), too short for cm".format(*self._span)
            return Guess(looks, ({"unit": "m"},), ("if they are metres",))
        splitter = LineSplitter(b"\n", LONGEST_TEXT_LINE, {"garbage_bytes": 0, "bad_frame": 0}, other_ends=OTHER_ENDS)
        lines = [text for line in splitter.split(data)[1:] if (text := _text(line))]
        distance_lines = [line for line in map(self._numbered, lines) if not all(number.is_other for number in line[1])]
        if not distance_lines:
            return Guess(f"looks like text lines without a distance ({(lines or [''])[0][:40]!r})")
        text, in_line, cells = distance_lines[-1]
        quoted = f"looks like text lines with numbers ({text[:40]!r})"
        if self._column is not None and _at(self._column, distance_lines[-1]) is None:
            listed = ", ".join(f"{_cell(each, cells)} is {each.value:g}" for each in in_line[:8])
            return Guess(f"{quoted}, none at column {self._column}: of the columns, counted from 0, {listed}")
        units = {number.unit for number in in_line if number.unit in LENGTHS_M}
        if units and self._unit and self._unit not in units:
            return Guess(f"{quoted}, whose unit is {' and '.join(sorted(units))} and not {self._unit} as stated")
        if has_decimal_comma(text, self._separator) is None:
            roles = "if the comma is a decimal comma", "if it separates the distance"
            return Guess(quoted, ({"separator": "space"}, {"separator": "comma", "column": "1"}), roles)
        even = {cell for cell in (_cell(each, cells) for each in in_line) if _counts(cell, distance_lines)}
        likely = [each for each in in_line if not each.is_other and _cell(each, cells) not in even] or in_line
        if len(in_line) == 1 and even:
            return Guess(f"{quoted} that count evenly: a clock or a counter; let the sketch print the distance")
        options = {"column": str(_cell(likely[0], cells)), **({} if likely[0].unit else {"unit": "cm"})}
        options |= {"time": str(min(even)), "time_unit": "ms"} if even else {}
        return Guess(f"{quoted}, of which one is the distance", (options,), ("if these are its column and unit",))

    def _numbered(self, text: str) -> NumberedLine:
        comma = has_decimal_comma(text, self._separator)
        separator = re.escape(self._separator) if self._separator else r"[\s;]+" if comma else r"[\s,;]+"
        ends = [match.span() for match in re.finditer(separator, text)]
        cells = list(zip([0, *(end for _, end in ends)], [*(start for start, _ in ends), len(text)], strict=True))
        return text, numbers(text, decimal_comma=bool(comma), colon_separates=self._separator == ":"), cells

    def _distance(self, line: NumberedLine) -> Number | None:
        text, in_line, _ = line
        if self._column is not None:
            number = _at(self._column, line)
            allowed = ("", self._unit) if self._unit else ("", *LENGTHS_M, "us")
            return number if number is not None and number.unit in allowed else None
        if has_decimal_comma(text, self._separator) is None:
            return None
        others = [_at(where, line) for where in (self._sequence, self._time, self._temperature) if where is not None]
        return find_distance(text, [number for number in in_line if number not in others], self._unit)

    def _is_counter(self, number: Number) -> bool:
        """Return whether a number without a name and a unit has counted evenly for a while."""
        if self._column is not None or number.label or number.unit:
            return False
        step = number.value - self._last
        if not (step > 0.0 and abs(step - self._step) <= _EVEN * self._step):
            self._step, self._steps = step, 0
        self._last, self._steps = number.value, self._steps + 1
        counts = self._steps > _COUNTS
        self.status.complaint = (
            "the number in the lines counts evenly, so it is no distance: print the distance" if counts else ""
        )
        return counts


def _text(line: bytes) -> str:
    """Return the text of a line, empty if it is noise, which may have digits too."""
    try:
        text = uncoloured(line.decode().strip("\x02 \t\r"))
    except UnicodeDecodeError:
        text = line.decode("latin-1").strip()
        if sum(letter > "~" for letter in text) > 2:
            # Noise, and text with a parity bit, have such bytes singly or next to digits, and words in runs.
            if min(len(word) for word in _WORDS.findall(text)) >= 4:
                with contextlib.suppress(UnicodeDecodeError):
                    text = line.decode("gb2312").strip()
            text = text if not _WORDS.search(text) or _BESIDE_DIGIT.search(text) else _WORDS.sub("\u25a1", text)
            if _WORDS.search(text):
                return ""
    return text if text.replace("\t", " ").isprintable() else ""


def _at(where: int | str, line: NumberedLine) -> Number | None:
    """Return the number in a cell, given by its index, or behind a name; None unless it is the only one there."""
    _, in_line, cells = line
    if isinstance(where, int):
        begin, end = cells[where] if where < len(cells) else (0, 0)
        named = [number for number in in_line if begin <= number.start < end]
    else:
        name = re.escape(where) + r"[\"')\] ]*(?:[(\[][^\W\d_]+[)\]])?[\"' ]*[:=]?[\"'\s]*$"
        named = [number for number in in_line if re.search(r"(?<!\w)" + name, number.before)]
        named = named or [each for each in in_line if re.search(r"(?<!\w)" + name, each.before, re.IGNORECASE)]
    return named[0] if len(named) == 1 else None


def _cell(number: Number, cells: list[tuple[int, int]]) -> int:
    return next(index for index, (begin, end) in enumerate(cells) if begin <= number.start <= end)


def _counts(cell: int, lines: list[NumberedLine]) -> bool:
    """Return whether the numbers of a cell count evenly, apart from lines that were lost."""
    values = [number.value for line in lines if (number := _at(cell, line)) is not None]
    steps = [b - a for a, b in pairwise(values)]
    return len(steps) >= 4 and min(steps) > 0 and sorted(steps)[3 * len(steps) // 4] <= 1.5 * min(steps)


def _whole(where: int | str | None, line: NumberedLine) -> int | None:
    """Return the number in a column, rounded; -1 without a column, None without a valid number of at least 0."""
    if where is None:
        return -1
    number = _at(where, line)
    return round(number.value) if number is not None and 0 <= number.value < 2**63 else None


class _PrintedClock:
    """Reads a printed time, which may go on from its largest to its smallest number of 16 or 32 bits, also below 0."""

    def __init__(self, unit: str | None) -> None:
        self._unit = unit
        self._last = self._step = self._turns = 0.0
        self._first = True

    def read(self, where: int | str | None, line: NumberedLine) -> int | None:
        """Return the time in a column, us; -1 without a column, None without a time."""
        if where is None:
            return -1
        number = _at(where, line)
        if number is None:
            return None
        scale = TIMES_US[self._unit] if self._unit else TIMES_US.get(number.unit, 1.0)
        value, step = number.value, number.value - self._last
        if self._first:
            self._first, step = False, 0.0
            if value < 0:
                self._turns = 2.0**16 if value >= -(2.0**15) else 2.0**32
        for turn in (2.0**16, 2.0**32):
            # Time goes on over a turn by about the step before; a board that restarts begins anywhere near 0.
            if step < -0.5 * turn and 0.0 < step + turn <= max(20.0 * self._step, 1e6 / scale) and self._at_end(turn):
                self._turns, step = self._turns + turn, step + turn
        self._last, self._step = value, step if step > 0.0 else self._step
        scaled = (value + self._turns) * scale
        return round(scaled) if 0 <= scaled < 2**63 else None

    def _at_end(self, turn: float) -> bool:
        near = 0.05 * turn
        return min(abs(self._last - 0.5 * turn), abs(self._last - turn)) <= near


def _place(option: str, where: int | str) -> int | str:
    """Return a column as an index or as the name before its number."""
    text = str(where).strip()
    if text.isdecimal() and text.isascii() and int(text) < 64:
        return int(text)
    if _NAME.fullmatch(text) is None:
        raise SensorError(f"{option} of text-lines must be a column from 0 to 63 or a name, got {where!r}")
    return text


def _separator(text: str | None) -> str:
    """Return a separator; it is empty if blanks, commas and semicolons are all separators."""
    plain = SEPARATORS.get(text, text or "")
    if len(plain) > 1 or not plain.isascii() or (plain and plain in "\r\n.+-"):
        raise SensorError(f"separator of text-lines must be one character, tab or any, got {text!r}")
    return plain


def _demand(option: str, unit: str | None, allowed: Mapping[str, Any]) -> None:
    if unit is not None and unit not in allowed:
        raise SensorError(f"{option} of text-lines must be one of {', '.join(allowed)}, got {unit!r}")


FAMILY = Sensor(
    name="text-lines",
    title="text lines with a number, from a microcontroller's sketch",
    baud=9600,
    rate_hz=20.0,
    resolution_m=1e-3,
    range_m=(0.02, 4.0),
    limits="Resolution is that of the digits in the lines, and a changed digit in a line cannot be detected.",
    decoder=TextLinesDecoder,
    options={
        "column": "of the distance: a number from 0, or a name as in d=12.3 (default: the named or only distance)",
        "unit": "of the distance: m, cm, mm, in, or us for an echo time (default: the unit in the line, else cm)",
        "separator": "between columns: one character, tab, or nothing for blanks, commas and semicolons",
        "sequence": "column of the device's counter, if it sends one",
        "time": "column of the device's clock, if it sends one",
        "time_unit": "of that clock: us, ms or s (default: the unit in the line, else us)",
        "temperature": "column of a temperature in degC, if it sends one",
    },
    past_defaults={"column": 0},
    source="the sketch",
)
