"""What a file holds, before any of it is taken as distance: runs, channels, units, and where their numbers stand."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from acquisition.block import F8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.questions import Missing, Need, Question
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
    "channels_apart",
    "channels_of",
    "is_time",
    "is_uncertainty",
    "name_and_unit",
    "named",
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
"""Words that a time may have beside its own: what else stands there makes it a time of something, a period say."""
_WORDS = re.compile(r"[^\W\d_]+\d*|\d+")
_ACCELERATION = re.compile(r"acc|beschl|versn|g[-_ ]?f|^a(?![^\W\d_])|^a[xyz](?![^\W_])", re.IGNORECASE)
_UNCERTAIN = re.compile(
    r".*\b(u?n?certain\w*|err\w*|sigma|std|incert\w*|unsicher\w*|fehler|sd)\b.*|[dδΔσu][_ ]?[a-zθφ]|[a-zθφ]'|[\d.,]+",
    re.IGNORECASE,
)
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_HEADING = re.compile(r"(?P<name>.*?)\s*[(\[<](?P<unit>[^()\[\]<>]*)[)\]>]\s*")
_NO_UNIT = re.compile(r"\d+|.*:.*")  # the number of a channel, a remark


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """Rows below one header.

    Parameters
    ----------
    text : Text
    start, stop : int
        Bytes where the rows begin and end.
    first_line : int
        One-based line of the first row.
    delimiter : str
    width : int or None
        Cells that a row must have, all of them numbers; None where rows may be ragged.
    names : tuple of str
        What each column is called, times among them, where the family tells; so that a user may name one as the time.
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
    """Numbers that a file holds in binary, or that were read already.

    Parameters
    ----------
    t : (n,) float64 or None
        Times in the channel's unit of time.
    values : (n,) float64
    time_name : str
        What the times are called; empty where the file does not say.
    """

    t: F8 | None
    values: F8
    time_name: str = ""


@dataclass(frozen=True, slots=True)
class Formula:
    """Times ``start_s + i * step_s`` as a header states them, and how many samples it declares, if it does."""

    start_s: float
    step_s: float
    samples: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One channel of one run.

    Parameters
    ----------
    name : str
        As the file calls it, without unit.
    unit : str
        As the file prints it; empty where it does not.
    run : str
        Empty where the file holds one run without a name.
    source : Sheet or Arrays
    column : int
        Of the sheet.
    time : int or None
        Column of its times; None where there is none.
    time_unit : str
        As the file prints it; empty where it does not.
    formula : Formula or None
    clock : {"nominal", "device", "host"}
        What times that fit no regular grid are.
    start_time : str
        ISO 8601, as the file states it; empty where it does not.
    ragged : bool
        Whether it may end before its times do, which then belong to others.
    difference : bool
        Whether its values differ from the row before: the first has nothing to differ from, and NaN is right there.
    aside : bool
        Whether it is there beside others (a row number, an uncertainty) and is taken only where it is named.
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
        """What its unit says that its values are of; None where it says nothing.

        A g is standard gravity only of what is called an acceleration, else a gram.
        """
        found = measure_of(self.unit if self.unit != "G" else "g")
        grams = found is not None and found.symbol in ("g", "mg") and not _ACCELERATION.search(self.name)
        return None if grams else found

    @property
    def is_length(self) -> bool:
        """Whether its unit is a length."""
        return self.measure is not None and self.measure.quantity == "length"


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """Everything that a file holds.

    Parameters
    ----------
    channels : tuple of Channel
        At least one; times are no channels.
    title : str
    traps : tuple of Trap
        What was seen in the file as a whole.
    zeros : int
        Zero bytes at the end, left out.
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
    """Take a heading apart.

    Examples
    --------
    >>> name_and_unit('"Position (mm)"'), name_and_unit("Time ( s )"), name_and_unit("velocity")
    (('Position', 'mm'), ('Time', 's'), ('velocity', ''))
    """
    plain = heading.strip().strip('"').strip()
    found = _HEADING.fullmatch(plain)
    if not found or not found["name"] or _NO_UNIT.fullmatch(found["unit"].strip()):
        return plain, ""
    return found["name"].strip(), found["unit"].strip()


def is_time(name: str) -> bool:
    """Tell whether a column's name says time, in one of a dozen languages.

    Examples
    --------
    >>> is_time("Zeit"), is_time("Position"), is_time("t_{1}"), is_time("time for 10 swings")
    (True, False, True, False)
    """
    words = [word.rstrip("0123456789") or word for word in _WORDS.findall(_CAMEL.sub(" ", name).lower())]
    told = [word for word in words if word in _TIME_WORDS]
    beside = [word for word in words if word not in told]
    if not told or words[0].isdecimal() or (len(words[0]) == 1 and words[0] not in _TIME_WORDS):
        return False
    return all(len(word) == 1 or word.isdecimal() or word in _BESIDE_TIME for word in beside)


def is_uncertainty(name: str) -> bool:
    """Tell whether a column's name says that it is the uncertainty of another's values.

    Examples
    --------
    >>> is_uncertainty("uncertainty t"), is_uncertainty("dx"), is_uncertainty("Position")
    (True, True, False)
    """
    return bool(_UNCERTAIN.fullmatch(name.strip()))


def candidates(channels: Sequence[Channel]) -> Sequence[Channel]:
    """Return the channels that may be meant where none is named: the lengths, or else all that do not stand aside."""
    fit = [each for each in channels if not each.aside] or channels
    return [each for each in fit if each.is_length] or fit


def named(path: str, channels: Sequence[Channel], name: str, what: Missing = Missing.CHANNEL) -> Channel:
    """Return the channel of a name, with or without its unit.

    Raises
    ------
    NeedsAnswer
        If none, or more than one, is called so; the question lists them.
    """
    wanted = _plain(name)
    exact = [each for each in channels if each.name == name] or [each for each in channels if each.label == name]
    alike = exact or [each for each in channels if wanted in (_plain(each.label), _plain(each.name))]
    if len(alike) == 1:
        return alike[0]
    choices = tuple(each.name for each in channels)
    reason = f'{what} "{name}" ' + (f"is the name of {len(alike)} columns" if alike else "is not in the file")
    raise NeedsAnswer(Question(path, (Need(what, choices, choices[0]),), reason=reason))


def of_run(path: str, contents: Contents, run: str | None) -> Sequence[Channel]:
    """Return the channels of the run asked for.

    Raises
    ------
    NeedsAnswer
        If none, or more than one, is called so; the question lists them.
    FormatError
        If the file holds one run without a name.
    """
    runs = contents.runs
    if run is None or run == runs[0]:
        return [each for each in contents.channels if each.run == runs[0]]
    if runs == ("",):
        raise FormatError(path, f'run "{run}" is not in the file, which holds one run without a name', "leave run out")
    called = [name for name in runs if name == run] or [name for name in runs if _plain(name) == _plain(run)]
    # "2" is enough for "Run #2".
    called = called or [name for name in runs if re.fullmatch(rf"\D*#?\s*0*{re.escape(run.strip())}", name)]
    if len(called) != 1:
        reason = f'run "{run}" ' + (f"is the name of {len(called)} runs" if called else "is not in the file")
        raise NeedsAnswer(Question(path, (Need(Missing.RUN, runs, runs[0]),), reason=reason))
    return [each for each in contents.channels if each.run == called[0]]


def _plain(name: str) -> str:
    found = _HEADING.fullmatch(name.strip())
    if found and found["name"]:
        name = f"{found['name']} ({unit_words(found['unit'])})"
    return " ".join(name.lower().split())


def numbered_apart(names: Sequence[str]) -> list[str]:
    """Return names of which none occurs twice: the second of a name gets a number.

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
            seen[name] += 1  # a name of the file looks numbered
        apart[numbered] = None
    return list(apart)


