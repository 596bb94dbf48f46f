"""Choose a channel according to the user's answers, and ask for information that neither file nor user states."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.questions import Missing, MissingItem, Question, Times
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.timing import rate_needed
from acquisition.recordings.tables.contents import (
    Arrays,
    Channel,
    Contents,
    Sheet,
    candidates,
    channel_of_name,
    name_and_unit,
    of_run,
    split_heading,
)
from acquisition.recordings.tables.text import parse_number
from acquisition.recordings.units import MEASURES, TIMES, Measure, measure_of, time_power, unit_words

__all__ = ["Answers", "choose_channel", "measure"]

_SLOW_S = 0.999
"""Time steps of a second or more without a unit may be milliseconds, so their unit must be stated."""
_FIRST_ROWS = 50
_SHARE_OF_RESTARTS = 0.2
_LAST_BYTES = 4096
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e8, "s"))
"""Units of times since 1970, each with the minimum of the numbers to which it applies."""
_LIKELY = (
    (re.compile(r"gyr|omega|ω|ang\w*[ _.]*(vel|speed|ges)|winkelges|^g[xyz](?![^\W_])", re.IGNORECASE), "rad/s"),
    (re.compile(r"acc|beschl|versn|^a[xyz](?![^\W_])|g[-_ ]?f|^ac[xyz]", re.IGNORECASE), "m/s2"),
    (re.compile(r"vel|speed|^v(?![^\W\d_])|^v[xyz](?![^\W_])|geschw", re.IGNORECASE), "m/s"),
    (re.compile(r"theta|θ|phi|φ|ang|winkel|rad|rotat|roll|pitch|yaw", re.IGNORECASE), "rad"),
    (re.compile(r"volt|spannung|^ch|signal|tens|^ai?\d|ampl", re.IGNORECASE), "V"),
    (re.compile(r"force|kraft|forza|fuerza", re.IGNORECASE), "N"),
)


@dataclass(frozen=True, slots=True)
class Answers:
    """The user's statements about a file; None for each item that is not stated."""

    channel: str | None = None
    rate_hz: float | None = None
    unit: str | None = None
    run: str | None = None
    time: str | None = None
    time_unit: str | None = None


def choose_channel(path: str, contents: Contents, answers: Answers) -> Channel:
    """Return the channel to read, with its times, or ask for everything that is missing in one question.

    Raises
    ------
    NeedsAnswer
        If anything is missing; the question lists the columns and all missing items.
    FormatError
        If an answer contradicts the file.
    """
    needs: list[MissingItem] = []
    if answers.run is None and len(contents.runs) > 1:
        needs.append(MissingItem(Missing.RUN, contents.runs, contents.runs[0]))
    channels = of_run(path, contents, contents.runs[0] if needs else answers.run)
    if answers.channel is not None:
        chosen = channel_of_name(path, channels, answers.channel)
    else:
        fit = candidates([each for each in channels if each.name != answers.time] or channels)
        chosen = next((each for each in fit if each.measure), fit[0])
        if len(fit) > 1:
            needs.append(MissingItem(Missing.CHANNEL, tuple(each.name for each in fit), chosen.name))
    if answers.time is not None:
        chosen = _timed_by(path, channels, chosen, answers.time)
    if isinstance(chosen.source, Sheet) and chosen.time is not None and _restarts(chosen.source, chosen.time):
        chosen = replace(chosen, time=None, formula=None)  # chunks of times, with unknown intervals between them
    chosen = _with_time_unit(path, chosen, answers.time_unit)
    needs.extend(_missing_times(channels, chosen, answers))
    if chosen.measure is None and answers.unit is None:
        needs.append(_unit(chosen))
    if needs:
        columns = tuple(each.label for each in channels)
        raise NeedsAnswer(Question(path, tuple(needs), columns, _times(chosen)))
    return chosen


def _unit(chosen: Channel) -> MissingItem:
    example = "1" if chosen.unit else _likely_unit(chosen.name)
    others = (unit for unit in MEASURES if unit != unit_words(example))
    return MissingItem(Missing.UNIT, (example, *others), example, of=chosen.name, stated=chosen.unit)


