"""A template for a new family of recordings: copy it and change the marked lines.

1. Copy this file to ``acquisition/recordings/families/NAME.py``. The docstring describes a file, with a few real lines,
   and what is easy to misread.
2. ``header`` takes the first lines of a text and says what they mean, or returns None for lines of another family. It
   uses the content, never the file's name, and never raises. Everything else is shared by all families.
3. Leave out each item that the file does not state (unit, times). The reader then asks the user for it.
4. Add one line to ``_TABLE`` of ``acquisition/recordings/identify.py``, or, in a separate package, an entry point in
   the group ``springmass.formats``.
5. Add one ``Case`` to ``tests/conformance/test_formats.py``.

The logger of this template is invented. Each line is the number of the sample and its height in millimetres::

    Height log, 100 Hz
    0;201.52
    1;201.87
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from acquisition.recordings.tables.dialect import Header, text_format
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.table import Formula

_TITLE = re.compile(r"Height log, (\d*[1-9]\d*) Hz")  # change: a title that only your files have


def header(lines: Sequence[str]) -> Header | None:
    """Read the title."""
    title = _TITLE.fullmatch(lines[0])
    if title is None:
        return None
    return Header(
        why=f'line 1 is the title "{lines[0]}"',
        lines=1,
        delimiter=";",
        headings=[Heading("n", role="ignored"), Heading("height", "mm")],  # change: one for each column
        formula=Formula(start_s=0.0, step_s=1 / float(title[1])),  # change: leave out if a column contains the times
        title=lines[0],
    )


FORMAT = text_format("example", "height log: number;millimetres (a template)", header)
