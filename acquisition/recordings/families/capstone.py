"""PASCO Capstone: columns under headings like ``"Position (m) Run #1"``, semicolons with decimal commas, or commas.

What is easy to get wrong:

- Runs are side by side and end at different rows; derived columns (velocity, acceleration) are empty at the edges.
- The decimal mark may differ between cells: ``-8,90E-4`` next to ``0.12``. Small numbers have an exponent.
- The column of times may be missing; then the user must give the rate.
- SPARKvue writes ``Time (s) Run 5``, and columns with dates as text.
- Localised exports translate time and run, or have headings without any unit
  (``time;position;velocity;acceleration``).
"""

from __future__ import annotations

import re

from acquisition.recordings.tables.contents import Heading, is_time, name_and_unit, split_heading
from acquisition.recordings.tables.sheet import headed_format

__all__ = ["FORMAT"]

_OF_RUN = re.compile(r"(?P<quantity>.*\S)\s+(?P<run>\S+ #\s?\d+|Run \d+)")
_QUANTITIES = frozenset(
    (
        *("position", "velocity", "acceleration"),
        *("posizione", "velocità", "velocita", "accelerazione"),
        *("ort", "weg", "geschwindigkeit", "beschleunigung"),
        *("vitesse", "accélération"),
        *("posición", "velocidad", "aceleración"),
        *("位置", "速度", "加速度"),
    )
)


def _headings(line: str) -> tuple[tuple[Heading, ...], str]:
    """Return the headings of a line, none for a line of another family, and their separator."""
    cells, mark = split_heading(line)
    matches = [_OF_RUN.fullmatch(cell) for cell in cells]
    if cells and all(each is not None or not cell for each, cell in zip(matches, cells, strict=True)) and any(matches):
        named = [name_and_unit(each["quantity"]) if each else ("", "") for each in matches]
        runs = [each["run"] if each else "" for each in matches]
        return tuple(Heading(name, unit, run) for (name, unit), run in zip(named, runs, strict=True)), mark
    words = [cell.lower() for cell in cells]
    # A comment mark shows that the line comes from another program.
    if (
        len(cells) > 1
        and words[0][:1] not in "#%"
        and is_time(words[0])
        and all(word in _QUANTITIES for word in words[1:])
    ):
        return tuple(Heading(cell, "") for cell in cells), mark
    return (), mark


def _why(headings: tuple[Heading, ...], mark: str) -> str:
    run = next((each.run for each in headings if each.run), "")
    if run:
        return f'headings in line 1 end in a run, "{run}"'
    return f'line 1 is the headings "{mark.join(each.name for each in headings)}"'


FORMAT = headed_format(
    "capstone", "PASCO Capstone CSV: runs side by side, any decimal mark", _headings, _why, '"Position (m) Run #1"'
)