def measure(path: str, channel: Channel, unit: str | None) -> tuple[Measure, tuple[Trap, ...]]:
    """Return the measure of the channel's values, and the assumptions made for it.

    Raises
    ------
    FormatError
        If the given unit is unknown or contradicts the file.
    """
    stated = channel.measure
    given = None if unit is None else measure_of(unit)
    if unit is not None and given is None:
        raise FormatError(path, f'unit must be one of {", ".join(MEASURES)}, got "{unit}"', "name one of these")
    if given is None:
        if stated is None:
            raise NeedsAnswer(Question(path, (_unit(channel),), (channel.label,)))
        return stated, ()
    if stated == given:
        return given, ()
    if stated is not None and (stated.quantity in ("length", given.quantity)):
        problem = f'unit must be {unit_words(channel.unit)} as stated by "{channel.label}", got "{unit}"'
        raise FormatError(path, problem, "leave the unit out")
    if not channel.unit:
        return given, (Trap("unit_given", f'you stated the unit of "{channel.name}": {unit}'),)
    holds = "times, frequencies and damping rates are not affected"
    if given.quantity == "number":
        return given, (Trap("unit_given", f'"{channel.label}" is read as plain numbers, as you asked; {holds}'),)
    kind = f"is no {'distance' if given.quantity == 'length' else given.quantity.replace('_', ' ')}"
    holds += ", but everything in metres is in that unit" if given.quantity == "length" else ""
    message = f'"{channel.label}" {kind}: one {channel.unit} counts as one {unit}, as you asked; {holds}'
    return given, (Trap("unit_assumed", message),)


def _timed_by(path: str, channels: Sequence[Channel], chosen: Channel, time: str) -> Channel:
    """Return the channel with the named column as its times."""
    source = chosen.source
    if isinstance(source, Arrays):
        return _timed_by_values(path, channels, chosen, source, time)
    column = _column(source, time)
    if column is None:
        others = [each for each in channels if each.name != chosen.name and each.source is source]
        column = channel_of_name(path, others or channels, time, Missing.TIME).column
    if column == chosen.time:
        return chosen
    if column == chosen.column:
        raise FormatError(path, f'"{time}" cannot be both channel and time', "name another column for one of them")
    units = {each.time: each.time_unit for each in channels} | {each.column: each.unit for each in channels}
    unit = units.get(column, "")
    return replace(chosen, time=column, time_unit=unit if time_power(unit) is not None else "", formula=None)


def _column(sheet: Sheet, name: str) -> int | None:
    """Return the column with a name, with or without unit, or a number such as "column 2"; None if there is none."""
    bare = " ".join(name_and_unit(name)[0].lower().split())
    for wanted in (" ".join(name.lower().split()), bare):
        for column, each in enumerate(sheet.names):
            if each and " ".join(each.lower().split()) == wanted:
                return column
    number = re.fullmatch(r"column (\d{1,4})", bare)
    return int(number[1]) - 1 if number and 0 < int(number[1]) <= (len(sheet.names) or 1 << 12) else None


def _timed_by_values(path: str, channels: Sequence[Channel], chosen: Channel, source: Arrays, time: str) -> Channel:
    """Return the channel with another array as its times."""
    for each in channels:
        label = each.source.time_name if isinstance(each.source, Arrays) else ""
        if label and time.strip().lower() in (label.lower(), f"{label} ({each.time_unit})".lower()):
            times, unit = each.source, each.time_unit
            t = times.t if isinstance(times, Arrays) else None
            break
    else:
        column = channel_of_name(
            path, [each for each in channels if each.name != chosen.name] or channels, time, Missing.TIME
        )
        t, unit = (column.source.values if isinstance(column.source, Arrays) else None), column.unit
    if t is None or t.size != source.values.size:
        raise FormatError(path, f'"{time}" and "{chosen.name}" differ in length', "name another column of times")
    unit = unit if time_power(unit) is not None else ""
    return replace(chosen, source=Arrays(t, source.values, time), time_unit=unit, formula=None)


def _with_time_unit(path: str, chosen: Channel, unit: str | None) -> Channel:
    if unit is None:
        return chosen
    if time_power(unit) is None:
        raise FormatError(path, f'time unit must be one of {", ".join(TIMES)}, got "{unit}"', "name one of these")
    if chosen.source.t is None if isinstance(chosen.source, Arrays) else chosen.time is None:
        raise FormatError(path, f"time unit {unit} was given, but there is no column of times", "leave it out")
    if time_power(chosen.time_unit) is not None and unit_words(chosen.time_unit) != unit_words(unit):
        stated = unit_words(chosen.time_unit)
        raise FormatError(path, f'time unit must be {stated} as stated by the file, got "{unit}"', "leave it out")
    return replace(chosen, time_unit=unit)


