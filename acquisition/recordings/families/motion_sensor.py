"""MotionSensor.vi: the text files of a LabVIEW front panel for an ultrasonic rangefinder.

A file contains position (``Time (s)``, ``Distance (cm)``, ``Dist Error (cm)``) or velocity (``Time (s)``,
``Velocity (cm/s)``), tab separated, with three decimals, usually without a line end after the last row. The title and
the column line may have been edited or deleted; then the shape of the rows decides. What is easy to misread:

- Times are row numbers divided by a nominal rate, rounded to a millisecond.
- The error column is a constant, tens of times larger than the noise.
- Velocity is the backward difference of the unrounded position over one sample.
- Position and velocity files may differ in length and window: they are joined by time, never by row.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import PurePath
from typing import Literal, NamedTuple

import numpy as np

from acquisition.block import I8, Block, Flag
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.base import Survey
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.recordings.sampling.nominal import median, time_flags
from acquisition.recordings.sampling.samples import IRREGULAR, UNREAD_FLAGS, value_traps
from acquisition.recordings.sampling.velocity import find_quantum, find_tick, integrate, outer_join
from acquisition.recordings.tables.cells import EMPTY, UNREAD, parse_number, scaled
from acquisition.recordings.tables.channel import Samples, read_channel
from acquisition.recordings.tables.choose import Answers
from acquisition.recordings.tables.headings import guess_delimiter, is_time, name_and_unit, split_cells
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Column, Table
from acquisition.recordings.tables.text import head_lines, text_of
from acquisition.recordings.units import LENGTHS

Quantity = Literal["distance", "velocity"]

_TITLE, _TIME = "motion sensor data file", "time (s)"
_DISTANCE = {f"distance ({unit})": unit for unit in LENGTHS}
_ERROR = {f"{name} error ({unit})": unit for unit in LENGTHS for name in ("dist", "distance")}
_VELOCITY = {f"velocity ({unit}/s)": unit for unit in LENGTHS}
_CHANNELS: dict[str, Quantity] = {"distance": "distance", "position": "distance", "velocity": "velocity"}
_HEADER_LINES = 20
_ROWS_OF_SHAPE = 100
_CONSTANT = 0.95
_REMEDY = 'put the column line "Time (s)<TAB>Distance (cm)" or "Time (s)<TAB>Velocity (cm/s)" above the rows'


class Layout(NamedTuple):
    """The meaning of the columns, below ``lines`` lines.

    A row has ``columns`` cells: time, the quantity, and, if there are three, its error. ``unit`` is a length, "cm" also
    for velocities in cm/s. ``assumed`` is the meaning that the rows or the user indicate if there is no column line.
    """

    quantity: Quantity
    columns: int
    unit: str
    lines: int = 0
    assumed: str = ""
    title: str = ""


class File(NamedTuple):
    """One file that was read, in m or m/s.

    ``quantum`` is the step of which all distances are multiples, and ``error_m`` the usual stated error; ``found`` are
    the remarks on both.
    """

    path: str
    data: bytes
    reading: Samples
    quantum: float
    error_m: float | None
    found: tuple[Trap, ...]

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return PurePath(self.path).name

    @property
    def quantity(self) -> str:
        """What the file holds."""
        return self.reading.column.name

    def step(self) -> float:
        """Return the change of position in one sample (m) of which all velocities are multiples."""
        samples, tick = self.reading, self.tick()
        return (find_quantum(samples.value, tick) if tick else samples.resolution) / samples.timing.rate_hz

    def tick(self) -> float | None:
        """Return the step (m or m/s) of which all values are multiples; None if there is no evident step."""
        return find_tick(self.reading.value, self.reading.resolution)

    def recording(self, block: Block, quantum_m: float, more: Iterable[Trap] = ()) -> Recording:
        """Return the recording of a block."""
        found = (*self.found, *more)
        return self.reading.recording(MotionSensor.name, self.path, self.data, block, quantum_m, found, self.error_m)


class MotionSensor:
    """The MotionSensor.vi family."""

    name = "motion-sensor"
    title = "MotionSensor.vi text: position, velocity, or one of each"

    def evidence(self, head: bytes) -> str:
        """Return the evidence: the title, the column line, or the shape of rows without either."""
        lines = head_lines(head)
        for number, line in enumerate(lines[:_HEADER_LINES], 1):
            if _is_title(line):
                return f'line {number} is the title "{line.strip()}"'
        if layout := _column_line(lines):
            return f"line {layout.lines} is the column line of {layout.quantity} in {layout.unit}"
        start = _first_row(lines[:2])
        shape = _shape(lines[start:]) if start >= 0 and not (start and _names_others(*lines[:2])) else None
        return f"the rows have the shape of {shape.assumed}" if shape else ""

    def recognises(self, head: bytes) -> bool:
        """Return whether there is evidence for this family."""
        return bool(self.evidence(head))

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the only channel of a file; an empty tuple if the user must state the meaning of the numbers."""
        try:
            file = _read(path, data, Answers())
        except NeedsAnswer:
            return ()
        column, samples = file.reading.column, file.reading
        traps = (*file.reading.traps, *file.found)
        return (Survey("", column.name, column.unit, samples.t.size, samples.timing.rate_hz, traps),)

    def read(
        self,
        path: str,
        data: bytes,
        *,
        channel: str | None = None,
        rate_hz: float | None = None,
        unit: str | None = None,
        run: str | None = None,
        time: str | None = None,
        time_unit: str | None = None,
    ) -> Recording:
        """Read one file, either of position or of velocity; see :class:`springmass.extend.Format`."""
        file = _read(path, data, Answers(channel, rate_hz, unit, run, time, time_unit))
        if file.quantity == "velocity":
            return _velocity_alone(file)
        samples = file.reading
        return file.recording(Block(0, samples.t, file.reading.value, samples.flags), file.quantum)

    def read_pair(
        self, position: tuple[str, bytes], velocity: tuple[str, bytes], *, rate_hz: float | None = None
    ) -> Recording:
        """Join a position file and a velocity file by time; they may be given in either order."""
        files = []
        for path, data in (position, velocity):
            try:
                files.append(_read(path, data, Answers(rate_hz=rate_hz)))
            except NeedsAnswer as error:
                if Missing.CHANNEL not in error.question.missing:
                    raise
                raise _no_column_line(path, "two columns in a file of a pair", error.line) from None
        a, b = files
        if a.quantity == b.quantity:
            problem = f"expected a position and a velocity file, got {a.quantity} in both ({a.name} too)"
            raise FormatError(b.path, problem, "name the other file of the pair")
        return _join(a, b) if a.quantity == "distance" else _join(b, a)


