"""Formats whose channels are columns: list the content of a file, choose the channel, and read the recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import islice

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.reading import READ_DEFAULTS, ReadOptions
from acquisition.recordings.recording import FormatIssue, Recording, Survey
from acquisition.recordings.sampling.flags import common_step
from acquisition.recordings.tables.blocks import by_label, runs_of, with_units_of_rows
from acquisition.recordings.tables.channel import check_lengths, read_channel, read_samples, rows_of
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Column, Header, Table, TableFacts, names_apart, side_by_side
from acquisition.recordings.tables.text import Text, is_text, text_of
from acquisition.units import NUMBER

_HEAD_LINES = 300
_MOST_RUNS = 5000


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
    """

    name: str
    title: str
    evidence: Callable[[bytes], str]
    tables: Callable[[str, bytes], Sequence[Table]]

    def recognises(self, head: bytes) -> bool:
        """Return whether there is evidence for this family."""
        return bool(self.evidence(head))

    def _runs(self, path: str, data: bytes) -> list[Table]:
        return [part for table in self.tables(path, data) for part in runs_of(table)]

    def read(self, path: str, data: bytes, reading: ReadOptions = READ_DEFAULTS) -> Recording:
        """Read one channel of one run; see :class:`springmass.extend.Format`."""
        samples = read_channel(path, self._runs(path, data), reading)
        measured, column = samples.measured, samples.column
        if measured.quantity == "length" and (column.is_length or not column.unit):
            samples = check_lengths(samples)
        else:
            samples = replace(samples, quantum=common_step(samples.block.distance, samples.resolution) or None)
        return samples.recording(self.name, data)

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
        channels = [(table, each) for table in names_apart(self._runs(path, data)) for each in table.columns]
        surveys = tuple(_survey(path, *each) for each in channels)
        if not any(each.samples for each in surveys):
            rows_of(path, *channels[0], NUMBER)  # raises the error
        return surveys


def _survey(path: str, table: Table, column: Column) -> Survey:
    measured = column.measure or NUMBER
    try:
        rows = rows_of(path, table, column, measured)
        samples = read_samples(path, rows, table, column, measured)
    except NeedsAnswer:
        return Survey(table.run, column.name, column.unit, rows.value.size, None, ())
    except FormatError as error:
        # A channel without numbers must not prevent the listing of other channels.
        none = FormatIssue("empty_channel", str(error).removeprefix(path).lstrip(", :"))
        return Survey(table.run, column.name, column.unit, 0, None, (none,))
    t = samples.block.t
    return Survey(
        table.run, column.name, column.unit, t.size, samples.timing.rate_hz, samples.traps, float(t.max() - t.min())
    )


def text_format(
    name: str,
    title: str,
    header: Callable[[Sequence[str]], Header | None],
    *,
    expected: str = "other lines above the rows",
    prepare: Callable[[Text], Text] | None = None,
    blocks: Callable[[Text, Header], Iterator[tuple[int, Header]]] | None = None,
) -> ColumnFormat:
    """Return a format of text whose rows follow below some lines that identify it.

    Parameters
    ----------
    name, title : str
        Name in the registry and on the command line, and one line for the user.
    header : callable
        Takes the first lines of a text; returns what they say, or None for lines of another family. It never raises.
    expected : str, optional
        What the lines above the rows should be, for an error message.
    prepare : callable, optional
        Takes the text and returns it without what precedes its rows.
    blocks : callable, optional
        Takes the text and its first header; yields the index of the first line and the header of each further run.

    Returns
    -------
    ColumnFormat
    """

    def read(text: Text) -> tuple[Text, Header | None]:
        text = prepare(text) if prepare else text
        return text, header(text.head(_HEAD_LINES) or [""])

    def evidence(head: bytes) -> str:
        _, above = read(Text.of(head if is_text(head) else b""))
        return above.why if above else ""

    def tables(path: str, data: bytes) -> list[Table]:
        text, above = read(text_of(path, data))
        if above is None or not len(text):
            raise FormatError(path, f"expected {expected}", "export the run again", line=1)
        if above.refused is not None:
            raise FormatError(path, *above.refused, line=above.lines + 1)
        begins = [(0, above), *islice(blocks(text, above) if blocks else (), _MOST_RUNS)]
        if len(begins) > _MOST_RUNS:
            raise FormatError(path, f"expected at most {_MOST_RUNS} runs", "split the file")
        titles, several = " / ".join([each.title for _, each in begins if each.title][:4]), len(begins) > 1
        ends = [*(begin for begin, _ in begins[1:]), len(text)]
        return [
            table
            for (begin, of_table), end in zip(begins, ends, strict=True)
            for table in _tables(
                path, text, begin, replace(of_table, title=titles, run=of_table.run if several else ""), end
            )
        ]

    return ColumnFormat(name, title, evidence, tables)


def _tables(path: str, text: Text, begin: int, header: Header, stop: int) -> list[Table]:
    """Read the rows below a header that begins at a line."""
    read = read_rows(path, text, begin + header.lines, stop, header.delimiter, header.clocks, header.words)
    facts = {each.name: getattr(header, each.name) for each in fields(TableFacts)}
    columns, headings = with_units_of_rows(read.columns, header.headings)
    common = replace(read, columns=columns, **{**facts, "traps": (*header.traps, *read.traps)})
    tables = [part for table in side_by_side(common, headings, header.run) for part in by_label(table)]
    if not tables:
        raise FormatError(path, "expected a column beside the times, got none", "export what was measured too")
    return tables