def _missing_times(channels: Sequence[Channel], chosen: Channel, answers: Answers) -> list[MissingItem]:
    source = chosen.source
    if isinstance(source, Arrays):
        untimed = source.t is None and chosen.formula is None
    else:
        untimed = chosen.time is None and chosen.formula is None
    if untimed:
        if answers.rate_hz is not None:
            return []
        others = tuple(each.name for each in channels if each.name != chosen.name)
        return [rate_needed(MissingItem(Missing.TIME, others, others[0]) if others else None)]
    if time_power(chosen.time_unit) is not None or chosen.formula is not None:
        return []
    times = _times_at_first(chosen)
    if chosen.time_unit or (times.size > 1 and float(np.median(np.diff(times))) >= _SLOW_S):
        example = _likely_time_unit(times)
        return [MissingItem(Missing.TIME_UNIT, tuple(TIMES), example, of=_time_name(chosen), stated=chosen.time_unit)]
    return []


def _likely_time_unit(times: F8) -> str:
    """Return the most likely unit of times, judging by their size and their steps."""
    if times.size < 2:
        return "ms"
    since_1970 = next((unit for from_size, unit in _EPOCHS if times[0] >= from_size), None)
    return since_1970 or ("us" if float(np.median(np.diff(times))) >= 1000.0 else "ms")


def _restarts(sheet: Sheet, column: int) -> bool:
    """Return whether times repeatedly jump back, as in chunks of a few samples."""
    steps = np.diff(_first_times(sheet, column))
    return bool(steps.size >= 4 and np.mean(steps < 0) >= _SHARE_OF_RESTARTS)


def _first_times(sheet: Sheet, column: int, limit: int = _FIRST_ROWS) -> F8:
    read = []
    for line in sheet.text.lines(sheet.start):
        quoted = sheet.delimiter and '"' in line.text
        cells = split_heading(line.text, sheet.delimiter)[0] if quoted else line.text.split(sheet.delimiter or None)
        value = parse_number(cells[column].strip(' "')) if column < len(cells) else None
        if value is not None:
            read.append(value)
        if len(read) == limit or line.start > sheet.start + 65536:
            break
    return np.array(read)


def _times_at_first(chosen: Channel) -> F8:
    """Return the first times of a channel, in its unit; empty if it has none."""
    source = chosen.source
    if isinstance(source, Sheet):
        return np.empty(0) if chosen.time is None else _first_times(source, chosen.time)
    return np.empty(0) if source.t is None else source.t[:_FIRST_ROWS]


def _time_name(chosen: Channel) -> str:
    source = chosen.source
    if isinstance(source, Arrays):
        return source.time_name
    return source.names[chosen.time] if chosen.time is not None and chosen.time < len(source.names) else ""


def _times(chosen: Channel) -> Times | str:
    """Return the range of the times, only their name if there are too few numbers, or an empty text without times."""
    source = chosen.source
    if isinstance(source, Sheet):
        if chosen.time is None:
            return ""
        name, ends = (
            _time_name(chosen) or "time",
            _last_times(source, max(source.start, source.stop - _LAST_BYTES), chosen.time),
        )
    else:
        if source.t is None or not source.time_name:
            return ""
        name, ends = source.time_name, source.t
    first = _times_at_first(chosen)
    first, ends = first[np.isfinite(first)], ends[np.isfinite(ends)]
    if first.size < 2 or not ends.size:
        return name
    return Times(name, float(first[0]), float(ends[-1]), float(np.median(np.diff(first))))


def _last_times(sheet: Sheet, tail: int, column: int) -> F8:
    """Return the times from byte ``tail`` to the end, without the incomplete line at the beginning."""
    line = tail if tail == sheet.start else sheet.text.data.find(b"\n", tail, sheet.stop) + 1 or tail
    return _first_times(replace(sheet, start=line), column, _LAST_BYTES)


def _likely_unit(name: str) -> str:
    return next((unit for words, unit in _LIKELY if words.search(name)), "m")