def channels_apart(channels: Sequence[Channel]) -> tuple[Channel, ...]:
    """Return channels of which no two of a run share a name, so that each can be chosen."""
    names: dict[int, str] = {}
    for run in dict.fromkeys(each.run for each in channels):
        own = [each for each in channels if each.run == run]
        names.update(zip(map(id, own), numbered_apart([each.name for each in own]), strict=True))
    return tuple(replace(each, name=names[id(each)]) for each in channels)


def split_heading(line: str, mark: str = "") -> tuple[list[str], str]:
    """Split a line of headings, quoted or not; return its cells and what separates them, told or found.

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
    """What stands above a column."""

    name: str
    unit: str
    run: str = ""


def channels_of(sheet: Sheet, headings: Sequence[Heading], *, clock: ClockKind = "device") -> tuple[Channel, ...]:
    """Return the channels of a sheet: each has the times to its left, or the first of its run.

    Beside columns of runs, a column without a heading is of none.

    Parameters
    ----------
    sheet : Sheet
    headings : sequence of Heading
        One for each column.
    clock : {"nominal", "device", "host"}
        What times on no regular grid are.
    """
    times = [column for column, each in enumerate(headings) if is_time(each.name)]
    found = []
    sheet = replace(sheet, names=tuple(each.name for each in headings))
    runs = any(each.run for each in headings)
    named = [column for column, each in enumerate(headings) if each.name or each.run or not runs]
    values = [column for column in named if column not in times]
    for run in dict.fromkeys(headings[column].run for column in values):
        own = [column for column in values if headings[column].run == run]
        of_run = [column for column in times if headings[column].run == run]
        names = numbered_apart([headings[column].name or f"column {column + 1}" for column in own])
        for column, name in zip(own, names, strict=True):
            time = max((each for each in of_run if each < column), default=of_run[0] if of_run else None)
            time_unit = "" if time is None else headings[time].unit
            unit, aside = headings[column].unit, name.lower().startswith("date") or is_uncertainty(name)
            found.append(Channel(name, unit, sheet, run, column, time, time_unit, clock=clock, aside=aside))
    return tuple(found)
