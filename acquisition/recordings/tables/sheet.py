"""Formats with columns: list the content of a file, choose the channel, and read the recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import PurePath

from acquisition.block import Block
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.inspection import Survey
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.recordings.sampling.samples import value_traps
from acquisition.recordings.sampling.timing import check_rate
from acquisition.recordings.tables.answers import Answers, choose_channel, measure
from acquisition.recordings.tables.channel import read_rows, to_samples
from acquisition.recordings.tables.contents import Channel, Contents, Heading, Sheet, channels_apart, channels_of
from acquisition.recordings.tables.text import head_lines, says_simulated, text_of
from acquisition.recordings.tables.thousands import refuse_thousands
from acquisition.source import Kind, SourceInfo

__all__ = ["ColumnFormat", "headed_format"]


@dataclass(frozen=True, slots=True)
class ColumnFormat:
    """A family of recordings with channels in columns.

    Parameters
    ----------
    name, title : str
        See :class:`acquisition.recordings.base.Format`.
    evidence : callable
        Takes the head of a file and returns a few words on why the file belongs to this family, or an empty text if it
        does not. It never raises.
    contents : callable
        Takes the path and the bytes of a file and returns its content.
    """

    name: str
    title: str
    evidence: Callable[[bytes], str]
    contents: Callable[[str, bytes], Contents]

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
        """Read one channel of one run; see :class:`acquisition.recordings.base.Format`."""
        check_rate(path, rate_hz)
        contents = self._plain(path, data)
        chosen = choose_channel(path, contents, Answers(channel, rate_hz, unit, run, time, time_unit))
        measured, unit_traps = measure(path, chosen, unit)
        column = to_samples(path, chosen, read_rows(path, chosen, measured.power), rate_hz, contents.zeros)
        length = measured.quantity == "length"
        value = column.value if measured.factor == 1.0 else column.value * measured.factor
        resolution = column.resolution * measured.factor
        distance = length and (chosen.is_length or not chosen.unit)
        quantum, others = value_traps(value, column.flags, resolution, column.line, length=distance)
        name = PurePath(path).name
        clock = "nominal" if column.timing.grid is not None else chosen.clock
        kind: Kind = "simulated" if says_simulated(f"{contents.title} {chosen.run} {chosen.name} {name}") else "replay"
        info = SourceInfo(kind, name, column.timing.rate_hz, quantum_m=quantum or None, clock=clock)
        return Recording(
            format=self.name,
            path=path,
            info=info,
            channel=chosen.name,
            samples=Block(0, column.t, value, column.flags, quantity=measured.quantity, unit=measured.si),
            traps=(*contents.traps, *unit_traps, *column.traps, *others),
            malformed_rows=column.malformed_rows,
            originals=(Original(name, data),),
            title=contents.title,
            run=chosen.run,
            start_time=chosen.start_time,
        )

    def _plain(self, path: str, data: bytes) -> Contents:
        """Return the content of a file with unique channel names, after a check for thousands separators."""
        contents = self.contents(path, data)
        sheets = {id(each.source): each.source for each in contents.channels if isinstance(each.source, Sheet)}
        traps = []
        for sheet in sheets.values():
            if shown := refuse_thousands(path, sheet.text.data[sheet.start : sheet.stop], sheet.delimiter):
                message = f'the comma in "{shown}" was read as a decimal comma, not as a thousands separator'
                traps.append(Trap("decimal_comma", message))
        return replace(contents, channels=channels_apart(contents.channels), traps=(*contents.traps, *traps))

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
        channels = self._plain(path, data).channels
        surveys = tuple(self._survey(path, each) for each in channels)
        if not any(each.samples for each in surveys):
            read_rows(path, channels[0], 0)  # raises the error
        return surveys

    def _survey(self, path: str, channel: Channel) -> Survey:
        rows = 0
        try:
            pulled = read_rows(path, channel, channel.measure.power if channel.measure else 0)
            rows = pulled.value.size
            column = to_samples(path, channel, pulled, None)
        except NeedsAnswer:
            return Survey(channel.run, channel.name, channel.unit, rows, None, ())
        except FormatError as error:
            # A channel without numbers must not prevent the listing of other channels.
            none = Trap("empty_channel", str(error).removeprefix(path).lstrip(", :"))
            return Survey(channel.run, channel.name, channel.unit, 0, None, (none,))
        rate_hz, traps = column.timing.rate_hz, column.traps
        span_s = float(column.t.max() - column.t.min())
        return Survey(channel.run, channel.name, channel.unit, column.t.size, rate_hz, traps, span_s)


def headed_format(
    name: str,
    title: str,
    headings_of: Callable[[str], tuple[tuple[Heading, ...], str]],
    why: Callable[[tuple[Heading, ...], str], str],
    example: str,
) -> ColumnFormat:
    """Return a family whose files have one line of headings above their rows.

    Parameters
    ----------
    name, title : str
    headings_of : callable
        Takes the first line and returns its headings (none for another family) and the separator of cells.
    why : callable
        Takes the headings and the separator and returns why they belong to this family.
    example : str
        An example of the family's headings, for error messages.
    """

    def evidence(head: bytes) -> str:
        headings, mark = headings_of(head_lines(head)[0])
        return why(headings, mark) if headings else ""

    def contents(path: str, data: bytes) -> Contents:
        text = text_of(path, data)
        first = next(text.lines(), None)
        headings, mark = headings_of(first.text) if first else ((), "")
        channels = () if first is None else channels_of(Sheet(text, first.next, text.stop, 2, mark), headings)
        if not channels:
            raise FormatError(path, f"expected headings like {example}", "export the run again", line=1)
        return Contents(channels, zeros=text.zeros)

    return ColumnFormat(name, title, evidence, contents)
