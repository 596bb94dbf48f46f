"""Formats whose channels are columns: list the content of a file, choose the channel, and read the recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING

from acquisition.block import F8, Block
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.base import Survey
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.recordings.sampling.samples import value_traps
from acquisition.recordings.sampling.timing import check_rate
from acquisition.recordings.tables.channel import Samples, read_samples, rows_of
from acquisition.recordings.tables.choose import Answers, choose_channel, measure
from acquisition.recordings.tables.table import Column, Table, names_apart
from acquisition.recordings.tables.text import says_simulated
from acquisition.recordings.units import Measure
from acquisition.source import ClockKind, Kind, SourceInfo

if TYPE_CHECKING:
    from acquisition.recordings.tables.dialect import Header


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A chosen channel with its samples, and the remarks on the file and the unit; ``value`` is in SI."""

    table: Table
    column: Column
    measured: Measure
    samples: Samples
    value: F8
    traps: tuple[Trap, ...]

    def recording(
        self,
        family: str,
        path: str,
        data: bytes,
        block: Block,
        quantum_m: float | None,
        found: Iterable[Trap],
        error_m: float | None = None,
    ) -> Recording:
        """Return the recording of a block, with what was found in its values."""
        table, column, samples, name = self.table, self.column, self.samples, PurePath(path).name
        kind: Kind = "simulated" if says_simulated(f"{table.title} {table.run} {column.name} {name}") else "replay"
        clock: ClockKind = "device" if samples.timing.grid is None else "nominal"
        return Recording(
            format=family,
            path=path,
            info=SourceInfo(kind, name, samples.timing.rate_hz, None, quantum_m, clock, error_m),
            channel=column.name,
            samples=block,
            traps=(*self.traps, *samples.traps, *found),
            malformed_rows=samples.malformed_rows,
            originals=(Original(name, data),),
            title=table.title,
            run=table.run,
            start_time=table.start_time,
        )


def read_channel(path: str, tables: Sequence[Table], answers: Answers, *, difference: bool = False) -> Reading:
    """Choose a channel and read its samples; ``difference`` says that each value is the step from the row before."""
    check_rate(path, answers.rate_hz)
    table, column = choose_channel(path, names_apart(tables), answers)
    measured, traps = measure(path, column, answers.unit)
    samples = read_samples(path, table, column, measured.power, answers.rate_hz, difference=difference)
    value = samples.value if measured.factor == 1.0 else samples.value * measured.factor
    return Reading(table, column, measured, samples, value, (*table.traps, *traps))


@dataclass(frozen=True, slots=True)
class ColumnFormat:
    """A family of recordings with channels in columns.

    Parameters
    ----------
    name, title : str
        Name in the registry and on the command line, and one line for the user.
    evidence : callable
        Takes the head of a file and returns a few words on why the file belongs to this family, or an empty text if it
        does not. It never raises.
    tables : callable
        Takes the path and the bytes of a file and returns its tables, with all their numbers.
    header : callable, optional
        For families of text: takes the first lines and returns what they say. Sheets of a workbook are tried with it.
    """

    name: str
    title: str
    evidence: Callable[[bytes], str]
    tables: Callable[[str, bytes], Sequence[Table]]
    header: Callable[[Sequence[str]], Header | None] | None = None

    def recognises(self, head: bytes) -> bool:
        """Return whether there is evidence for this family."""
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
        time: str | None = None,
        time_unit: str | None = None,
    ) -> Recording:
        """Read one channel of one run; see :class:`springmass.extend.Format`."""
        answers = Answers(channel, rate_hz, unit, run, time, time_unit)
        reading = read_channel(path, self.tables(path, data), answers)
        measured, samples, column = reading.measured, reading.samples, reading.column
        distance = measured.quantity == "length" and (column.is_length or not column.unit)
        quantum, found = value_traps(
            reading.value, samples.flags, samples.resolution * measured.factor, samples.line, length=distance
        )
        block = Block(0, samples.t, reading.value, samples.flags, quantity=measured.quantity, unit=measured.si)
        return reading.recording(self.name, path, data, block, quantum or None, found)

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
        channels = [(table, each) for table in names_apart(self.tables(path, data)) for each in table.columns]
        surveys = tuple(_survey(path, *each) for each in channels)
        if not any(each.samples for each in surveys):
            rows_of(path, *channels[0], 0)  # raises the error
        return surveys


def _survey(path: str, table: Table, column: Column) -> Survey:
    rows = 0
    try:
        power = column.measure.power if column.measure else 0
        rows = rows_of(path, table, column, power).value.size
        samples = read_samples(path, table, column, power, None)
    except NeedsAnswer:
        return Survey(table.run, column.name, column.unit, rows, None, ())
    except FormatError as error:
        # A channel without numbers must not prevent the listing of other channels.
        none = Trap("empty_channel", str(error).removeprefix(path).lstrip(", :"))
        return Survey(table.run, column.name, column.unit, 0, None, (none,))
    span_s = float(samples.t.max() - samples.t.min())
    return Survey(table.run, column.name, column.unit, samples.t.size, samples.timing.rate_hz, samples.traps, span_s)