FORMAT = MotionSensor()


def _read(path: str, data: bytes, answers: Answers) -> File:
    text = text_of(path, data)
    head = text.head(_HEADER_LINES + _ROWS_OF_SHAPE)
    layout = _find_layout(path, [line.text for line in head], answers.channel, answers.unit)
    first, below = head[layout.lines], [line.text for line in head[layout.lines :] if line.text.strip()]
    delimiter = guess_delimiter(next(filter(_is_row, below), below[0]))
    table = read_rows(path, text, first, delimiter)
    read, lines, traps = table.columns, table.lines, table.traps
    assert lines
    if len(read) < layout.columns:
        raise _no_rows(path, first.number, f"rows of {layout.columns} numbers")
    columns = [each.of_size(lines.rows) for each in read]
    # Every cell of a row must be a number, and nothing may follow them.
    forms = np.array([each.forms for each in columns])
    damaged = (forms[: layout.columns] <= EMPTY).any(axis=0) | (forms[layout.columns :] != EMPTY).any(axis=0)
    if layout.assumed:
        message = f"no column line: read as time (s) and {layout.assumed}, in {layout.unit}"
        traps += (Trap("unit_assumed", message),)
    unit, velocity = layout.unit, layout.quantity == "velocity"
    value = Column(layout.quantity, unit + "/s" * velocity, columns[1].values, np.where(damaged, UNREAD, forms[1]))
    times = replace(columns[0], name="time", unit="s")
    lines = lines._replace(cut=not lines.ended and bool(damaged[-1]))
    table = Table((value,), times, title=layout.title, traps=traps, lines=lines, beside=(times, value))
    reading = read_channel(path, [table], replace(answers, channel=None, unit=None), difference=velocity)
    found, error_m = [], None
    if layout.columns == 3:
        errors = scaled(columns[2].values, columns[2].decimals, reading.measured.power)[reading.sound]
        errors = errors[np.isfinite(errors)]
        error_m = median(errors) if errors.size else None
        if error_m is not None and np.mean(errors == error_m) >= _CONSTANT:
            size = f"{error_m / 10.0**reading.measured.power:g} {unit}"
            message = f"the error column is a constant {size}: a stated value, not the noise"
            found.append(Trap("stated_error_is_not_noise", message))
        elif error_m is not None and layout.assumed:
            raise _no_column_line(path, "three columns that all vary", first.number)
    quantum = resolution = reading.resolution
    if not velocity:
        quantum, seen = value_traps(reading.value, reading.flags, resolution, reading.line)
        found.extend(seen)
    return File(path, data, reading, quantum, error_m, tuple(found))


