"""Read tables that a user wrote, separated by commas, semicolons or tabs: their rows, and a static measurement."""

import csv
import io
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.recordings.tables.headings import is_uncertainty
from acquisition.regular_file import open_regular_text
from pipeline.several.masses import Hooke, hooke
from springmass.errors import ProgramError

LARGEST_TABLE_BYTES = 64 << 20  # bytes


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table: where it stands, its number, and its cells that are not empty by column."""

    where: str
    line: int
    cells: Mapping[str, str]
    decimal_comma: bool

    def plain(self, column: str) -> str:
        """Return the text of a number, with a decimal point; empty without one."""
        text = self.cells.get(column, "")
        return text.replace(",", ".") if self.decimal_comma else text

    def number(self, column: str) -> float:
        """Return a finite number."""
        try:
            value = float(self.plain(column))
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            got = repr(self.cells.get(column, ""))
            raise ProgramError(f"{self.where}: {column} must be a finite number, got {got}", "correct the table")
        return value


def read_rows(path: str | os.PathLike[str], what: str) -> tuple[list[str], list[Row]]:
    """Return the columns and the rows of a table; numbers may have a decimal comma unless commas separate the cells."""
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_TABLE_BYTES:
            raise ProgramError(f"{path}: a {what} must be at most {LARGEST_TABLE_BYTES >> 20} MB")
        with open_regular_text(path, "utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        raise ProgramError(f"{path}: no {what} can be read ({error.strerror})", "check the name") from error
    except UnicodeDecodeError as error:
        raise ProgramError(f"{path}: not in UTF-8", "save the sheet as CSV UTF-8") from error
    first = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
    mark = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark)
    names: list[str] = []
    rows = []
    try:
        for every in reader:
            where, cells = f"{path}, line {reader.line_num}", [cell.strip() for cell in every]
            while cells and not cells[-1]:
                cells.pop()
            if not cells or cells[0].startswith("#"):
                continue
            if not names:
                names = [cell.lower() for cell in cells]
            elif len(cells) > len(names):
                wrong = f"{where}: expected {len(names)} columns, got {len(cells)}"
                raise ProgramError(wrong, "put quotes around a text with a separator")
            else:
                filled = {name: cell for name, cell in zip(names, cells, strict=False) if cell}
                rows.append(Row(where, reader.line_num, filled, mark != ","))
    except csv.Error as error:
        raise ProgramError(f"{path}, line {reader.line_num}: not a row of a table ({error})") from error
    return names, rows


_COLUMN = re.compile(r"(?P<name>.*?[^\W_])[\s_(/\[]+(?P<unit>kg|g|mn|n|m|cm|mm)[)\]]?")
_SI = {"kg": ("kg", 1.0), "g": ("kg", 1e-3), "n": ("N", 1.0), "mn": ("N", 1e-3)}  # names of columns are in lower case
_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


def read_hooke(path: str | os.PathLike[str]) -> Hooke:
    """Return the spring constant of a table of masses or forces with positions or extensions, each with its unit."""
    names, rows = read_rows(path, "table")
    matches = [(name, match) for name in names if (match := _COLUMN.fullmatch(name))]
    found = [(name, match["unit"]) for name, match in matches if not is_uncertainty(match["name"])]
    loads = [(name, *_SI[unit]) for name, unit in found if unit in _SI]
    positions = [(name, _METRES[unit]) for name, unit in found if unit in _METRES]
    if len(loads) != 1 or len(positions) != 1:
        wanted = f"{path}: expected one column of loads and one of positions, got {', '.join(names)}"
        raise ProgramError(wanted, "name them mass (g) or force (N), and position (cm) or extension (m)")
    (load, unit, to_load), (position, to_m) = loads[0], positions[0]
    loaded = np.array([row.number(load) * to_load for row in rows])
    return hooke(loaded, np.array([row.number(position) * to_m for row in rows]), unit)
