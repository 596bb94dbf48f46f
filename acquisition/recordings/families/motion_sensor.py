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

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.block import B1, F8, I8, Block, Flag
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.reading import READ_DEFAULTS, ReadOptions
from acquisition.recordings.recording import FormatIssue, Original, Recording, Survey
from acquisition.recordings.sampling.flags import IRREGULAR, UNREAD_FLAGS, time_flags
from acquisition.recordings.sampling.timing import median
from acquisition.recordings.tables.channel import Samples, check_lengths, read_channel
from acquisition.recordings.tables.format import ColumnFormat, text_format
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.layout import columns_of, find_table, runs_forward
from acquisition.recordings.tables.numbers import EMPTY_CELL, UNREAD_CELL, scaled
from acquisition.recordings.tables.table import Header, Table
from acquisition.units import LENGTH_POWERS

_TITLE = "motion sensor data file"
_UNIT = rf"\(({'|'.join(LENGTH_POWERS)})"
_COLUMNS = re.compile(
    rf"time \(s\)\t(?:(?P<distance>distance) {_UNIT}\)(?P<error>\tdist(?:ance)? error \(\2\))?|velocity {_UNIT}/s\))"
)
_HEADER_LINES = 20
_ROWS_OF_SHAPE = 100
_CONSTANT = 0.95


def header(lines: Sequence[str]) -> Header | None:
    """Read the column line, or infer the columns from the rows."""
    above = enumerate(lines[:_HEADER_LINES], 1)
    title = next((at for at, line in above if line.lstrip().lower().startswith(_TITLE)), 0)
    why = f'line {title} is the title "{lines[title - 1].strip()}"' if title else ""
    for at, line in enumerate(lines[:_HEADER_LINES], 1):
        if match := _COLUMNS.fullmatch("\t".join(cell.strip() for cell in line.rstrip().split("\t")).lower()):
            quantity, unit = ("distance", match[2]) if match["distance"] else ("velocity", match[4])
            why = why or f"line {at} is the column line of {quantity} in {unit}"
            headings = _headings(quantity, unit, bool(match["error"]))
            return Header(why, at, "\t", headings, title=_above(lines[: at - 1]))
    table = find_table(tuple(lines[title:_ROWS_OF_SHAPE]))
    columns = columns_of(table.rows) if table and not table.named else []
    shape = _shape(columns)
    if table is None or not shape:
        return None
    at, quantity = title + table.lines, "distance" if len(columns) == 3 else "velocity"
    trap = FormatIssue("unit_assumed", f"no column line: read as time (s) and {shape}, in cm")
    headings, why = _headings(quantity, "cm", len(columns) == 3), why or f"the rows have the shape of {shape}"
    return Header(why, at, table.delimiter, headings, title=_above(lines[:at]), traps=(trap,))


def _shape(columns: Sequence[F8]) -> str:
    """Return what rows without names are: a constant third column is the error, and an initial NaN means velocity."""
    if not 2 <= len(columns) <= 3 or columns[0][0] < 0 or not runs_forward(columns[0]):
        return ""
    last = columns[-1]
    if len(columns) == 3:
        usual = median(last[np.isfinite(last)]) if np.isfinite(last).any() else 0.0
        constant = usual > 0 and np.mean(last == usual) >= _CONSTANT
        return "distance and its error, because the third column is constant" if constant else ""
    return "velocity, because the first value is NaN" if np.isnan(last[0]) and np.isfinite(last[1]) else ""


def _above(lines: Sequence[str]) -> str:
    return " / ".join(line.strip() for line in lines if line.strip())


def _headings(quantity: str, unit: str, error: bool) -> list[Heading]:
    """Return the headings of the columns, and of one more, in which no row has a cell."""
    value = Heading(quantity, unit + "/s" * (quantity == "velocity"))
    ignored = [Heading("error", unit, role="ignored")] * error + [Heading("", role="ignored")]
    return [Heading("time", "s"), value, *ignored]


def _tables(path: str, data: bytes) -> list[Table]:
    """Read the table; a row that lacks a number, or has one too many, is damaged as a whole."""
    (table,) = _TEXT.tables(path, data)
    first, *others = table.columns
    table = replace(table, columns=(replace(first, differences=first.name == "velocity"), *others))
    if table.lines is None:
        return [table]
    *cells, beyond = (column.of_size(table.lines.rows).forms for column in table.beside)
    damaged = (np.array(cells) <= EMPTY_CELL).any(axis=0) | (beyond != EMPTY_CELL)
    value = table.columns[0].of_size(damaged.size)
    value = replace(value, decimals=np.where(damaged, UNREAD_CELL, value.forms))
    lines = table.lines._replace(cut=not table.lines.ended and bool(damaged[-1:].any()))
    return [replace(table, columns=(value,), lines=lines)]