def _find_layout(path: str, lines: Sequence[str], channel: str | None, unit: str | None) -> Layout:
    """Return the meaning of the rows, or ask for it if nothing shows it."""
    if channel is not None and channel.lower() not in _CHANNELS:
        raise FormatError(path, f'channel must be distance or velocity, got "{channel}"', "name one of these")
    wanted = None if channel is None else _CHANNELS[channel.lower()]
    stated = None if unit is None else unit.strip().removesuffix("/s")
    layout = _column_line(lines)
    if layout is None:
        layout = _by_shape(path, lines, wanted)
        if stated is not None and stated not in LENGTHS:
            raise FormatError(path, f'unit must be one of {", ".join(LENGTHS)}, got "{unit}"', "name one of these")
        layout = layout._replace(unit=stated or layout.unit)
    if stated is not None and stated != layout.unit:
        problem = f'unit must be {layout.unit} as stated by the column line, got "{unit}"'
        raise FormatError(path, problem, "leave the unit out", line=layout.lines)
    if wanted and wanted != layout.quantity:
        problem = f'channel must be {layout.quantity}, which the file holds, got "{channel}"'
        raise FormatError(path, problem, "leave the channel out or name the other file")
    if not any(line.strip() for line in lines[layout.lines :]):
        raise _no_rows(path, len(lines), "rows of numbers below the column line")
    return layout


def _by_shape(path: str, lines: Sequence[str], wanted: Quantity | None) -> Layout:
    """Return the layout that the shape of the rows or the user indicates."""
    start = _first_row(lines)
    if start < 0:
        raise _no_rows(path, len(lines), "rows of two or three numbers")
    columns, layout = len(_numbers(lines[start])), _shape(lines[start:])
    if layout is None and columns == 2 and wanted:
        layout = Layout(wanted, 2, "cm", assumed=f"{wanted}, as stated by the user")
    if layout is None:
        got = f"{columns} columns" + (" under the title" if any(map(_is_title, lines[:_HEADER_LINES])) else "")
        if columns != 2:
            raise _no_column_line(path, got, start + 1)
        need = MissingItem(Missing.CHANNEL, ("distance", "velocity"), "distance")
        reason = f"no column line names the columns, got {got}"
        raise NeedsAnswer(Question(path, (need,), reason=reason), line=start + 1)
    # Line 1 is the title, unless it is a row or looks like a damaged row.
    titled = start and (_is_title(lines[0]) or _numbers(lines[0])[:1] in ([], [None]))
    return layout._replace(lines=1, title=lines[0].strip()) if titled else layout


