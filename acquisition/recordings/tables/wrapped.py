"""Rows that are wrapped in words or brackets: what a serial monitor shows, JSON, lists of Python, a table of Markdown.

Lines that differ in their numbers alone are rows (``15:00:25.399 -> Distance: 23.4 cm``, ``{"t": 0.1, "x": 2.5}``,
``(0.1, 2.5),``, ``| 0.1 | 2.5 |``); the words around the numbers are names and units. Lists with names
(``t = [0.1, ...]``) are columns. All become rows between tabs, for the reader of tables.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence

from acquisition.recordings.tables.contents import Heading
from acquisition.recordings.tables.finding import heading_of
from acquisition.recordings.tables.text import Text, decode

__all__ = ["SETTINGS", "begins_with_lists", "unwrapped"]

SETTINGS = "Record Length,"
"""How a file of Tektronix begins that has the settings beside its first rows: ``Record Length,2500,,-0.025,0.04,``."""

_FEWEST, _SHARE, _PROBE = 3, 0.8, 40
_OF_TEXT = 0.3  # so much of a text must be lists, if these are what it holds
_NUMBER = r"(?<![\w.])[-+]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:[eE][-+]?\d{1,3})?(?![\d:])"
_CLOCK = r"(?<![\w.:])\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?(?![\d:])"
_CELL = re.compile(rf"{_CLOCK}|{_NUMBER}")
_DAY = r"(?:\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]+)?"
_MONITOR = re.compile(rf"\[?{_DAY}({_CLOCK})(?:\s*->\s*|\]\s*)")
_LIST_NAME = r"""["']?(?P<name>[^\W\d][\w ()/^.]{0,40}?)["']?\s*[:=]\s*(?:(?:np\.)?array\(\s*)?\["""
_CELLS = r"(?P<cells>[-+\d.,eE\s\"'naNul]+)"
_LIST, _LIST_BEGINS = re.compile(rf"{_LIST_NAME}{_CELLS}\]"), re.compile(_LIST_NAME + _CELLS)
_APART = re.compile(r"[,;|&{}\t\[\]]|\s{2,}|->")
_BLANK = str.maketrans("\t\r\n", "   ")
_EDGES = " \"':=\t()[]{}\\<>-,;|&"


def unwrapped(text: Text) -> tuple[Text, tuple[Heading, ...]] | None:
    """Return a text with its rows between tabs, and what the words around them call each column; None for others.

    Names and units are empty where rows have no words of their own.

    Examples
    --------
    >>> text, headings = unwrapped(Text.of(b"t: 0.1 s, x: 2\\nt: 0.2 s, x: 3\\nt: 0.3 s, x: 5\\n"))
    >>> text.data, [(each.name, each.unit) for each in headings]
    (b'0.1\\t2\\n0.2\\t3\\n0.3\\t5\\n', [('t', 's'), ('x', '')])
    """
    whole = decode(text.data[text.start : text.stop]).replace("\r\n", "\n").replace("\r", "\n")
    lists = _lists(whole)
    if lists is not None:
        return lists
    if whole.startswith(SETTINGS):
        return _beside_settings(whole.split("\n"))
    if whole.lstrip().startswith(("[{", "[[", "[(")):
        whole = re.sub(r"([}\])])\s*,\s*(?=[{\[(])", r"\1\n", whole.strip()[1:]).removesuffix("]")
    lines = whole.split("\n")
    if (objects := _objects(lines)) is not None:
        return objects
    if monitored := _monitored(lines):
        return Text.of(("\n".join(monitored)).encode()), ()
    skeletons = Counter(_skeleton(line) for line in lines[-_PROBE:] if line.strip())
    skeleton, count = skeletons.most_common(1)[0] if skeletons else ("", 0)
    if count < max(_FEWEST, _SHARE * sum(skeletons.values()) - 1) or "#" not in skeleton or not skeleton.strip("# \t"):
        return None
    rows = ["\t".join(_CELL.findall(line)) if _skeleton(line) == skeleton else _plain(line) for line in lines]
    whole_rows = "" if skeleton.endswith("#") else "\n"  # what stands behind the last number says that it is whole
    return Text.of(("\n".join(rows) + whole_rows).encode()), _headings(skeleton)


def begins_with_lists(head: str) -> bool:
    """Tell a text that begins with a list of numbers with its name, however long the list."""
    found = [each for each in _LIST_BEGINS.finditer(head) if len(_CELL.findall(each["cells"])) >= _FEWEST]
    return bool(found) and sum(len(each[0]) for each in found) >= _OF_TEXT * len(head)


def _skeleton(line: str) -> str:
    """Return a line with a mark for each number, whatever blanks stand before it or a comma behind the last."""
    return re.sub(r"\s+#", " #", _CELL.sub("#", line.strip())).rstrip(", ")


def _plain(line: str) -> str:
    """Return a line that is no row, a table's names say; the rule below these names is left empty."""
    if not line.strip("|-+:= \t"):
        return ""
    mark = next((each for each in "|&" if each in line), "")
    return "\t".join(cell.strip() for cell in line.strip("|\\ ").split(mark)) if mark else line


def _headings(skeleton: str) -> tuple[Heading, ...]:
    """Return what the words before and behind each number call it."""
    pieces = skeleton.split("#")
    names, units = [pieces[0]], []
    for piece in pieces[1:-1]:
        apart = [*_APART.finditer(piece)]
        if apart:
            unit, name = piece[: apart[0].start()], piece[apart[-1].end() :]
        elif piece.rstrip().endswith((":", "=")):  # "0.1 s Angle: 2.5"
            *before, name = piece.rstrip(" :=").split() or [""]
            unit = before[0] if before else ""
        else:
            unit, name = piece, ""
        units.append(unit)
        names.append(name)
    units.append(_APART.split(pieces[-1])[0])
    found = []
    for name, unit in zip((_APART.split(each)[-1] for each in names), units, strict=True):
        plain, own = heading_of(name.strip(_EDGES))
        found.append(Heading(plain if re.search(r"[^\W\d]", plain) else "", own or unit.strip(_EDGES + ".")))
    return tuple(found)


def _monitored(lines: Sequence[str]) -> list[str]:
    """Take the clock that a serial monitor puts before each line into a column; nothing where there is none."""
    found = [_MONITOR.match(line) for line in lines]
    if sum(each is not None for each in found) < max(_FEWEST, _SHARE * sum(bool(line.strip()) for line in lines)):
        return []
    rests = [line[each.end() :] if each else line for line, each in zip(lines, found, strict=True)]
    marks = Counter(next((m for m in "\t;," if m in rest), "") for rest in rests if rest.strip())
    mark = marks.most_common(1)[0][0]
    skeletons = Counter(_skeleton(rest) for rest in rests if rest.strip())
    if not mark and set(skeletons.most_common(1)[0][0]) - set("# \t"):
        return []  # words stand about the numbers
    return [
        f"{each[1]}{mark or ' '}{rest}" if each else line for line, rest, each in zip(lines, rests, found, strict=True)
    ]


def _objects(lines: Sequence[str]) -> tuple[Text, tuple[Heading, ...]] | None:
    """Return the columns of lines that are objects of JSON with the same keys; inner keys stand behind the outer."""
    filled = [line for line in lines if line.strip()]
    if not filled or not filled[0].lstrip().startswith("{"):
        return None
    found: list[dict[str, str] | None] = []
    for line in lines:
        try:
            told = json.loads(line.strip().rstrip(","), parse_float=str, parse_int=str)
        except ValueError:
            told = None
        found.append(dict(_flat("", told)) if isinstance(told, dict) else None)
    keys = list(next((each for each in found if each), {}))
    if not keys or sum(each is not None for each in found) < max(_FEWEST, _SHARE * len(filled)):
        return None
    rows = ("" if each is None else "\t".join(each.get(key, "") for key in keys) for each in found)
    return Text.of("\n".join(rows).encode() + b"\n"), tuple(Heading(*heading_of(key)) for key in keys)


def _flat(above: str, told: dict[str, object]) -> Iterator[tuple[str, str]]:
    for key, value in told.items():
        if isinstance(value, dict):
            yield from _flat(f"{above}{key} ", value)
        else:
            yield f"{above}{key}", "" if value is None else str(value).translate(_BLANK)


def _beside_settings(lines: Sequence[str]) -> tuple[Text, tuple[Heading, ...]] | None:
    """Return times and values, which stand in the fourth and the fifth cell."""
    cells = [[cell.strip() for cell in line.split(",")] for line in lines]
    told = {row[0]: row[1] for row in cells if len(row) > 4 and row[0]}
    rows = "\n".join("\t".join(row[3:5]) if len(row) > 4 else "" for row in cells)
    if not told.get("Sample Interval"):
        return None
    units = told.get("Horizontal Units", ""), told.get("Vertical Units", "")
    return Text.of(rows.encode()), (Heading("time", units[0]), Heading(told.get("Source", ""), units[1]))


def _lists(whole: str) -> tuple[Text, tuple[Heading, ...]] | None:
    """Return the columns of lists with names, all as long as the longest."""
    columns = {}
    lists = [*_LIST.finditer(whole)]
    if sum(len(each[0]) for each in lists) < _OF_TEXT * len(whole):
        return None  # a program that has a list somewhere
    for found in lists:
        cells = [cell.strip(" \n\"'") for cell in found["cells"].split(",")]
        if len(cells) >= _FEWEST and all(_CELL.fullmatch(cell) or cell in ("", "null", "nan", "NaN") for cell in cells):
            columns[found["name"].strip()] = [cell for cell in cells if cell]
    longest = max((len(cells) for cells in columns.values()), default=0)
    alike = {name: cells for name, cells in columns.items() if len(cells) == longest}
    if longest < _FEWEST:
        return None
    rows = "\n".join("\t".join(row).replace("null", "NaN") for row in zip(*alike.values(), strict=True)) + "\n"
    return Text.of(rows.encode()), tuple(Heading(*heading_of(name)) for name in alike)
