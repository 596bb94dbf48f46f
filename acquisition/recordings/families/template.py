"""A template for a new family of recordings: copy it and change the marked lines.

1. Copy this file to ``acquisition/recordings/families/NAME.py``. The docstring describes a file, with a few real lines,
   and what is easy to misread.
2. ``_evidence`` takes the head of a file and returns a few words on why the file belongs to this family, or an empty
   text if it does not. It uses the content, never the file's name, and never raises.
3. ``_contents`` finds the headers and describes the layout: runs, channels, units, times. It reads no numbers:
   :class:`acquisition.recordings.tables.sheet.ColumnFormat` does that and handles all faults of rows.
4. Leave empty each item that the file does not state (unit, times). The reader then asks the user for it.
5. Add one line to ``_TABLE`` of ``acquisition/recordings/identify.py``, or, in a separate package, an entry point in
   the group ``springmass.formats``.
6. Add one ``Case`` to ``tests/conformance/test_formats.py``.

The logger of this template is invented. Each line is the number of the sample and its height in millimetres::

    Height log, 100 Hz
    0;201.52
    1;201.87
"""

from __future__ import annotations

import re

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Channel, Contents, Formula, Sheet
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import head_lines, text_of

__all__ = ["FORMAT"]

_TITLE = re.compile(r"Height log, (\d+(?:\.\d+)?) Hz")  # change: a title that only your files have


def _evidence(head: bytes) -> str:
    first = head_lines(head)[0]
    return f'line 1 is the title "{first}"' if _TITLE.fullmatch(first) else ""


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    first = next(text.lines(), None)
    title = _TITLE.fullmatch(first.text) if first else None
    if first is None or title is None or not float(title[1]) > 0:
        raise FormatError(path, "expected the title of a height log", "export the run again", line=1)
    rows = Sheet(text, start=first.next, stop=text.stop, first_line=2, delimiter=";")
    # change: a channel for each column except the times. If a column contains times: time=COLUMN, time_unit="s".
    height = Channel("height", "mm", rows, column=1, formula=Formula(start_s=0.0, step_s=1 / float(title[1])))
    return Contents((height,), title=first.text, zeros=text.zeros)


FORMAT = ColumnFormat("example", "height log: number;millimetres (a template)", _evidence, _contents)
