"""Remove prefixes of rows: the clock times of a serial monitor, or the settings of an oscilloscope."""

from __future__ import annotations

import re
from collections import Counter

from acquisition.recordings.tables.contents import Heading
from acquisition.recordings.tables.text import Text, decode, unify

__all__ = ["without_prefix"]

_SETTINGS = "Record Length,"
_FEWEST, _SHARE = 3, 0.8
_DAY = r"(?:\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]+)?"
_MONITOR = re.compile(rf"\[?{_DAY}(\d{{1,2}}:\d\d:\d\d(?:[.,]\d{{1,9}})?)(?:\s*->\s*|\]\s*)")


def without_prefix(text: Text) -> tuple[Text, tuple[Heading, ...]] | None:
    """Return a text with the prefix of each row removed, and the headings in the prefix; None if there is no prefix.

    The clock time of a serial monitor becomes the first column. Tektronix writes settings in the first rows
    (``Record Length,2500,,-0.025,0.04,``); times and values are in the fourth and the fifth cell.

    Examples
    --------
    >>> text, _ = without_prefix(Text.of(b"15:00:25.3 -> 23.4\\n15:00:25.4 -> 23.5\\n15:00:25.5 -> 23.7\\n"))
    >>> text.data
    b'15:00:25.3 23.4\\n15:00:25.4 23.5\\n15:00:25.5 23.7\\n'
    """
    head = decode(text.data[text.start : min(text.start + (1 << 16), text.stop)])
    settings = head.startswith(_SETTINGS)
    if not settings and not _MONITOR.search(head):
        return None
    lines = unify(decode(text.data[text.start : text.stop])).split("\n")
    if settings:
        return _beside_settings(lines)
    prefixes = [_MONITOR.match(line) for line in lines]
    if sum(each is not None for each in prefixes) < max(_FEWEST, _SHARE * sum(bool(line.strip()) for line in lines)):
        return None
    remainders = [line[each.end() :] if each else line for line, each in zip(lines, prefixes, strict=True)]
    marks = Counter(next((m for m in "\t;," if m in remainder), " ") for remainder in remainders if remainder.strip())
    mark = marks.most_common(1)[0][0] if marks else " "
    rows = (
        f"{each[1]}{mark}{remainder}" if each else remainder
        for each, remainder in zip(prefixes, remainders, strict=True)
    )
    return Text.of("\n".join(rows).encode()), ()


def _beside_settings(lines: list[str]) -> tuple[Text, tuple[Heading, ...]] | None:
    cells = [[cell.strip() for cell in line.split(",")] for line in lines]
    stated = {row[0]: row[1] for row in cells if len(row) > 4 and row[0]}
    if not stated.get("Sample Interval"):
        return None
    rows = "\n".join("\t".join(row[3:5]) if len(row) > 4 else "" for row in cells)
    units = stated.get("Horizontal Units", ""), stated.get("Vertical Units", "")
    return Text.of(rows.encode()), (Heading("time", units[0]), Heading(stated.get("Source", ""), units[1]))
