"""Read a static measurement of a spring: masses that hang on it, and the positions at which they rest."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from pipeline.results.masses import Hooke, hooke
from springmass.errors import ProgramError
from springmass.runs.table_lines import table_lines

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
