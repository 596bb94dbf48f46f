"""A format that is columns: what its files hold, which channel is the distance, and the recording of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from acquisition.block import Block
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.inspection import Survey
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.recordings.sampling.samples import flags_of, place, row_traps, sample_traps, value_traps
from acquisition.recordings.sampling.timing import (
    Timing,
    check_rate,
    clock_traps,
    row_times,
    time_by_column,
    time_by_formula,
    time_by_rate,
)
from acquisition.recordings.tables.channel import Pulled, pull
from acquisition.recordings.tables.contents import Channel, Contents, Formula, choose
from acquisition.recordings.tables.text import says_simulated
from acquisition.recordings.units import LENGTHS, length_power, unit_words
from acquisition.source import Kind, SourceInfo

__all__ = ["ColumnFormat"]


@dataclass(frozen=True, slots=True)
class ColumnFormat:
    """A family of recordings that keeps channels in columns.

    Parameters
    ----------
    name, title : str
        See :class:`acquisition.recordings.base.Format`.
    evidence : callable
        From the head of a file: why it is of this family, in a few words; empty where it is not. Never raises.
    contents : callable
        From path and content: what the file holds.
    """

    name: str
    title: str
    evidence: Callable[[bytes], str]
    contents: Callable[[str, bytes], Contents]

    def recognises(self, head: bytes) -> bool:
        """Tell whether there is evidence for this family."""
        return bool(self.evidence(head))

    def read(
        self,
        path: str,
        data: bytes,
        *,
        channel: str | None = None,
        rate_hz: float | None = None,
        unit: str | None = None,
        run: str | None = None,
    ) -> Recording:
        """Read one channel of one run; see :class:`acquisition.recordings.base.Format`."""
        check_rate(path, rate_hz)
        contents = self.contents(path, data)
        chosen = choose(path, contents, channel, run)
        power, told = _power(path, chosen, unit)
        pulled = pull(path, chosen, power)
        timing, traps = _timing(path, chosen, pulled, rate_hz)
        samples, found, line = _samples(path, chosen, pulled, timing, contents.zeros)
        length = chosen.is_length or not chosen.unit
        quantum, others = value_traps(samples.distance, samples.flags, pulled.resolution, line, length=length)
        name = PurePath(path).name
        clock = "nominal" if timing.grid is not None else chosen.clock
        kind: Kind = "simulated" if says_simulated(f"{contents.title} {chosen.name} {name}") else "replay"
        info = SourceInfo(kind, name, timing.rate_hz, quantum_m=quantum or None, clock=clock)
        return Recording(
            format=self.name,
            path=path,
            info=info,
            channel=chosen.name,
            samples=samples,
            traps=(*contents.traps, *told, *traps, *found, *others),
            malformed_rows=int(np.count_nonzero(pulled.rows.bad)),
            originals=(Original(name, data),),
            title=contents.title,
            run=chosen.run,
            start_time=chosen.start_time,
        )

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Tell of every channel what the file says by itself, with nothing chosen or given."""
        return tuple(self._survey(path, each) for each in self.contents(path, data).channels)

    def _survey(self, path: str, channel: Channel) -> Survey:
        pulled = pull(path, channel, length_power(channel.unit) or 0)
        try:
            timing, traps = _timing(path, channel, pulled, None)
        except NeedsAnswer:
            return Survey(channel.run, channel.name, channel.unit, pulled.value.size, None, ())
        samples, found, _ = _samples(path, channel, pulled, timing, 0)
        return Survey(channel.run, channel.name, channel.unit, len(samples), timing.rate_hz, (*traps, *found))


