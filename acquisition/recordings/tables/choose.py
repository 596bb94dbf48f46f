"""Choose a channel according to the user's answers, and ask for information that neither file nor user states."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.reading import READ_DEFAULTS, ReadOptions
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import median, rate_needed
from acquisition.recordings.tables.blocks import runs_of
from acquisition.recordings.tables.headings import BRACKETED, name_and_unit
from acquisition.recordings.tables.table import Column, Table
from acquisition.recordings.tables.vocabulary import (
    AUTOCORRELATION,
    DERIVED,
    FREQUENCY,
    OSCILLATES,
    POSITION_WORDS,
    UNIT_OF_NAME,
)
from acquisition.units import MEASURES, TIMES, Measure, measure_of, time_unit, unit_words

_SLOW_S = 0.999
"""Time steps of a second or more without a unit may be milliseconds, so their unit must be stated."""
_DAY_STEPS = (1e-9, 2e-5)
_LATE = 2e4
"""Steps without a unit of this size, so many of them after zero, are rather fractions of a day (0.1 ms to 2 s)."""
_FIRST_ROWS = 50
_ROWS_SHOWN, _COLUMNS_SHOWN = 6, 12
_SOME = 20_000
_FEWEST_ROWS, _FEWEST_TURNS, _MOST_NAMES = 20, 4, 4
_SHARE_OF_RESTARTS = 0.2
_READ_TIMES = "write them in seconds or like 2025-04-17 17:00:08.010; or state the rate, if you know it"
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e8, "s"))
"""Units of times since 1970, each with the minimum of the numbers to which it applies."""
Channel = tuple[Table, Column]


def choose_channel(path: str, tables: Sequence[Table], answers: ReadOptions) -> Channel:
    """Return the channel to read, in a table with its times, or ask for everything that is missing in one question."""
    if answers == READ_DEFAULTS and not any(_may_be_a_recording(table) for table in tables):
        _refuse_what_is_no_motion(path, tables[0], tables[0].columns[0])
        raise _no_recording(path, tables[0])
    needs: list[MissingItem] = []
    runs = tuple(dict.fromkeys(table.run for table in tables))
    sizes = {run: max(_rows(table) for table in tables if table.run == run) for run in runs}
    run = max(runs, key=lambda each: sizes[each])  # the first of the longest
    if answers.run is not None:
        if runs == ("",) and answers.run and answers.time is None:
            problem = f'the file has one run without a name, got run "{answers.run}"'
            raise FormatError(path, problem, "leave run out")
        run = runs[_index_of_name(path, Missing.RUN, [(each,) for each in runs], answers.run) if runs != ("",) else 0]
    elif len(runs) > 1:
        needs.append(MissingItem(Missing.RUN, runs, run))
    channels = [(table, column) for table in tables if table.run == run for column in table.columns]
    if answers.channel is not None:
        names = [(each.name, each.label) for _, each in channels]
        table, column = channels[_index_of_name(path, Missing.CHANNEL, names, answers.channel)]
    else:
        fit = _candidates([each for each in channels if each[1].name != answers.time] or channels)
        table, column = next((each for each in fit if each[1].measure), fit[0])
        if len(fit) > 1:
            needs.append(MissingItem(Missing.CHANNEL, tuple(each.name for _, each in fit), column.name))
    if answers.time is not None:
        table = _run_of(path, runs_of(_timed_by(path, table, column, answers.time)), answers.run)
        column = next((each for each in table.columns if each.name == column.name), column)
    if table.times is not None and table.lines is not None and _restarts(table.times):
        table = replace(table, times=None, formula=None)  # chunks of times, with unknown intervals between them
    _refuse_what_is_no_motion(path, table, column)
    if answers.time_unit is not None:
        table = _with_time_unit(path, table, answers.time_unit)
    needs.extend(_missing_times(path, [each for _, each in channels], table, column, answers))
    if column.measure is None and answers.unit is None:
        needs.append(_unit_needed(column))
    if needs:
        labels = tuple(each.label for _, each in channels)
        raise NeedsAnswer(Question(path, tuple(needs), labels, _range_of(table.times), rows=_first_rows(table)))
    return table, column


def _first_rows(table: Table) -> tuple[tuple[str, ...], ...]:
    """Return the names of the first columns and their first numbers, for a person who is to choose among them."""
    times = () if table.times is None else (table.times,)
    columns = [*times, *table.columns][:_COLUMNS_SHOWN]
    cells = [["" if np.isnan(x) else f"{x:.9g}" for x in each.values[:_ROWS_SHOWN]] for each in columns]
    return tuple(each.label for each in columns), *zip_longest(*cells, fillvalue="")


def measure(path: str, column: Column, unit: str | None) -> tuple[Measure, tuple[FormatIssue, ...]]:
    """Return the measure of a channel's values, and the assumptions made for it."""
    of_file, given = column.measure, measure_of(unit or "")
    if unit is None and of_file is not None:
        return of_file, ()
    if given is None:
        raise FormatError(path, f'unit must be one of {", ".join(MEASURES)}, got "{unit}"', "name one of these")
    if of_file == given:
        return given, ()
    if of_file is not None and column.words is not None:
        problem = f'each row of "{column.name}" states its unit, got "{unit}"'
        raise FormatError(path, problem, f"leave the unit out, or state {of_file.symbol}")
    if of_file is not None and of_file.quantity == given.quantity:
        message = f'you stated the unit {unit} for "{column.label}": the unit of the file is not used'
        return given, (FormatIssue("unit_given", message),)
    if not column.unit:
        return given, (FormatIssue("unit_given", f'you stated the unit of "{column.name}": {unit}'),)
    holds = "times, frequencies and damping rates are not affected"
    if given.quantity == "number":
        return given, (FormatIssue("unit_given", f'"{column.label}" is read as plain numbers, as you asked; {holds}'),)
    kind = f"is no {'distance' if given.quantity == 'length' else given.quantity.replace('_', ' ')}"
    holds += ", but everything in metres is in that unit" if given.quantity == "length" else ""
    message = f'"{column.label}" {kind}: one {column.unit} counts as one {unit}, as you asked; {holds}'
    return given, (FormatIssue("unit_assumed", message),)


