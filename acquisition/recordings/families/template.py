"""A template: copy it, and change what is marked. The recipe for a new family of recordings.

1. Copy this file to ``acquisition/recordings/families/NAME.py``. Say in the docstring what a file looks like, with a
   few real lines, and what a careless reader would take at face value.
2. ``_evidence`` tells from the head of a file, in a few words, why it is of this family; the words are empty where it
   is not. It goes by content, never by the file's name, and never raises.
3. ``_contents`` finds the headers and says what stands where: runs, channels, units, times. It reads no numbers:
   :class:`acquisition.recordings.tables.sheet.ColumnFormat` does that, with everything that can be wrong in them.
4. What the file does not say stays empty: unit, times. The user is then asked for it by name.
5. One line in ``_TABLE`` of ``acquisition/recordings/identify.py``, or, in a package of your own, an entry point in
   the group ``springmass.formats``.
6. One ``Case`` in ``tests/conformance/test_formats.py``.

The logger of this template is invented. It writes millimetres, one a line, behind the number of the sample::

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

_TITLE = re.compile(r"Height log, (\d+(?:\.\d+)?) Hz")  # change: what only your files have


def _evidence(head: bytes) -> str:
    first = head_lines(head)[0]
    return f'line 1 is the title "{first}"' if _TITLE.fullmatch(first) else ""


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    first = next(text.lines(), None)
    found = _TITLE.fullmatch(first.text) if first else None
    if first is None or found is None or not float(found[1]) > 0:
        raise FormatError(path, "expected the title of a height log", "export the run again", line=1)
    rows = Sheet(text, start=first.next, stop=text.stop, first_line=2, delimiter=";")
    # change: a channel for each column that is no time. Where a column holds times: time=COLUMN, time_unit="s".
    height = Channel("height", "mm", rows, column=1, formula=Formula(start_s=0.0, step_s=1 / float(found[1])))
    return Contents((height,), title=first.text, zeros=text.zeros)


FORMAT = ColumnFormat("example", "height log: number;millimetres (a template)", _evidence, _contents)
