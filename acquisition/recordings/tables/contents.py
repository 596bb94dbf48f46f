"""The content of a file before a channel is chosen: runs, channels, units, and the locations of their numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from acquisition.block import F8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.text import Text
from acquisition.recordings.units import Measure, measure_of, unit_words
from acquisition.source import ClockKind

__all__ = [
    "Arrays",
    "Channel",
    "Contents",
    "Formula",
    "Heading",
    "Sheet",
    "candidates",
    "channel_of_name",
    "channels_apart",
    "channels_of",
    "is_time",
    "is_uncertainty",
    "name_and_unit",
    "numbered_apart",
    "of_run",
    "split_heading",
]

_TIME_WORDS = frozenset(
    (
        *("time", "times", "t", "elapsed", "timestamp", "seconds", "secs", "millis", "milliseconds", "micros"),
        *("zeit", "tempo", "tempi", "temps", "tiempo", "tiempos", "tijd", "tid", "czas", "čas", "aika", "idő"),
        *("zaman", "время", "时间", "時間", "시간"),
    )
)
_BESIDE_TIME = frozenset(
    (
        *(
            "axis",
            "value",
            "stamp",
            "data",
            "set",
            "run",
            "latest",
            "elapsed",
            "relative",
            "absolute",
            "since",
            "start",
        ),
        *("velocity", "acceleration", "raw", "sensor", "gps", "system", "rel", "abs"),
    )
)
"""Words that may accompany the word for time in a time column's name; other words denote, for example, a period."""
_WORDS = re.compile(r"[^\W\d_]+\d*|\d+")
_ACCELERATION = re.compile(r"acc|beschl|versn|g[-_ ]?f|^a(?![^\W\d_])|^a[xyz](?![^\W_])", re.IGNORECASE)
_UNCERTAIN = re.compile(
    r".*\b(u?n?certain\w*|err\w*|sigma|std|incert\w*|unsicher\w*|fehler|sd)\b.*|[dδΔσu][_ ]?[a-zθφ]|[a-zθφ]'|[\d.,]+",
    re.IGNORECASE,
)
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_HEADING = re.compile(r"(?P<name>.*?)\s*[(\[<](?P<unit>[^()\[\]<>]*)[)\]>]\s*")
_NO_UNIT = re.compile(r"\d+|.*:.*")  # text in brackets that is the number of a channel, or a remark


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """The rows below one header.

    Parameters
    ----------
    text : Text
    start, stop : int
        Byte positions where the rows begin and end.
    first_line : int
        One-based line number of the first row.
    delimiter : str
    width : int or None
        Number of cells in every row if all of them are numbers; None if rows may be ragged.
    names : tuple of str
        Names of all columns, including times, if the family knows them. The user can then name one as the times.
    """

    text: Text
    start: int
    stop: int
    first_line: int
    delimiter: str
    width: int | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Arrays:
    """Numbers of a binary file, or numbers that have already been read.

    Parameters
    ----------
    t : (n,) float64 or None
        Times in the channel's unit of time.
    values : (n,) float64
    time_name : str
        Name of the array of times; empty if the file does not state it.
    """

    t: F8 | None
    values: F8
    time_name: str = ""


