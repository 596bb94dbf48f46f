"""MotionSensor.vi: the text files of a LabVIEW front panel for an ultrasonic rangefinder.

A file contains position (``Time (s)``, ``Distance (cm)``, ``Dist Error (cm)``) or velocity (``Time (s)``,
``Velocity (cm/s)``), tab separated, with three decimals, usually without a line end after the last row. The
title and the column line may have been edited or deleted;
:mod:`acquisition.recordings.families.motion_sensor.layout` finds the remaining ones. What is easy to misread:

- Times are row numbers divided by a nominal rate, rounded to a millisecond.
- The error column is a constant, tens of times larger than the noise.
- Velocity is the backward difference of the unrounded position over one sample.
- Position and velocity files may differ in length and window: they are joined by time, never by row.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from acquisition.block import I8, Block, Flag
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.families.motion_sensor.column import Column, read_column
from acquisition.recordings.families.motion_sensor.layout import evidence, no_column_line
from acquisition.recordings.base import Survey
from acquisition.recordings.questions import Missing
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.recordings.sampling.nominal import time_flags
from acquisition.recordings.sampling.samples import IRREGULAR, UNREAD_FLAGS
from acquisition.recordings.sampling.velocity import find_quantum, integrate, outer_join
from acquisition.recordings.tables.channel import Samples
from acquisition.recordings.tables.text import head_lines
from acquisition.source import SourceInfo


class MotionSensor:
    """The MotionSensor.vi family."""

    name = "motion-sensor"
    title = "MotionSensor.vi text: position, velocity, or one of each"

    def evidence(self, head: bytes) -> str:
        """Return the evidence: the title, the column line, or the shape of rows without either."""
        return evidence(head_lines(head))

    def recognises(self, head: bytes) -> bool:
        """Return whether there is evidence for this family."""
        return bool(self.evidence(head))

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the only channel of a file; an empty tuple if the user must state the meaning of the numbers."""
        try:
            column = read_column(path, data, None, None, None)
        except NeedsAnswer:
            return ()
        layout, samples = column.layout, column.samples
        unit = layout.unit + ("/s" if layout.quantity == "velocity" else "")
        return (Survey("", layout.quantity, unit, samples.t.size, samples.timing.rate_hz, column.traps),)

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
        """Read one file, either of position or of velocity; see :class:`acquisition.recordings.base.Format`.

        Examples
        --------
        >>> rows = b"Time (s)\\tDistance (cm)\\n0.430\\t16.500\\n0.440\\t16.509\\n0.450\\t16.565"
        >>> recording = FORMAT.read("run.txt", rows)
        >>> recording.info.rate_hz, recording.samples.distance.tolist()
        (100.0, [0.165, 0.16509, 0.16565])
        """
        if run is not None:
            raise FormatError(path, f'the file has one run without a name, got run "{run}"', "leave run out")
        if time is not None or time_unit not in (None, "s"):
            problem = f'the times are the first column, in s, got "{time or time_unit}"'
            raise FormatError(path, problem, "leave time and time_unit out")
        column = read_column(path, data, channel, rate_hz, unit)
        return _position_alone(column) if column.layout.quantity == "distance" else _velocity_alone(column)

    def read_pair(
        self, position: tuple[str, bytes], velocity: tuple[str, bytes], *, rate_hz: float | None = None
    ) -> Recording:
        """Join a position file and a velocity file by time; they may be given in either order.

        Raises
        ------
        FormatError
            If the files are not one position and one velocity file, differ in rate, or have no time in common.
        """
        a, b = (_of_pair(path, data, rate_hz) for path, data in (position, velocity))
        if a.layout.quantity == b.layout.quantity:
            problem = f"expected a position and a velocity file, got {a.layout.quantity} in both ({a.name} too)"
            raise FormatError(b.path, problem, "name the other file of the pair")
        return _join(a, b) if a.layout.quantity == "distance" else _join(b, a)


def _of_pair(path: str, data: bytes, rate_hz: float | None) -> Column:
    """Read one file of a pair; a file that may contain either position or velocity is an error here."""
    try:
        return read_column(path, data, None, rate_hz, None)
    except NeedsAnswer as error:
        if Missing.CHANNEL in error.question.missing:
            raise no_column_line(path, "two columns in a file of a pair", error.line) from None
        raise


FORMAT = MotionSensor()


