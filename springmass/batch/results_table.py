"""The table of a course: CSV for everybody, Parquet where pyarrow is installed; written whole, read back."""

from __future__ import annotations

import contextlib
import csv
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from acquisition.errors import visible
from acquisition.regular_file import open_regular_text
from springmass.batch.rows import COLUMNS, NUMBERS, WHOLE, columns_of
from springmass.errors import USAGE, ProgramError
from storage.atomic import whole_file, writing

__all__ = ["CSV", "PARQUET", "is_course", "read_rows", "table_of", "tags_in", "text_of", "write_tables"]

CSV, PARQUET = "results.csv", "results.parquet"
GROUP = 1000  # rows of a row group: what is held at once
_WHOLE, _NUMBERS = frozenset(WHOLE), frozenset(NUMBERS)
_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠", "\t")


def write_tables(folder: Path, rows: Iterable[Mapping[str, Any]], tags: Sequence[str]) -> None:
    """Write the table as CSV in UTF-8 and, where pyarrow is installed, as Parquet: the same bytes for the same rows.

    In the CSV numbers keep all their digits, and what is not known is empty.

    Raises
    ------
    storage.errors.WriteFailed
        If one of them cannot be written; the earlier one stands then.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        pa = pq = None
        with writing(folder / PARQUET):
            (folder / PARQUET).unlink(missing_ok=True)  # one of an earlier pass would state other numbers
    columns = columns_of(tags)
    with writing(folder / CSV), contextlib.ExitStack() as stack:
        temporary = stack.enter_context(whole_file(folder / CSV))
        text = csv.writer(stack.enter_context(temporary.open("w", encoding="utf-8", newline="")), lineterminator="\n")
        text.writerow(columns)
        table = None
        if pq is not None:
            file = stack.enter_context(stack.enter_context(whole_file(folder / PARQUET)).open("wb"))
            schema = pa.schema([(name, _type(name, pa)) for name in columns])
            table = stack.enter_context(pq.ParquetWriter(file, schema, compression="zstd"))
        each = iter(rows)
        while group := list(islice(each, GROUP)):
            text.writerows([_cell(row[name]) for name in columns] for row in group)
            if table is not None:
                table.write_table(pa.Table.from_pylist(group, schema=schema))


def _cell(value: Any) -> Any:
    if not isinstance(value, str):
        return "" if value is None else value
    shown = visible(value)
    # A name that begins as a formula does would be one in a spreadsheet.
    return f"'{shown}" if shown.startswith(_FORMULA) else shown


def _type(name: str, pa: Any) -> Any:
    return pa.float64() if name in _NUMBERS else pa.int64() if name in _WHOLE else pa.string()


def is_course(folder: str | os.PathLike[str]) -> bool:
    """Tell a folder with the table of a course."""
    return table_of(folder) is not None


def table_of(folder: str | os.PathLike[str]) -> Path | None:
    """Return the table of a course, the Parquet where it is there; None of any other folder."""
    tables = (Path(folder) / name for name in (PARQUET, CSV))
    return next((path for path in tables if os.path.isfile(path)), None)


def read_rows(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of a course's table: of the Parquet where it can be read, else of the CSV.

    Raises
    ------
    ProgramError
        With exit code 2 if there is no table.
    """
    if (folder / PARQUET).is_file():
        try:
            import pyarrow.parquet as pq
        except ImportError:
            pass
        else:
            with pq.ParquetFile(folder / PARQUET) as file:
                for batch in file.iter_batches(GROUP):
                    yield from batch.to_pylist()
            return
    yield from _read_csv(folder / CSV)


def _read_csv(path: Path) -> Iterator[dict[str, Any]]:
    try:
        text = open_regular_text(path, "utf-8", newline="")
    except OSError as error:
        demand = "a folder with results.csv was demanded, as springmass batch makes one"
        raise ProgramError(f"{path.parent}: {demand} ({error.strerror}); name that of its -o", USAGE) from error
    with text as file:
        try:
            table = csv.DictReader(file, strict=True)
            if lacking := [name for name in COLUMNS if name not in (table.fieldnames or ())]:
                raise ValueError(f"it has no column {lacking[0]}")
            for row in table:
                yield {name: _value(name, cell) for name, cell in row.items()}
        except (csv.Error, ValueError, TypeError, AttributeError) as error:
            demand = f"a table as springmass batch writes it was demanded ({error}); run batch again"
            raise ProgramError(f"{path}: {demand}", USAGE) from error


def _value(name: str, cell: str) -> Any:
    if cell == "":
        return None
    if name in _NUMBERS:
        return float(cell)
    if name in _WHOLE:
        return int(cell)
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell


def tags_in(columns: Iterable[str]) -> tuple[str, ...]:
    """Return the columns that are the course's own."""
    usual = frozenset(columns_of(()))
    return tuple(name for name in columns if name not in usual)


def text_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    """Return some columns of rows as CSV text."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(map(_cell, columns))
    writer.writerows([_cell(row[name]) for name in columns] for row in rows)
    return out.getvalue()
