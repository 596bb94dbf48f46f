"""Headings of columns: their words for time and uncertainty, their units, and distinct names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from acquisition.recordings.tables.vocabulary import BESIDE_TIME, TIME_WORDS, UNCERTAINTIES
from acquisition.units import measure_of, time_unit, unit_words

_WORDS = re.compile(r"[^\W\d_]+\d*|\d+")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[<](?P<unit>[^()\[\]<>]*)[)\]>]\s*")
_NO_UNIT = re.compile(r"\d+|.*:.*")  # text in brackets that is the number of a channel, or a remark
_SLASH = re.compile(r"(?P<name>.*?\S)\s*/\s*(?P<unit>[^\s/]+(?:/[^\s/]+)?)")
_TAIL = re.compile(r"(?P<name>.*?[^\W_])(?:[_ ](?:in )?|,\s*|:)(?P<unit>[^\W_]+(?:/s(?:ec)?(?:\^?2|²)?)?|°(?:/s)?)")
_IN = re.compile(r"(?P<name>.*?\S)\s+in\s+(?P<unit>\S+)")
_NO_TAIL = frozenset(("1", "in", "g", "mg"))
"""Units that often end a name without being its unit: ``V_in``, ``x_1``."""

ColumnRole = Literal["", "channel", "time", "aside", "ignored"]


@dataclass(frozen=True, slots=True)
class Heading:
    """What the lines above the rows say of a column.

    Parameters
    ----------
    name, unit : str
        As printed; empty if there is none.
    run : str
        Name of the run, if the runs of a file are side by side.
    role : {"", "channel", "time", "aside", "ignored"}
        By default the name decides. A column that is aside is read only if the user names it.
    """

    name: str
    unit: str = ""
    run: str = ""
    role: ColumnRole = ""


def role_of(heading: Heading) -> ColumnRole:
    """Return the role of a column, from its name if the heading does not state it."""
    if heading.role:
        return heading.role
    if is_time(heading.name):
        return "time"
    return "aside" if heading.name.lower().startswith("date") or is_uncertainty(heading.name) else "channel"


def name_and_unit(heading: str) -> tuple[str, str]:
    """Split a heading into its name and its unit in brackets."""
    plain = heading.strip().strip('"').strip()
    match = BRACKETED.fullmatch(plain)
    if not match or not match["name"] or _NO_UNIT.fullmatch(match["unit"].strip()):
        return plain, ""
    return match["name"].strip(), match["unit"].strip()


def headings_of(cells: Sequence[str]) -> list[Heading]:
    """Return the headings in cells, each with its unit in brackets."""
    return [Heading(*name_and_unit(cell)) for cell in cells]


def heading_of(cell: str) -> tuple[str, str]:
    """Split a heading into name and unit: the unit is in brackets, after a slash, or after a last underscore."""
    name, unit = name_and_unit(cell)
    if unit:
        return name, unit
    if name in ("mm", "cm") or (is_time(name) and time_unit(name) is not None):  # nanoseconds, ms
        return name, unit_words(name)
    for form in (_SLASH, _TAIL, _IN):
        match = form.fullmatch(name)
        if match and (form is _SLASH or _ends(match["name"], match["unit"])):
            return match["name"].strip(), match["unit"].strip()
    return name, ""


def _ends(name: str, unit: str) -> bool:
    """Return whether the end of a name is its unit; h and d are units only for a time."""
    if unit in _NO_TAIL or (unit in ("h", "d") and not is_time(name)):
        return False
    return measure_of(unit) is not None or time_unit(unit) is not None


def is_time(name: str) -> bool:
    """Return whether a column's name denotes time, in one of a dozen languages."""
    all_words = [word.rstrip("0123456789") or word for word in _WORDS.findall(_CAMEL.sub(" ", name).lower())]
    time_words = [word for word in all_words if word in TIME_WORDS]
    others = [word for word in all_words if word not in time_words]
    if not time_words or all_words[0].isdecimal() or (len(all_words[0]) == 1 and all_words[0] not in TIME_WORDS):
        return False
    return all(len(word) == 1 or word.isdecimal() or word in BESIDE_TIME for word in others)


def is_uncertainty(name: str) -> bool:
    """Return whether a column's name denotes the uncertainty of another column."""
    return bool(UNCERTAINTIES.fullmatch(name.strip()))


def split_heading(line: str, mark: str = "") -> tuple[list[str], str]:
    """Split a line of headings, quoted or not; return its cells and their separator, which is found if not given."""
    bare = re.sub(r'"[^"]*"', "", line)
    mark = mark or next((mark for mark in "\t;," if mark in bare), "\t")
    cells = [each.strip() for each in re.split(rf'{re.escape(mark)}(?=(?:[^"]*"[^"]*")*[^"]*$)', line)]
    while cells and not cells[-1]:
        cells.pop()
    return [cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell for cell in cells], mark


def unique(name: str, taken: set[str]) -> str:
    """Return a name that is not taken, with a number if need be, and take it."""
    apart, number = name, 1
    while apart in taken:
        apart, number = f"{name} [{number + 1}]", number + 1
    taken.add(apart)
    return apart