def _candidates(channels: Sequence[Channel]) -> Sequence[Channel]:
    """Return the possible channels if the user names none, likely ones first.

    They are the lengths, or else all but auxiliary columns. What counts evenly or never changes does not oscillate.
    """
    fit = [each for each in channels if not each[1].aside] or channels
    fit = [each for each in fit if _varies(_some_of(each[1]))] or fit
    fit = [each for each in fit if each[1].is_length] or fit
    return sorted(fit, key=lambda each: _unlikely(each[1]))


def _refuse_what_is_no_motion(path: str, table: Table, column: Column) -> None:
    """Refuse a spectrum and an autocorrelation."""
    names, found = [column.name, table.times.name if table.times is not None else ""], ""
    if any(AUTOCORRELATION.search(name) for name in names):
        found = f'the autocorrelation "{" against ".join(filter(None, names))}"'
    for each in (table.beside or table.columns) if not table.is_timed else ():
        rises = np.diff(_some_of(each))
        if (FREQUENCY.search(each.name) or each.unit.lower() in ("hz", "khz")) and rises.size and (rises > 0).all():
            found = f'a spectrum or a resonance curve against "{each.label}"'
    if found:
        raise FormatError(path, f"not a recording of a motion, but {found}", "export the data against time")


def _may_be_a_recording(table: Table) -> bool:
    """Return whether a table has times, or enough rows of something that goes up and down and may oscillate."""
    if table.is_timed:
        return True
    return _rows(table) >= _FEWEST_ROWS and any(_may_oscillate(each, len(table.columns) == 1) for each in table.columns)


def _rows(table: Table) -> int:
    return max(column.values.size for column in table.columns)


def _may_oscillate(column: Column, alone: bool) -> bool:
    """Return whether a column turns, and names something that may oscillate or is alone and smooth."""
    values = column.values[:_SOME][np.isfinite(column.values[:_SOME])]
    steps = np.diff(values)
    turns = np.count_nonzero(np.diff(np.sign(steps[steps != 0]))) >= _FEWEST_TURNS
    named = column.measure is not None or OSCILLATES.search(column.name)
    return bool(turns and (named or (alone and np.var(steps) < np.var(values))))


