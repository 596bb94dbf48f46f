"""The child process that reads a workbook with calamine: bytes on standard input, JSON in UTF-8 on standard output.

This file is run as a script, by its path. It imports neither numpy nor the package around it, whose name differs
between a checkout and a wheel, so that it starts in a few hundredths of a second. Its arguments are the memory limit,
in bytes, and the maximum number of characters to write.

The JSON is ``{"sheets": [[name, text], ...]}``, each text with one line per row and one tab between cells, or
``{"refused": reason}``.
"""

from __future__ import annotations

import datetime
import io
import json
import sys
from collections.abc import Sequence
from typing import Any

__all__ = ["read_sheets"]

_DIGITS = 15  # the significant digits that spreadsheet programs show and compute with
_MOST_DECIMALS = 12
_BLANK = str.maketrans("\t\r\n", "   ")


def read_sheets(data: bytes, most_letters: int) -> list[tuple[str, str]]:
    """Return the name and the text of every sheet.

    Parameters
    ----------
    data : bytes
        An xlsx or xls.
    most_letters : int
        Maximum number of characters in all texts together.

    Raises
    ------
    ValueError
        If the texts have more characters.
    python_calamine.CalamineError
        If calamine cannot read the workbook.
    """
    from python_calamine import CalamineWorkbook

    book = CalamineWorkbook.from_object(io.BytesIO(data))
    sheets = []
    letters = 0
    for name in book.sheet_names:
        text = _text(book.get_sheet_by_name(name).to_python(skip_empty_area=False), most_letters - letters)
        letters += len(text)
        sheets.append((name, text))
    return sheets


def _text(rows: Sequence[Sequence[Any]], most_letters: int) -> str:
    """Return a sheet's cells as text."""
    columns = []
    letters = 0
    for column in zip(*rows, strict=True):
        columns.append(_printed(column))
        letters += sum(map(len, columns[-1])) + len(columns[-1])
        if letters > most_letters:
            raise ValueError("the text of its cells is too long")
    return "\n".join("\t".join(row) for row in zip(*columns, strict=True)) + "\n"


def _printed(column: Sequence[Any]) -> list[str]:
    """Return the cells of a column as text; all numbers have as many decimals as the longest of them needs.

    The reader of text treats a number with fewer decimals than its column as incomplete.
    """
    numbers = [f"{cell:.{_DIGITS}g}" for cell in column if _is_number(cell)]
    decimals = max((len(each.partition(".")[2]) for each in numbers if "e" not in each), default=0)
    fixed = decimals <= _MOST_DECIMALS and not any("e" in each for each in numbers)
    form = f".{decimals}f" if fixed else f".{_DIGITS - 1}e"
    return [format(cell, form) if _is_number(cell) else _word(cell) for cell in column]


def _is_number(cell: object) -> bool:
    """Return whether a cell is a number; an xls has two types of numbers."""
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def _word(cell: object) -> str:
    """Return a cell that is not a number as text; a duration is given in seconds."""
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
