"""Read the rows of a table that a user wrote, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from acquisition.regular_file import open_regular_text
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