def _recording(
    column: Column, samples: Block, quantum_m: float, traps: Iterable[Trap], velocity: Column | None = None
) -> Recording:
    files = (column,) if velocity is None else (column, velocity)
    info = SourceInfo(
        kind="simulated" if column.simulated else "replay",
        name=column.name,
        rate_hz=column.samples.timing.rate_hz,
        quantum_m=quantum_m,
        clock="device" if column.samples.timing.grid is None else "nominal",
        stated_error_m=column.stated_error_m,
    )
    return Recording(
        format=MotionSensor.name,
        path=column.path,
        info=info,
        channel=column.layout.quantity,
        samples=samples,
        traps=(*column.traps, *traps),
        malformed_rows=sum(each.samples.malformed_rows for each in files),
        originals=tuple(Original(each.name, each.data) for each in files),
        title=column.layout.title,
    )


def _position_alone(column: Column) -> Recording:
    samples = column.samples
    return _recording(column, Block(0, samples.t, samples.value, samples.flags), column.quantum, ())


def _velocity_alone(column: Column) -> Recording:
    """Integrate velocity to position; the first sample is at zero, because the file does not contain the offset."""
    samples, tick = column.samples, column.tick()
    rate_hz, flags = samples.timing.rate_hz, samples.flags.copy()
    regular = np.flatnonzero((flags & IRREGULAR) == 0)
    index = np.rint(samples.t[regular] * rate_hz).astype(np.int64)
    path = integrate(samples.value[regular], index, rate_hz, tick, samples.resolution / 2)
    distance = np.full(samples.t.size, np.nan)
    distance[regular] = path.position
    flags[regular[path.bridged]] |= Flag.GAP_BEFORE.value
    flags[np.isnan(distance)] |= Flag.MISSING.value
    quantum_m = find_quantum(samples.value, tick) / rate_hz if tick else samples.resolution / rate_hz
    summed = "the position was integrated from the velocity: its offset is unknown, and the first sample is at 0 m"
    traps = [Trap("offset_unknown", summed, samples.t.size)]
    if holes := int(np.count_nonzero(path.bridged)):
        first = float(samples.t[regular[path.bridged]][0])
        message = (
            f"the velocity has {holes} gap{'s' if holes > 1 else ''}, the first before t = {first:g} s: the integrated "
            "position may jump there"
        )
        traps.append(Trap("offset_unknown_after_gap", message, holes))
    return _recording(column, Block(0, samples.t, distance, flags, None, samples.value), quantum_m, traps)


def _join(position: Column, velocity: Column) -> Recording:
    p, v = position.samples, velocity.samples
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
    distance = np.where(in_p, p.value[from_p], np.nan)
    speed = np.where(in_v, v.value[from_v], np.nan)
    flags = time_flags(t, 1.0 / rate_hz)
    flags |= np.where(in_p, p.flags[from_p], v.flags[from_v]) & UNREAD_FLAGS
    flags[~in_p] |= Flag.MISSING.value
    tick = velocity.tick()
    quantum_m = find_quantum(v.value, tick) / rate_hz if tick else position.quantum
    traps = (*_velocity_traps(velocity), *_join_traps(p, v, from_p, from_v))
    return _recording(position, Block(0, t, distance, flags, None, speed), quantum_m, traps, velocity)


def _velocity_traps(velocity: Column) -> Iterable[Trap]:
    """Yield the remarks on the velocity file, with its name, except remarks that apply to both files."""
    for trap in velocity.traps:
        if trap.code not in ("nominal_clock", "rate_assumed", "rate_given"):
            yield Trap(trap.code, f"in {velocity.name}: {trap.message}", trap.count, trap.line)


def _join_traps(p: Samples, v: Samples, from_p: I8, from_v: I8) -> Iterable[Trap]:
    alone_p, alone_v = int(np.count_nonzero(from_v < 0)), int(np.count_nonzero(from_p < 0))
    if alone_v:
        message = f"{alone_v} times are only in the velocity file, so they have no distance"
        yield Trap("missing_samples", message, alone_v)
    if alone_p:
        yield Trap(
            "velocity_missing", f"{alone_p} times are only in the position file, so they have no velocity", alone_p
        )
    # The velocity of a sample must be its difference from the previous position, multiplied by the rate.
    both = np.flatnonzero((from_p[1:] >= 0) & (from_v[1:] >= 0) & (from_p[:-1] >= 0)) + 1
    x, rate_hz = p.value, p.timing.rate_hz
    apart = np.abs((x[from_p[both]] - x[from_p[both - 1]]) * rate_hz - v.value[from_v[both]])
    apart = apart[np.isfinite(apart)]
    allowed = p.resolution * rate_hz + v.resolution
    wrong = int(np.count_nonzero(apart > 1.01 * allowed))
    if wrong > 0.5 * apart.size:
        message = f"{wrong} of {apart.size} velocities contradict the positions; the two files may be of different runs"
        yield Trap("pair_mismatch", message, wrong)