def _no_column_line(path: str, got: str, line: int | None = None) -> FormatError:
    return FormatError(path, f"expected a column line that names the columns, got {got}", _REMEDY, line=line)


def _no_rows(path: str, line: int, problem: str) -> FormatError:
    return FormatError(path, f"expected {problem}, got none", "check that the export ended", line=max(line, 1))


def _column_line(lines: Sequence[str]) -> Layout | None:
    """Find the column line above the first row."""
    for at, line in enumerate(lines[:_HEADER_LINES], 1):
        if _is_row(line):
            return None
        cells = [cell.strip().lower() for cell in split_cells(line, guess_delimiter(line) or "\t")]
        title = " / ".join(line.strip() for line in lines[: at - 1] if line.strip())
        if 2 <= len(cells) <= 3 and cells[0] == _TIME:
            if (unit := _VELOCITY.get(cells[1])) and len(cells) == 2:
                return Layout("velocity", 2, unit, at, title=title)
            if (unit := _DISTANCE.get(cells[1])) and (len(cells) == 2 or _ERROR.get(cells[2]) == unit):
                return Layout("distance", len(cells), unit, at, title=title)
    return None


def _names_others(above: str, row: str) -> bool:
    """Return whether a line names all columns of the row below it, in words that this family does not use."""
    mark = guess_delimiter(row)
    names = split_cells(above.lstrip("\ufeff#% "), mark)
    return len(names) == len(split_cells(row, mark)) and (bool(mark) or is_time(name_and_unit(names[0])[0]))


def _is_title(line: str) -> bool:
    return line.lstrip().lower().startswith(_TITLE)


def _numbers(line: str) -> list[float | None]:
    return [parse_number(cell) for cell in split_cells(line, guess_delimiter(line))]


def _is_row(line: str) -> bool:
    numbers = _numbers(line)
    return len(numbers) >= 2 and None not in numbers


def _first_row(lines: Sequence[str]) -> int:
    return next((at for at, line in enumerate(lines[:_HEADER_LINES]) if _is_row(line)), -1)


def _shape(lines: Sequence[str]) -> Layout | None:
    """Infer the layout from the rows alone: a constant third column is the error, an initial NaN means velocity."""
    every = [_numbers(line) for line in lines[:_ROWS_OF_SHAPE] if line.strip()]
    rows = [[x for x in row if x is not None] for row in every if None not in row]
    three, two = ([row for row in rows if len(row) == n] for n in (3, 2))
    usual_rows = three if len(three) > len(two) else two
    forward = sum(a[0] < b[0] for a, b in pairwise(usual_rows))
    if len(usual_rows) < 3 or usual_rows[0][0] < 0 or forward < 0.5 * (len(usual_rows) - 1):
        return None
    if usual_rows is three:
        third = [row[2] for row in three]
        usual = max(set(third), key=third.count)
        if usual > 0 and third.count(usual) >= _CONSTANT * len(third):
            assumed = "distance and its error, because the third column is constant"
            return Layout("distance", 3, "cm", assumed=assumed)
    elif rows[0] == two[0] and math.isnan(two[0][1]) and not math.isnan(two[1][1]):
        return Layout("velocity", 2, "cm", assumed="velocity, because the first value is NaN")
    return None


def _velocity_alone(file: File) -> Recording:
    """Integrate velocity to position; the first sample is at zero, because the file does not contain the offset."""
    samples, value = file.reading, file.reading.value
    rate_hz, flags = samples.timing.rate_hz, samples.flags.copy()
    regular = np.flatnonzero((flags & IRREGULAR) == 0)
    index = np.rint(samples.t[regular] * rate_hz).astype(np.int64)
    position, bridged = integrate(value[regular], index, rate_hz, file.tick(), samples.resolution / 2)
    distance = np.full(samples.t.size, np.nan)
    distance[regular] = position
    flags[regular[bridged]] |= Flag.GAP_BEFORE.value
    flags[np.isnan(distance)] |= Flag.MISSING.value
    summed = "the position was integrated from the velocity: its offset is unknown, and the first sample is at 0 m"
    traps = [Trap("offset_unknown", summed, samples.t.size)]
    if holes := int(np.count_nonzero(bridged)):
        first = float(samples.t[regular[bridged]][0])
        gaps = f"{holes} gap{'s' if holes > 1 else ''}, the first before t = {first:g} s"
        message = f"the velocity has {gaps}: the integrated position may jump there"
        traps.append(Trap("offset_unknown_after_gap", message, holes))
    return file.recording(Block(0, samples.t, distance, flags, None, value), file.step(), traps)


