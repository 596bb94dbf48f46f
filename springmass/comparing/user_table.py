"""Read tables that a user wrote, separated by commas, semicolons or tabs: their rows, and a static measurement."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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


_COLUMN = re.compile(r"(mass|position)[\s_(/\[]*(kg|g|m|cm|mm)[)\]]?")
_SI = {"kg": 1.0, "g": 1e-3, "m": 1.0, "cm": 1e-2, "mm": 1e-3}


def read_hooke(path: str | os.PathLike[str]) -> Hooke:
    """Return the spring constant of a table with the columns mass_kg and position_m, or mass (g) and position (cm)."""
    names, rows = read_rows(path, "table")
    columns = {match[1]: (name, _SI[match[2]]) for name in names if (match := _COLUMN.fullmatch(name))}
    if len(columns) < 2:
        raise ProgramError(f"{path}: expected the columns mass_kg and position_m (or mass (g), position (cm))")
    (mass, to_kg), (position, to_m) = columns["mass"], columns["position"]
    masses = np.array([row.number(mass) * to_kg for row in rows])
    return hooke(masses, np.array([row.number(position) * to_m for row in rows]))