def _power(path: str, channel: Channel, unit: str | None) -> tuple[int, tuple[Trap, ...]]:
    """Return the power of ten from the channel's unit to metres, and what was assumed for it."""
    stated = length_power(channel.unit)
    if unit is not None and unit_words(unit) not in LENGTHS:
        raise FormatError(path, f'unit must be one of {", ".join(LENGTHS)}, got "{unit}"', "name one of these")
    if stated is not None:
        if unit is not None and length_power(unit) != stated:
            demand = f'unit "{unit}" was asked for, but "{channel.label}" says {unit_words(channel.unit)}'
            raise FormatError(path, demand, "leave the unit out")
        return stated, ()
    if unit is None:
        what = f'its unit is "{channel.unit}", no length' if channel.unit else "nothing says its unit"
        demand = f'expected a distance, got channel "{channel.name}": {what}'
        remedy = "say with --unit m, cm or mm what one unit of it is to count as"
        raise NeedsAnswer(path, demand, f"{remedy}, or name another with --channel" if channel.unit else remedy)
    power = LENGTHS[unit_words(unit)]
    if not channel.unit:
        return power, (Trap("unit_assumed", f'the unit of "{channel.name}", {unit}, was given by the user'),)
    message = (
        f'"{channel.label}" is no distance: one {channel.unit} counts as one {unit}, as the user asked; times, '
        "frequencies and damping rates hold, everything in metres is in that unit"
    )
    return power, (Trap("unit_assumed", message),)


def _timing(path: str, channel: Channel, pulled: Pulled, rate_hz: float | None) -> tuple[Timing, tuple[Trap, ...]]:
    traps: list[Trap] = []
    formula = channel.formula
    count = pulled.rows.samples
    if formula is not None and formula.samples is not None and formula.samples != count:
        message = f"the header declares {formula.samples} samples, {count} rows are there; all are kept"
        traps.append(Trap("stale_header", message, abs(formula.samples - count)))
    timing = None
    if formula is not None:
        printed = pulled.printed
        if printed is not None and pulled.rows.bad.any():
            printed = np.where(pulled.rows.bad, np.nan, printed)
        numbers = pulled.rows.numbers()
        timing = time_by_formula(path, formula.start_s, formula.step_s, printed, pulled.tolerance, numbers, rate_hz)
        if timing is None:
            traps.append(_stale(formula, pulled))
    if timing is None and pulled.printed is not None:
        sound = pulled.printed[~pulled.rows.bad] if pulled.rows.bad.any() else pulled.printed
        timing = time_by_column(path, sound, pulled.time_resolution, rate_hz)
        if not channel.time_unit and formula is None:
            traps.append(Trap("unit_assumed", "the times have no unit: read as seconds"))
    if timing is None:
        timing = time_by_rate(path, rate_hz, "no column of times and no sampling interval")
    return timing, (*traps, *clock_traps(timing))


def _stale(formula: Formula, pulled: Pulled) -> Trap:
    said = f"the header says {formula.start_s:g} s + i * {formula.step_s:g} s"
    if pulled.printed is None:
        return Trap("stale_header", f"{said}, which makes no times")
    return Trap("stale_header", f"{said}, the column of times says otherwise and is believed", pulled.value.size)


def _samples(
    path: str, channel: Channel, pulled: Pulled, timing: Timing, zeros: int
) -> tuple[Block, tuple[Trap, ...], Callable[[int], int | None]]:
    """Return the samples, what was seen in them, and what gives the line of each; the times printed are used up."""
    rows, value, bad = pulled.rows, pulled.value, pulled.rows.bad
    if pulled.printed is None or timing.by_row:
        room = np.empty(value.size) if pulled.printed is None else np.require(pulled.printed, requirements="W")
        t = row_times(timing, rows.numbers(), out=room)
        if rows.remark is not None:
            t[rows.remark] = np.nan
    else:
        t = place(pulled.printed, rows, timing)
    told = np.isfinite(t)
    every = bool(told.all())
    if np.isnan(value if every else value[told]).all():
        demand = f'expected numbers as "{channel.name}", got NaN in all {value.size} rows'
        raise FormatError(path, demand, "record the run again")
    traps = tuple(row_traps(rows, told, zeros))
    where = None
    if not every:
        where = np.flatnonzero(told)
        t, value, bad = t[where], value[where], bad[where]

    def line(row: int) -> int | None:
        return rows.line(row if where is None else int(where[row])) or None

    flags = flags_of(t, value, bad, timing.rate_hz)
    return Block(0, t, value, flags), (*traps, *sample_traps(flags, t, timing.rate_hz, line)), line
