"""The grammar of times: a cell as a time, and the rules for a column of times that is not in order.

A cell is a clock time, perhaps with a date, a zone and a word for the half of the day, in any order and in many
languages (:func:`clock_s`), or a duration (:func:`duration_s`). A column of times may step back for these reasons:

1. Fractions are whole numbers of milliseconds without leading zeros: 12.40 is 12.040 s.
2. Its counter wraps: adding one of :data:`_WRAPS` gives the usual step at every step back.
3. The rows come newest first.
4. Rows are out of place: sorted, their steps are regular, or at most three are moved.
5. Another block of rows begins (:mod:`acquisition.recordings.tables.blocks`).
"""

from __future__ import annotations

import datetime
import math
import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from acquisition.block import F8
from acquisition.recordings.sampling.timing import median
from acquisition.recordings.tables.numbers import EXPONENT, I1, UNREAD_CELL, quantity
from acquisition.recordings.tables.numbers import cell as number_of
from acquisition.recordings.tables.vocabulary import AM, MONTHS, PM
from acquisition.units import time_unit

_DAY_S = 86400.0
_CORE = (
    r"(?:(?P<h>\d{1,2}):(?P<m>\d{1,2}):(?P<s>\d{1,2})(?:[.,](?P<part>\d{1,9})|::?(?P<ms>\d{1,3}))?"
    r"|(?P<m3>\d{1,3}):(?P<s3>\d\d)[.,](?P<part3>\d{1,9})|(?P<h2>\d{1,2}):(?P<m2>\d\d)"
    r"|(?P<h4>\d{1,2})\.(?P<m4>\d\d)\.(?P<s4>\d\d)[.,](?P<part4>\d{1,9}))"
)
CLOCK = re.compile(
    rf"'?(?P<date>\d{{1,4}}[-./]\d{{1,2}}[-./]\d{{1,4}}[T ,]*)?{_CORE}"
    r"\s*(?P<half>[aApP]\.?[mM]\.?)?(?:Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)
_SEARCHED = re.compile(rf"(?<!\d)(?<!\d\.){_CORE}(?![\d:])", re.ASCII)
_COMPACT = re.compile(r"(?<!\d)(\d{4})(\d\d)(\d\d)[t ]?(\d\d)(\d\d)(\d\d)(?=[.,z+-]|$)")
_DATE = re.compile(r"\d{1,4} ?[-./] ?\d{1,2} ?[-./] ?\d{1,4}\.?[t,]?|\d{4}")
_WORD = re.compile(r"[^\W\d_][^\s\d_.,:;/\\-]*")  # with the vowel signs of Indian scripts, which are no letters
_ZONE = re.compile(r"^ ?[+-]\d\d:?\d\d|\b(utc|gmt|z|ce?s?t|uhr|kl)\b\.?")
_NUMBERED_MONTH = re.compile(r" ?,? th(?:g|áng) (\d\d?),? ")  # 17 tháng 4, 2025
_SIGNS_OF_TIME = str.maketrans(
    {
        **dict.fromkeys("年月년월", "-"),
        **dict.fromkeys("日일", " "),
        **dict.fromkeys("時时点시分분", ":"),
        "秒": "",
        "초": "",
    }
)
_DURATION = re.compile(
    r"(?:(?P<minus>-)?p?(?P<d>\d+) ?(?:d|days?|tage?|jours?|d[ií]as?),? ?)?(?P<sign>[-+])?"
    r"(?:(?P<h>\d+):(?P<m>\d\d):(?P<s>\d\d(?:[.,]\d+)?)"
    r"|p?t?(?:(?P<h2>\d+) ?h(?:\w+)? ?)?(?:(?P<m2>\d+) ?m(?:in\w*)? ?)?(?:(?P<s2>\d+(?:[.,]\d+)?) ?s(?:\w+)?)?)"
)
_WRAPS = (
    *(float(power) * unit for unit in (1.0, 1e-3, 1e-6) for power in (1 << 16, 1 << 24, 1 << 31, 1 << 32)),
    *(60.0, 3600.0, _DAY_S / 2, _DAY_S),
)
_MOST_MOVED = 3
_RISING = 0.1  # maximum number of rising steps for each falling one, in rows that come newest first


class ClockTime(NamedTuple):
    """A time in a cell: the day, a proleptic ordinal or 0 without a clear date, seconds, and the printed decimals."""

    day: int
    seconds: float
    decimals: int


def clock_s(cell: str) -> ClockTime | None:
    """Return the time of day in a cell, with the date if its order of day and month is clear; None for other text."""
    match = CLOCK.fullmatch(cell)
    if match is None and ("\t" in cell or ";" in cell):
        return None
    if match is not None:
        return _clock(match, _numeric_day((match["date"] or "").strip(" ,T")), (match["half"] or "").lower()[:1])
    text = unicodedata.normalize("NFC", cell.casefold()).translate(_SIGNS_OF_TIME)
    text = _COMPACT.sub(r"\1-\2-\3 \4:\5:\6", _NUMBERED_MONTH.sub(r"-\1-", text)).strip(" '")
    match = _SEARCHED.search(text)
    if match is None:
        return None
    beside = f"{text[: match.start()]} {_ZONE.sub('', text[match.end() :])}"
    half = "p" if PM.search(beside) else "a" if AM.search(beside) else ""
    beside = (PM if half == "p" else AM).sub("", beside).strip(" ,:[]")
    months = [month for word in _WORD.findall(beside) if (month := _month(word))]
    numbers = [int(each) for each in re.findall(r"\d+", beside)]
    if not re.search(r"\w", beside):
        return _clock(match, 0, half)
    if len(months) != 1 or len(numbers) not in (1, 2):
        day = _numeric_day("".join(beside.split()).strip("t,-"))
        return _clock(match, day, half) if _DATE.fullmatch(beside) else None
    day, year = numbers if len(numbers) == 2 else (numbers[0], 1970)
    if day > 31:
        day, year = year, day
    return _clock(match, _ordinal(year if year > 99 else 2000 + year, months[0], day), half)


def _clock(match: re.Match[str], day: int, half: str) -> ClockTime:
    hour = int(match["h"] or match["h2"] or match["h4"] or 0)
    hour = hour % 12 + 12 * (half == "p") if half else hour
    part = f"{match['ms']:0>3}" if match["ms"] else match["part"] or match["part3"] or match["part4"] or ""
    seconds = float(f"{match['s'] or match['s3'] or match['s4'] or 0}.{part}")
    minutes = int(match["m"] or match["m2"] or match["m3"] or match["m4"])
    if match["h2"] and hour > 23:  # 59:50 is minutes and seconds
        hour, minutes, seconds = 0, hour, float(minutes)
    return ClockTime(day, round(hour * 3600 + minutes * 60 + seconds, len(part)), len(part))


@lru_cache(maxsize=64)
def _numeric_day(date: str) -> int:
    """Return the ordinal of a date that begins with its year, or has a number above 12 as its day; else 0."""
    numbers = [int(each) for each in re.findall(r"\d+", date)]
    if len(numbers) != 3:
        return 0
    if len(re.findall(r"\d+", date)[0]) == 4:
        return _ordinal(*numbers)
    if numbers[2] > 99 and (numbers[0] > 12) != (numbers[1] > 12):
        return _ordinal(numbers[2], *sorted(numbers[:2]))
    return 0


def _ordinal(year: int, month: int, day: int) -> int:
    try:
        return datetime.date(year, month, day).toordinal()
    except (ValueError, OverflowError):  # of a number of thirteen digits
        return 0


@lru_cache(maxsize=256)
def _month(word: str) -> int:
    """Return the number of a month by the longest stem with which a word begins; 0 for other words."""
    stems = {stem: number for number, of_month in enumerate(MONTHS, 1) for stem in of_month if word.startswith(stem)}
    return stems[max(stems, key=len)] if stems else 0


def duration_s(cell: str) -> tuple[float, int] | None:
    """Return a duration in seconds and its decimals: ``0 days 00:00:00.010``, ``PT0.01S``, ``1 min 2 s``, ``10 ms``."""
    pair = quantity(cell)
    if pair is not None and (unit := time_unit(pair[1])) is not None:
        number, decimals = number_of(pair[0])
        places = max(0, decimals % EXPONENT - unit.power - round(math.log10(unit.factor)))
        return round(number * 10.0**unit.power * unit.factor, places + 6 * (decimals >= EXPONENT)), places
    match = _DURATION.fullmatch(cell.lower())
    parts = [match[name] for name in ("d", "h", "h2", "m2", "s2") if match[name]] if match else []
    if match is None or not parts or not (len(parts) > 1 or match["d"] or cell[:1] in "pP"):
        return None
    h, m, s = (match[name] or match[f"{name}2"] or "0" for name in "hms")
    decimals = len(s.replace(",", ".").partition(".")[2])
    size = int(h) * 3600 + int(m) * 60 + float(s.replace(",", "."))
    days = int(match["d"] or 0) * (-1 if match["minus"] else 1)
    return round(days * _DAY_S + (-size if match["sign"] == "-" else size), decimals), decimals


def is_time_cell(cell: str) -> bool:
    """Return whether a cell is a clock time or a duration."""
    return clock_s(cell) is not None or duration_s(cell) is not None


def clock_times(cells: Sequence[bytes]) -> tuple[F8, I1]:
    """Return times in seconds and their decimals; clock times are counted from the first, also across midnight."""
    values, decimals = np.full(len(cells), np.nan), np.full(len(cells), UNREAD_CELL, np.int8)
    days, clocks = np.zeros(len(cells)), np.zeros(len(cells), bool)
    for row, each in enumerate(cells):
        cell = each.strip(b'"').decode("utf-8", "replace")
        if (clock := clock_s(cell)) is not None:
            days[row], values[row], decimals[row] = clock
            clocks[row] = True
        elif (duration := duration_s(cell)) is not None:
            values[row], decimals[row] = duration
    filled = np.flatnonzero(decimals >= 0)
    if clocks.any() and filled.size:
        at, days = values[filled], days[filled]
        if not days.all():
            steps = np.diff(at)
            midnights = (steps < -_DAY_S / 2).astype(float)
            if is_newest_first(at):
                midnights = -(steps > _DAY_S / 2).astype(float)
            days = np.concatenate(([0.0], np.cumsum(midnights)))
        at = at + _DAY_S * (days - days[0])
        first = at[-1 if is_newest_first(at) else 0]
        unpadded = (np.diff(at) < 0).any() and _padded(at, decimals[filled]) is not None
        values[filled] = np.round(at - (math.floor(first) if unpadded else first), decimals[filled].max())
    return values, decimals


def in_order(t: F8, forms: I1 | None) -> tuple[F8, str]:
    """Return times of which every step back was undone that is a fraction without zeros or a wrap, and a remark.

    The remark is empty if the times stay as they are.
    """
    filled = np.flatnonzero(np.isfinite(t))
    steps = np.diff(t[filled])
    back = steps < 0
    if filled.size < 3 or not back.any() or not (steps > 0).any():
        return t, ""
    mended = t.copy()
    if forms is not None and (padded := _padded(t[filled], forms[filled])) is not None:
        mended[filled] = padded
        return mended, "the digits behind the point of the times are whole numbers without leading zeros"
    usual = median(steps[steps > 0])
    longest = max(2.0 * usual, float(np.sort(steps)[-max(1, steps.size // 100)]))
    for wrap in _WRAPS:
        if np.ptp(t[filled]) > wrap:
            continue
        after = steps[back] + wrap
        if (
            after.min() >= -1e-9 * wrap
            and after.max() <= longest * (1 + 1e-6)
            and not _are_whole_minutes(t[filled], back, wrap)
        ):
            mended[filled] += np.concatenate(([0.0], np.cumsum(back * wrap)))
            count = int(np.count_nonzero(back))
            return mended, f"the clock starts again after {wrap:.10g}, {count} time{'s' if count > 1 else ''}"
    return t, ""


def _are_whole_minutes(t: F8, back: np.ndarray, wrap: float) -> bool:
    """Return whether blocks of exactly a minute or an hour, each from zero on, are rather several recordings."""
    edges = np.concatenate(([0], np.flatnonzero(back) + 1, [t.size]))
    return wrap in (60.0, 3600.0) and t[0] == 0.0 and bool(np.ptp(np.diff(edges)) <= 1)


def _padded(t: F8, forms: I1) -> F8 | None:
    """Return times whose fractions are whole numbers of milli-, micro- or nanoseconds; None for other times."""
    most = int(forms.max())
    if most < 2 or most > 9 or most >= EXPONENT or (forms < 1).any():
        return None
    whole = np.floor(t)
    digits = np.rint((t - whole) * 10.0**forms)
    padded: F8 = whole + digits / 10.0 ** (3 * -(-most // 3))
    short = digits < 10.0 ** (forms - 1)  # begins with zero
    if (short & (digits > 0)).any() or (short & (forms > 1)).any() or (np.diff(padded) < 0).any():
        return None
    return padded


def is_newest_first(t: F8) -> bool:
    """Return whether times fall in nearly every row; they may rise where a counter wraps."""
    steps = np.diff(t[np.isfinite(t)])
    return bool((steps < 0).any() and np.count_nonzero(steps > 0) < _RISING * np.count_nonzero(steps < 0))


def out_of_place(t: F8) -> bool:
    """Return whether sorting gives regular steps, or moves at most three rows, each to a place that was free."""
    finite = t[np.isfinite(t)]
    before, after = np.diff(finite), np.diff(np.sort(finite))
    if not (before < 0).any():
        return False
    usual = median(after)
    if usual > 0 and after.min() >= 0.5 * usual and after.max() <= 1.5 * usual:
        return True
    gaps = np.count_nonzero(after > 1.5 * usual) <= np.count_nonzero(before > 2.5 * usual)
    moved = np.count_nonzero(finite < np.maximum.accumulate(finite))
    return bool(moved <= _MOST_MOVED and after.min() >= 0.5 * usual and gaps)
