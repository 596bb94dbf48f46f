"""The child process that reads a workbook with calamine: bytes on standard input, JSON in UTF-8 on standard output.

This file is run as a script, by its path. It imports neither numpy nor the package around it, whose name differs
between a checkout and a wheel, so that it starts in a few hundredths of a second. Its arguments are the memory limit,
in bytes, and the maximum number of characters to write.

The JSON is ``{"sheets": [[name, text], ...]}``, each text with a line for each row and tabs between its cells, or
``{"refused": reason}``.
"""

from __future__ import annotations

import datetime
import io
import json
import math
import sys
from typing import Any

_DIGITS = 15
_MOST_DECIMALS = 12  # a column whose numbers need more decimals has exponents
_BLANK = str.maketrans('\t\r\n"', "   '")

Cell = float | str


def read_sheets(data: bytes, most_letters: int) -> list[tuple[str, str]]:
    """Return the name and the text of every sheet; raise an error if all texts together have too many characters."""
    from python_calamine import CalamineWorkbook

    book = CalamineWorkbook.from_object(io.BytesIO(data))
    sheets = []
    letters = 0
    for name in book.sheet_names:
        columns: list[Any] = [*zip(*book.get_sheet_by_name(name).to_python(skip_empty_area=False), strict=True)]
        for at, column in enumerate(columns):  # in place, so that the cells that were printed need no memory
            columns[at] = _printed([_plain(cell) for cell in column])
            letters += sum(map(len, columns[at]))
            if letters > most_letters:
                raise ValueError("its cells are too many or too long")
        sheets.append((name, "".join("\t".join(row) + "\n" for row in zip(*columns, strict=True))))
    return sheets


def _printed(column: list[Cell]) -> list[str]:
    """Return the cells of a column as text, its numbers with the same number of decimals."""
    numbers = [f"{cell:.{_DIGITS}g}" for cell in column if not isinstance(cell, str)]
    most = max((_DIGITS if "e" in each else len(each.partition(".")[2]) for each in numbers), default=0)
    form = f".{most}f" if most <= _MOST_DECIMALS else f".{_DIGITS - 1}e"
    return [cell if isinstance(cell, str) else format(cell, form) for cell in column]


def _plain(cell: object) -> Cell:
    """Return a number with the digits that spreadsheet programs show and compute with; text for any other cell."""
    if isinstance(cell, (int, float)) and not isinstance(cell, bool):
        return float(f"{cell:.{_DIGITS}g}") if math.isfinite(cell) else str(cell)
    if isinstance(cell, datetime.timedelta):
        return f"{cell.total_seconds():g}"
    if isinstance(cell, datetime.datetime):
        return cell.isoformat(" ")
    if isinstance(cell, datetime.time):
        return cell.isoformat()
    return "" if cell is None else str(cell).translate(_BLANK).strip()


def _limit_memory(most_bytes: int) -> None:
    """Limit the memory of this process, if the system can, and prevent core files."""
    if sys.platform in ("win32", "darwin"):  # Windows has no such limit, and macOS does not enforce it
        return
    import resource

    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most_bytes if hard < 0 else min(most_bytes, hard), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def main() -> None:
    """Read a workbook from standard input and write JSON to standard output."""
    most_bytes, most_letters = map(int, sys.argv[1:])
    _limit_memory(most_bytes)
    answer: dict[str, Any]
    try:
        answer = {"sheets": read_sheets(sys.stdin.buffer.read(), most_letters)}
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        # calamine raises an error for most damage. For the rest Rust panics, and that error is not an ``Exception``.
        answer = {"refused": " ".join(str(error).split()) or type(error).__name__}
    sys.stdout.buffer.write(json.dumps(answer, ensure_ascii=False).encode())


if __name__ == "__main__":
    main()
