"""Formats whose channels are columns: list the content of a file, choose the channel, and read the recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from acquisition.block import Block
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.base import Survey
from acquisition.recordings.recording import Recording, Trap
from acquisition.recordings.sampling.samples import value_traps
from acquisition.recordings.tables.channel import read_channel, read_samples, rows_of
from acquisition.recordings.tables.choose import Answers
from acquisition.recordings.tables.table import Column, Header, Table, names_apart
from acquisition.recordings.units import NUMBER


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

    def read(self, path: str, data: bytes, **answers: Any) -> Recording:
        """Read one channel of one run; see :class:`springmass.extend.Format`."""
        samples = read_channel(path, self.tables(path, data), Answers(**answers))
        length = samples.measured.quantity == "length" and (samples.column.is_length or not samples.column.unit)
        quantum, found = value_traps(samples.value, samples.flags, samples.resolution, samples.line, length=length)
        measured = samples.measured
        block = Block(0, samples.t, samples.value, samples.flags, quantity=measured.quantity, unit=measured.si)
        return samples.recording(self.name, path, data, block, quantum or None, found)

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
        channels = [(table, each) for table in names_apart(self.tables(path, data)) for each in table.columns]
        surveys = tuple(_survey(path, *each) for each in channels)
        if not any(each.samples for each in surveys):
            rows_of(path, *channels[0], NUMBER)  # raises the error
        return surveys


def _survey(path: str, table: Table, column: Column) -> Survey:
    measured = column.measure or NUMBER
    try:
        rows = rows_of(path, table, column, measured)
        samples = read_samples(path, rows, table, column, measured, None)
    except NeedsAnswer:
        return Survey(table.run, column.name, column.unit, rows.value.size, None, ())
    except FormatError as error:
        # A channel without numbers must not prevent the listing of other channels.
        none = Trap("empty_channel", str(error).removeprefix(path).lstrip(", :"))
        return Survey(table.run, column.name, column.unit, 0, None, (none,))
    span_s = float(samples.t.max() - samples.t.min())
    return Survey(table.run, column.name, column.unit, samples.t.size, samples.timing.rate_hz, samples.traps, span_s)