def _no_recording(path: str, table: Table) -> FormatError:
    names = [each.name for each in (table.beside or table.columns) if each.name][:_MOST_NAMES]
    listed = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    problem = f"not a recording: it looks like a table of {_rows(table)} rows of {listed}"
    need = "a recording has a column of times, or a rate, and one that goes up and down, in 20 rows or more"
    return FormatError(path, problem, f"{need}; if this is one, state its rate or its column of times")


def _varies(values: F8) -> bool:
    """Return whether numbers neither stay the same nor rise or fall in equal steps."""
    steps = np.diff(values)
    return not steps.size or bool(np.ptp(steps) > 1e-9 * np.abs(steps).max())


def _unlikely(column: Column) -> tuple[bool, bool, float]:
    """Return a key that puts likely channels first: positions, then by unit, the axis that moves most before others."""
    plain = column.name.lower()
    named = column.is_length or bool(POSITION_WORDS.search(plain))
    derived = bool(DERIVED.search(plain))
    has_unit = column.measure is not None
    some = _some_of(column)
    with np.errstate(all="ignore"):  # a file may have numbers whose squares are infinite
        spread = float(np.std(some)) if has_unit and some.size else 0.0
    return derived, not named, -spread


def _some_of(column: Column) -> F8:
    """Return numbers from all over a column."""
    some = column.values[:: max(1, column.values.size // _SOME)]
    return some[np.isfinite(some)]


def _index_of_name(path: str, what: Missing, names: Sequence[tuple[str, ...]], wanted: str) -> int:
    """Return the index of the item with a name in one of its forms, or ask which one is meant."""
    number = re.compile(rf"\D*#?\s*0*{re.escape(wanted.strip())}")  # "2" is enough for "Run #2"
    for fits in (
        lambda forms: wanted == forms[0],
        lambda forms: wanted in forms,
        lambda forms: _plain(wanted) in map(_plain, forms),
        lambda forms: what is Missing.RUN and number.fullmatch(forms[0]),
        lambda forms: what is Missing.CHANNEL and wanted.strip() and _plain(forms[-1]).startswith(_plain(wanted)),
        lambda forms: what is Missing.CHANNEL and _plain(wanted) in _plain(forms[0]).split(),
    ):
        if alike := [at for at, forms in enumerate(names) if fits(forms)]:
            break
    if len(alike) == 1:
        return alike[0]
    kind = "runs" if what is Missing.RUN else "columns"
    reason = f'{what} "{wanted}" ' + (f"is the name of {len(alike)} {kind}" if alike else "is not in the file")
    choices = tuple(forms[0] for forms in names)
    raise NeedsAnswer(Question(path, (MissingItem(what, choices, choices[0]),), reason=reason))


def _plain(name: str) -> str:
    match = BRACKETED.fullmatch(name.strip())
    if match and match["name"]:
        name = f"{match['name']} ({unit_words(match['unit'])})"
    return " ".join(name.lower().split())


def _timed_by(path: str, table: Table, column: Column, time: str) -> Table:
    """Return the table with another column as its times, named with or without its unit, or by its number."""
    beside = table.beside or table.columns
    number = re.fullmatch(r"column (\d{1,4})", name_and_unit(time)[0].strip().lower())
    at = int(number[1]) - 1 if number else -1
    others = [each for each in beside if each.values is not column.values] or [column]
    names = [(each.name, each.label) for each in others]
    times = beside[at] if 0 <= at < len(beside) else others[_index_of_name(path, Missing.TIME, names, time)]
    if table.times is not None and times.values is table.times.values:
        return table
    if times.values is column.values:
        raise FormatError(path, f'"{time}" cannot be both channel and time', "name another column for one of them")
    if table.lines is None and times.values.size != column.values.size:
        raise FormatError(path, f'"{time}" and "{column.name}" differ in length', "name another column of times")
    if not np.isfinite(times.values).any():
        raise FormatError(path, f'the times in column "{times.name}" cannot be read', _READ_TIMES)
    unit = times.unit if time_unit(times.unit) is not None else ""
    return replace(table, times=replace(times, unit=unit), formula=None)


def _run_of(path: str, parts: Sequence[Table], run: str | None) -> Table:
    """Return the run that the user names, of the runs that the named times make of a table."""
    if len(parts) == 1:
        return parts[0]
    names = tuple(each.run for each in parts)
    if run is None:
        raise NeedsAnswer(Question(path, (MissingItem(Missing.RUN, names, names[0]),)))
    return parts[_index_of_name(path, Missing.RUN, [(each,) for each in names], run)]


def _with_time_unit(path: str, table: Table, unit: str) -> Table:
    if time_unit(unit) is None:
        raise FormatError(path, f'time unit must be one of {", ".join(TIMES)}, got "{unit}"', "name one of these")
    if table.times is None:
        raise FormatError(path, f"time unit {unit} was given, but there is no column of times", "leave it out")
    times, of_file = table.times, unit_words(table.times.unit)
    traps = table.traps
    if time_unit(of_file) is not None and of_file != unit_words(unit):
        message = f'you stated the unit {unit} for "{times.label}": the unit of the file is not used'
        traps = (*traps, FormatIssue("unit_given", message))
    return replace(table, times=replace(times, unit=unit), traps=traps)


def _missing_times(
    path: str, columns: Sequence[Column], table: Table, column: Column, answers: ReadOptions
) -> list[MissingItem]:
    if not table.is_timed:
        if answers.rate_hz is not None:
            return []
        if table.unread_times:
            raise FormatError(path, table.unread_times, _READ_TIMES)
        others = tuple(each.name for each in columns if each.name != column.name)
        return [rate_needed(MissingItem(Missing.TIME, others, others[0]) if others else None)]
    if table.times is None or table.formula is not None or time_unit(table.times.unit) is not None:
        return []
    first = _first_numbers(table.times)
    if table.times.unit or (first.size > 1 and (float(median(np.diff(first))) >= _SLOW_S or _are_days(first))):
        unit, name = table.times.unit, table.times.name
        return [MissingItem(Missing.TIME_UNIT, tuple(TIMES), _likely_time_unit(first), of=name, stated=unit)]
    return []


def _unit_needed(column: Column) -> MissingItem:
    likely = next((unit for words, unit in UNIT_OF_NAME if words.search(column.name)), "m")
    example = "1" if column.unit else likely
    others = (unit for unit in MEASURES if unit != unit_words(example))
    return MissingItem(Missing.UNIT, (example, *others), example, of=column.name, stated=column.unit)


def _likely_time_unit(times: F8) -> str:
    """Return the most likely unit of times, judging by their size and their steps."""
    if times.size < 2:
        return "ms"
    if _are_days(times):
        return "d"
    since_1970 = next((unit for from_size, unit in _EPOCHS if times[0] >= from_size), None)
    return since_1970 or ("us" if median(np.diff(times)) >= 1000.0 else "ms")


def _are_days(times: F8) -> bool:
    """Return whether times are rather fractions of a day, as Excel shows a time that is formatted as a number."""
    step = median(np.diff(times))
    return bool(_DAY_STEPS[0] < step < _DAY_STEPS[1] and times[0] > _LATE * step)


def _restarts(times: Column) -> bool:
    """Return whether times repeatedly jump back, as in chunks of a few samples."""
    steps = np.diff(_first_numbers(times))
    return bool(steps.size >= 4 and np.mean(steps < 0) >= _SHARE_OF_RESTARTS)


def _first_numbers(column: Column) -> F8:
    head = column.values[: 10 * _FIRST_ROWS]
    return head[np.isfinite(head)][:_FIRST_ROWS]


def _range_of(times: Column | None) -> str:
    """Return the name of the times, with their range if there are enough numbers; an empty text without times."""
    if times is None:
        return ""
    name = f'"{times.name or "time"}"'
    first, finite = _first_numbers(times), times.values[np.isfinite(times.values)]
    if first.size < 2:
        return name
    return f"{name} ({first[0]:.6g} to {finite[-1]:.6g}, {median(np.diff(first)):.3g} apart)"