@dataclass(frozen=True, slots=True)
class MotionSensor(ColumnFormat):
    """The MotionSensor.vi family: a velocity is summed up to a position, and two files are joined by time."""

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the only channel of a file; an empty tuple if the user must state the rate."""
        try:
            samples = self._samples(path, data, READ_DEFAULTS)
        except NeedsAnswer:
            return ()
        column, rate_hz = samples.column, samples.timing.rate_hz
        return (Survey("", column.name, column.unit, len(samples.block), rate_hz, samples.traps),)

    def read(self, path: str, data: bytes, reading: ReadOptions = READ_DEFAULTS) -> Recording:
        """Read one file, either of position or of velocity; see :class:`springmass.extend.Format`."""
        samples = self._samples(path, data, reading)
        return (_summed_up(samples) if samples.column.differences else samples).recording(self.name, data)

    def read_pair(
        self, position: tuple[str, bytes], velocity: tuple[str, bytes], reading: ReadOptions = READ_DEFAULTS
    ) -> Recording:
        """Join a position file and a velocity file by time; they may be given in either order."""
        files = [(self._samples(*each, reading), each[1]) for each in (position, velocity)]
        (p, position_data), (v, velocity_data) = sorted(files, key=lambda file: file[0].column.name)
        if p.column.name == v.column.name:
            problem = f"expected a position and a velocity file, got {p.column.name} in both ({p.name} too)"
            raise FormatError(v.path, problem, "name the other file of the pair")
        joined = _joined(p, v).recording(self.name, position_data)
        return replace(joined, originals=(*joined.originals, Original(v.name, velocity_data)))

    def _samples(self, path: str, data: bytes, answers: ReadOptions) -> Samples:
        """Read the samples of a file, m or m/s, with the error that it states."""
        tables = self.tables(path, data)
        samples = read_channel(path, tables, answers)
        for column in samples.table.beside[2:-1]:
            errors = scaled(column.values, column.decimals, samples.measured.power)
            errors = errors[np.isfinite(errors)]
            error_m = median(errors) if errors.size else None
            samples = replace(samples, error_m=error_m)
            if error_m is not None and np.mean(errors == error_m) >= _CONSTANT:
                size = f"{error_m / 10.0**samples.measured.power:g} {column.unit}"
                message = f"the error column is a constant {size}: a stated value, not the noise"
                trap = FormatIssue("stated_error_is_not_noise", message)
                samples = replace(samples, traps=(*samples.traps, trap))
        return samples if samples.column.differences else check_lengths(samples)


_TEXT = text_format("motion-sensor", "MotionSensor.vi text: position, velocity, or one of each", header)
FORMAT = MotionSensor(_TEXT.name, _TEXT.title, _TEXT.evidence, _tables)


def _summed_up(samples: Samples) -> Samples:
    """Integrate velocity to position; the first sample is at zero, because the file does not contain the offset."""
    t, value, flags, rate_hz = samples.block.t, samples.block.distance, samples.block.flags, samples.timing.rate_hz
    regular = np.flatnonzero((flags & IRREGULAR) == 0)
    index = np.rint(t[regular] * rate_hz).astype(np.int64)
    position, bridged = _integrate(value[regular], index, rate_hz)
    distance = np.full(t.size, np.nan)
    distance[regular] = position
    flags[regular[bridged]] |= Flag.GAP_BEFORE.value
    flags[np.isnan(distance)] |= Flag.MISSING.value
    summed = "the position was integrated from the velocity: its offset is unknown, and the first sample is at 0 m"
    traps = [FormatIssue("offset_unknown", summed, t.size)]
    if holes := int(np.count_nonzero(bridged)):
        first = float(t[regular[bridged]][0])
        gaps = f"{holes} gap{'s' if holes > 1 else ''}, the first before t = {first:g} s"
        message = f"the velocity has {gaps}: the integrated position may jump there"
        traps.append(FormatIssue("offset_unknown_after_gap", message, holes))
    return replace(samples, block=Block(0, t, distance, flags, None, value), traps=(*samples.traps, *traps))


def _joined(p: Samples, v: Samples) -> Samples:
    """Join positions and velocities by their times."""
    rate_hz = p.timing.rate_hz
    if abs(v.timing.rate_hz - rate_hz) > 1e-6 * rate_hz:
        problem = f"expected {rate_hz:g} Hz as in {p.name}, got {v.timing.rate_hz:g} Hz"
        raise FormatError(v.path, problem, "name the velocity file of the same run")
    resolution = min(p.timing.resolution_s, v.timing.resolution_s)
    keys = [np.rint(t / resolution).astype(np.int64) for t in (p.block.t, v.block.t)]
    from_p, from_v = _outer_join(keys[0], keys[1], (p.block.flags & IRREGULAR) == 0)
    in_p, in_v = from_p >= 0, from_v >= 0
    if not (in_p & in_v).any():
        problem = f"expected times in common with {p.name}, got none"
        raise FormatError(v.path, problem, "name the velocity file of the same run")
    t = np.where(in_p, p.block.t[from_p], v.block.t[from_v])
    distance = np.where(in_p, p.block.distance[from_p], np.nan)
    speed = np.where(in_v, v.block.distance[from_v], np.nan)
    flags = time_flags(t, 1.0 / rate_hz)
    flags |= np.where(in_p, p.block.flags[from_p], v.block.flags[from_v]) & UNREAD_FLAGS
    flags[~in_p] |= Flag.MISSING.value
    traps, malformed_rows = _join_traps(p, v, from_p, from_v), p.malformed_rows + v.malformed_rows
    block = Block(0, t, distance, flags, None, speed)
    return replace(p, block=block, traps=(*p.traps, *traps), malformed_rows=malformed_rows)


def _join_traps(p: Samples, v: Samples, from_p: I8, from_v: I8) -> Iterator[FormatIssue]:
    """Yield the remarks on the velocity file, except those that apply to both files, and on the two together."""
    for trap in v.traps:
        if trap.code not in ("nominal_clock", "rate_assumed", "rate_given"):
            yield replace(trap, message=f"in {v.name}: {trap.message}")
    for lacking, code, file, value in (
        (from_p, "missing_samples", "velocity", "distance"),
        (from_v, "velocity_missing", "position", "velocity"),
    ):
        if count := int(np.count_nonzero(lacking < 0)):
            yield FormatIssue(code, f"{count} times are only in the {file} file, so they have no {value}", count)
    # The velocity of a sample must be its difference from the previous position, multiplied by the rate.
    both = np.flatnonzero((from_p[1:] >= 0) & (from_v[1:] >= 0) & (from_p[:-1] >= 0)) + 1
    x, rate_hz = p.block.distance, p.timing.rate_hz
    apart = np.abs((x[from_p[both]] - x[from_p[both - 1]]) * rate_hz - v.block.distance[from_v[both]])
    apart = apart[np.isfinite(apart)]
    wrong = int(np.count_nonzero(apart > 1.01 * (p.resolution * rate_hz + v.resolution)))
    if wrong > 0.5 * apart.size:
        message = f"{wrong} of {apart.size} velocities contradict the positions; the two files may be of different runs"
        yield FormatIssue("pair_mismatch", message, wrong)


def _integrate(velocity: F8, index: I8, rate_hz: float) -> tuple[F8, B1]:
    """Sum backward differences ``(x[i] - x[i-1]) * rate_hz`` to a position, m: zero at first, NaN if unknown.

    ``index`` are sample numbers, increasing; a jump is a gap, in which the velocity is interpolated linearly. The
    resulting offset is only an estimate, so the mask returned marks the first sample after each gap.
    """
    measured = np.isfinite(velocity)
    start = velocity.size > 0 and not measured[0]
    rows = np.flatnonzero(measured)
    position = np.full(velocity.size, np.nan)
    bridged = np.zeros(velocity.size, bool)
    if start:
        position[0] = 0.0
    if rows.size == 0:
        return position, bridged
    # A first sample without a velocity is at position zero, and the second one is relative to it.
    previous = np.concatenate(([index[0] if start else index[rows[0]] - 1], index[rows[:-1]]))
    v_before = np.concatenate(([velocity[rows[0]]], velocity[rows[:-1]]))
    lost = index[rows] - previous - 1
    moved = velocity[rows] + lost * (velocity[rows] + v_before) / 2
    position[rows] = np.cumsum(moved) / rate_hz
    if not start:
        position[rows] -= position[rows[0]]
    bridged[rows] = lost > 0
    return position, bridged


def _outer_join(left: I8, right: I8, regular: B1) -> tuple[I8, I8]:
    """Pair the rows of two recordings by their sample numbers.

    ``regular`` marks the rows of ``left`` whose numbers are in order. Return the row of each joined sample in ``left``
    and in ``right``, -1 if there is none. Rows of ``left`` keep their order, and rows that exist only in ``right`` are
    inserted according to their numbers.
    """
    order = np.argsort(right, kind="stable")
    nearest = order[np.minimum(np.searchsorted(right[order], left), right.size - 1)]
    partner = np.where(right[nearest] == left, nearest, -1)
    alone = np.setdiff1d(np.arange(right.size), partner)
    standing = np.where(regular, left, np.iinfo(np.int64).min)
    where = np.searchsorted(np.maximum.accumulate(standing), right[alone], side="right")
    return np.insert(np.arange(left.size), where, -1), np.insert(partner, where, alone)