def _join(position: File, velocity: File) -> Recording:
    p, v = position.reading, velocity.reading
    rate_hz = p.timing.rate_hz
    if abs(v.timing.rate_hz - rate_hz) > 1e-6 * rate_hz:
        problem = f"expected {rate_hz:g} Hz as in {position.name}, got {v.timing.rate_hz:g} Hz"
        raise FormatError(velocity.path, problem, "name the velocity file of the same run")
    resolution = min(p.timing.resolution_s, v.timing.resolution_s)
    keys = [np.rint(t / resolution).astype(np.int64) for t in (p.t, v.t)]
    from_p, from_v = outer_join(keys[0], keys[1], (p.flags & IRREGULAR) == 0)
    in_p, in_v = from_p >= 0, from_v >= 0
    if not (in_p & in_v).any():
        problem = f"expected times in common with {position.name}, got none"
        raise FormatError(velocity.path, problem, "name the velocity file of the same run")
    t = np.where(in_p, p.t[from_p], v.t[from_v])
    distance, speed = np.where(in_p, p.value[from_p], np.nan), np.where(in_v, v.value[from_v], np.nan)
    flags = time_flags(t, 1.0 / rate_hz)
    flags |= np.where(in_p, p.flags[from_p], v.flags[from_v]) & UNREAD_FLAGS
    flags[~in_p] |= Flag.MISSING.value
    quantum_m = velocity.step() if velocity.tick() else position.quantum
    block = Block(0, t, distance, flags, None, speed)
    joined = position.recording(block, quantum_m, _join_traps(position, velocity, from_p, from_v))
    return replace(
        joined,
        malformed_rows=int(np.count_nonzero(~p.sound)) + int(np.count_nonzero(~v.sound)),
        originals=tuple(Original(each.name, each.data) for each in (position, velocity)),
    )


def _join_traps(position: File, velocity: File, from_p: I8, from_v: I8) -> Iterable[Trap]:
    """Yield the remarks on the velocity file, except those that apply to both files, and on the two together."""
    p, v = position.reading, velocity.reading
    for trap in (*velocity.reading.traps, *velocity.found):
        if trap.code not in ("nominal_clock", "rate_assumed", "rate_given"):
            yield replace(trap, message=f"in {velocity.name}: {trap.message}")
    alone_p, alone_v = int(np.count_nonzero(from_v < 0)), int(np.count_nonzero(from_p < 0))
    if alone_v:
        message = f"{alone_v} times are only in the velocity file, so they have no distance"
        yield Trap("missing_samples", message, alone_v)
    if alone_p:
        message = f"{alone_p} times are only in the position file, so they have no velocity"
        yield Trap("velocity_missing", message, alone_p)
    # The velocity of a sample must be its difference from the previous position, multiplied by the rate.
    both = np.flatnonzero((from_p[1:] >= 0) & (from_v[1:] >= 0) & (from_p[:-1] >= 0)) + 1
    x, rate_hz = p.value, p.timing.rate_hz
    apart = np.abs((x[from_p[both]] - x[from_p[both - 1]]) * rate_hz - v.value[from_v[both]])
    apart = apart[np.isfinite(apart)]
    wrong = int(np.count_nonzero(apart > 1.01 * (p.resolution * rate_hz + v.resolution)))
    if wrong > 0.5 * apart.size:
        message = f"{wrong} of {apart.size} velocities contradict the positions; the two files may be of different runs"
        yield Trap("pair_mismatch", message, wrong)