@dataclass(frozen=True, slots=True)
class Formula:
    """Times ``start_s + i * step_s`` as stated in a header, and the number of samples, if the header states it."""

    start_s: float
    step_s: float
    samples: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One channel of one run.

    Parameters
    ----------
    name : str
        Its name in the file, without the unit.
    unit : str
        Unit as printed in the file; empty if the file states none.
    run : str
        Name of the run; empty for a single run without a name.
    source : Sheet or Arrays
    column : int
        Column of the sheet.
    time : int or None
        Column of its times; None if there is no such column.
    time_unit : str
        Unit of the times as printed in the file; empty if the file states none.
    formula : Formula or None
    clock : {"nominal", "device", "host"}
        Kind of the clock for times that fit no regular grid.
    start_time : str
        Start time in ISO 8601 if the file states it; else empty.
    ragged : bool
        Whether the channel may end before its times, because other channels share these times.
    difference : bool
        Whether its values are differences from the preceding row, so that the first value is NaN.
    aside : bool
        Whether it is an auxiliary column (a row number, an uncertainty), which is read only if it is named.
    """

    name: str
    unit: str
    source: Sheet | Arrays
    run: str = ""
    column: int = 0
    time: int | None = None
    time_unit: str = ""
    formula: Formula | None = None
    clock: ClockKind = "device"
    start_time: str = ""
    ragged: bool = False
    difference: bool = False
    aside: bool = False

    @property
    def label(self) -> str:
        """Name and unit, as a user may write it."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def measure(self) -> Measure | None:
        """The measure of its unit; None for an unknown unit.

        The unit g means standard gravity if the channel's name denotes an acceleration; otherwise it means gram.
        """
        measure = measure_of(self.unit if self.unit != "G" else "g")
        grams = measure is not None and measure.symbol in ("g", "mg") and not _ACCELERATION.search(self.name)
        return None if grams else measure

    @property
    def is_length(self) -> bool:
        """Whether its unit is a length."""
        return self.measure is not None and self.measure.quantity == "length"


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """The content of a file.

    Parameters
    ----------
    channels : tuple of Channel
        At least one channel; times are not channels.
    title : str
    traps : tuple of Trap
        Remarks on the file as a whole.
    zeros : int
        Number of bytes at the end that were left out, because they are zero bytes.
    """

    channels: tuple[Channel, ...]
    title: str = ""
    traps: tuple[Trap, ...] = ()
    zeros: int = field(default=0)

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs, in the file's order."""
        return tuple(dict.fromkeys(channel.run for channel in self.channels))


def name_and_unit(heading: str) -> tuple[str, str]:
    """Split a heading into name and unit.

    Examples
    --------
    >>> name_and_unit('"Position (mm)"'), name_and_unit("Time ( s )"), name_and_unit("velocity")
    (('Position', 'mm'), ('Time', 's'), ('velocity', ''))
    """
    plain = heading.strip().strip('"').strip()
    match = _HEADING.fullmatch(plain)
    if not match or not match["name"] or _NO_UNIT.fullmatch(match["unit"].strip()):
        return plain, ""
    return match["name"].strip(), match["unit"].strip()


def is_time(name: str) -> bool:
    """Return whether a column's name denotes time, in one of a dozen languages.

    Examples
    --------
    >>> is_time("Zeit"), is_time("Position"), is_time("t_{1}"), is_time("time for 10 swings")
    (True, False, True, False)
    """
    words = [word.rstrip("0123456789") or word for word in _WORDS.findall(_CAMEL.sub(" ", name).lower())]
    time_words = [word for word in words if word in _TIME_WORDS]
    others = [word for word in words if word not in time_words]
    if not time_words or words[0].isdecimal() or (len(words[0]) == 1 and words[0] not in _TIME_WORDS):
        return False
    return all(len(word) == 1 or word.isdecimal() or word in _BESIDE_TIME for word in others)


def is_uncertainty(name: str) -> bool:
    """Return whether a column's name denotes the uncertainty of another column.

    Examples
    --------
    >>> is_uncertainty("uncertainty t"), is_uncertainty("dx"), is_uncertainty("Position")
    (True, True, False)
    """
    return bool(_UNCERTAIN.fullmatch(name.strip()))


def candidates(channels: Sequence[Channel]) -> Sequence[Channel]:
    """Return the possible channels if the user names none: the lengths, or else all channels but auxiliary columns."""
    fit = [each for each in channels if not each.aside] or channels
    return [each for each in fit if each.is_length] or fit


def channel_of_name(path: str, channels: Sequence[Channel], name: str, what: Missing = Missing.CHANNEL) -> Channel:
    """Return the channel with a given name, which may include the unit.

    Raises
    ------
    NeedsAnswer
        If no channel, or more than one, has this name; the question lists them.
    """
    wanted = _plain(name)
    exact = [each for each in channels if each.name == name] or [each for each in channels if each.label == name]
    alike = exact or [each for each in channels if wanted in (_plain(each.label), _plain(each.name))]
    if len(alike) == 1:
        return alike[0]
    choices = tuple(each.name for each in channels)
    reason = f'{what} "{name}" ' + (f"is the name of {len(alike)} columns" if alike else "is not in the file")
    raise NeedsAnswer(Question(path, (MissingItem(what, choices, choices[0]),), reason=reason))


