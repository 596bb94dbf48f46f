"""Read the rows of a table that a user wrote, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acquisition.regular_file import open_regular_text
from pipeline.results.masses import Hooke, hooke
from springmass.errors import ProgramError

LARGEST = 64 << 20  # bytes


def table_lines(path: Path, what: str) -> Iterator[tuple[int, list[str], bool]]:
    """Yield line number, cells and whether numbers may have a decimal comma, for each row of a table of the user."""
    try:
        if path.stat().st_size > LARGEST:
            raise ProgramError(f"{path}: a {what} must be at most {LARGEST >> 20} MB")
        with open_regular_text(path, "utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        raise ProgramError(f"{path}: no {what} can be read ({error.strerror}); check the name") from error
    except UnicodeDecodeError as error:
        raise ProgramError(f"{path}: not in UTF-8; save the sheet as CSV UTF-8") from error
    first = text.partition("\n")[0]
    mark = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark)
    try:
        for cells in reader:
            if cells and not cells[0].lstrip().startswith("#"):
                yield reader.line_num, cells, mark != ","
    except csv.Error as error:
        raise ProgramError(f"{path}, line {reader.line_num}: not a row of a table ({error})") from error


_COLUMN = re.compile(r"(mass|position)[\s_(/\[]*(kg|g|m|cm|mm)[)\]]?", re.IGNORECASE)
_SI = {"kg": 1.0, "g": 1e-3, "m": 1.0, "cm": 1e-2, "mm": 1e-3}


def read_hooke(path: str | os.PathLike[str]) -> Hooke:
    """Return the spring constant of a table with the columns mass_kg and position_m, or mass (g) and position (cm)."""
    table = list(table_lines(Path(path), "table"))
    head = [_COLUMN.fullmatch(cell.strip()) for cell in table[0][1]] if table else []
    columns = {found[1].lower(): (i, _SI[found[2].lower()]) for i, found in enumerate(head) if found}
    if len(columns) < 2:
        raise ProgramError(f"{path}: expected the columns mass_kg and position_m (or mass (g), position (cm))")
    values: dict[str, list[float]] = {"mass": [], "position": []}
    for line, cells, comma in table[1:]:
        if not any(cell.strip() for cell in cells):
            continue
        for name, (column, factor) in columns.items():
            text = cells[column].strip() if column < len(cells) else ""
            try:
                values[name].append(float(text.replace(",", ".") if comma else text) * factor)
            except ValueError:
                raise ProgramError(f"{path}, line {line}: {name} must be a number, got {text!r}") from None
    mass, position = (np.array(values[name]) for name in ("mass", "position"))
    if not (np.isfinite(mass).all() and np.isfinite(position).all()):
        raise ProgramError(f"{path}: masses and positions must be finite; correct the table")
    return hooke(mass, position)