def of_run(path: str, contents: Contents, run: str | None) -> Sequence[Channel]:
    """Return the channels of a run, by default of the first.

    Raises
    ------
    NeedsAnswer
        If no run, or more than one, has this name; the question lists them.
    FormatError
        If ``run`` is given, but the only run of the file has no name.
    """
    runs = contents.runs
    if run is None or run == runs[0]:
        return [each for each in contents.channels if each.run == runs[0]]
    if runs == ("",):
        raise FormatError(path, f'the file has one run without a name, got run "{run}"', "leave run out")
    called = [name for name in runs if name == run] or [name for name in runs if _plain(name) == _plain(run)]
    # "2" is enough for "Run #2".
    called = called or [name for name in runs if re.fullmatch(rf"\D*#?\s*0*{re.escape(run.strip())}", name)]
    if len(called) != 1:
        reason = f'run "{run}" ' + (f"is the name of {len(called)} runs" if called else "is not in the file")
        raise NeedsAnswer(Question(path, (MissingItem(Missing.RUN, runs, runs[0]),), reason=reason))
    return [each for each in contents.channels if each.run == called[0]]


def _plain(name: str) -> str:
    match = _HEADING.fullmatch(name.strip())
    if match and match["name"]:
        name = f"{match['name']} ({unit_words(match['unit'])})"
    return " ".join(name.lower().split())


def numbered_apart(names: Sequence[str]) -> list[str]:
    """Return unique names: repetitions of a name get a number.

    Examples
    --------
    >>> numbered_apart(["a", "b", "a"])
    ['a', 'b', 'a [2]']
    """
    seen: dict[str, int] = {}
    apart: dict[str, None] = {}
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        while (numbered := name if seen[name] == 1 else f"{name} [{seen[name]}]") in apart:
            seen[name] += 1  # the file already contains this numbered name
        apart[numbered] = None
    return list(apart)


def channels_apart(channels: Sequence[Channel]) -> tuple[Channel, ...]:
    """Return channels with unique names within each run, so that each can be chosen."""
    names: dict[int, str] = {}
    for run in dict.fromkeys(each.run for each in channels):
        own = [each for each in channels if each.run == run]
        names.update(zip(map(id, own), numbered_apart([each.name for each in own]), strict=True))
    return tuple(replace(each, name=names[id(each)]) for each in channels)


def split_heading(line: str, mark: str = "") -> tuple[list[str], str]:
    """Split a line of headings, quoted or not; return its cells and their separator.

    The separator is detected if ``mark`` is empty.

    Examples
    --------
    >>> split_heading('"Time (s)","Length, total (m)"')
    (['Time (s)', 'Length, total (m)'], ',')
    """
    bare = re.sub(r'"[^"]*"', "", line)
    mark = mark or next((mark for mark in "\t;," if mark in bare), "\t")
    cells = [each.strip() for each in re.split(rf'{mark}(?=(?:[^"]*"[^"]*")*[^"]*$)', line)]
    while cells and not cells[-1]:
        cells.pop()
    return [cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell for cell in cells], mark


@dataclass(frozen=True, slots=True)
class Heading:
    """The heading of a column."""

    name: str
    unit: str
    run: str = ""


def channels_of(sheet: Sheet, headings: Sequence[Heading], *, clock: ClockKind = "device") -> tuple[Channel, ...]:
    """Return the channels of a sheet: each has the times to its left, or the first times of its run.

    If any heading names a run, columns without a heading are ignored.

    Parameters
    ----------
    sheet : Sheet
    headings : sequence of Heading
        One heading for each column.
    clock : {"nominal", "device", "host"}
        Kind of the clock for times that fit no regular grid.
    """
    times = [column for column, each in enumerate(headings) if is_time(each.name)]
    channels = []
    sheet = replace(sheet, names=tuple(each.name for each in headings))
    runs = any(each.run for each in headings)
    named_columns = [column for column, each in enumerate(headings) if each.name or each.run or not runs]
    values = [column for column in named_columns if column not in times]
    for run in dict.fromkeys(headings[column].run for column in values):
        own = [column for column in values if headings[column].run == run]
        of_run = [column for column in times if headings[column].run == run]
        names = numbered_apart([headings[column].name or f"column {column + 1}" for column in own])
        for column, name in zip(own, names, strict=True):
            time = max((each for each in of_run if each < column), default=of_run[0] if of_run else None)
            time_unit = "" if time is None else headings[time].unit
            unit, aside = headings[column].unit, name.lower().startswith("date") or is_uncertainty(name)
            channels.append(Channel(name, unit, sheet, run, column, time, time_unit, clock=clock, aside=aside))
    return tuple(channels)
