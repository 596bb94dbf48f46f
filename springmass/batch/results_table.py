"""Write the table of a course as CSV and, if pyarrow is installed, as Parquet."""

from __future__ import annotations

import contextlib
import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from acquisition.errors import visible
from springmass.batch.rows import NUMBERS, WHOLE, columns_of
from springmass.batch.store import CSV, PARQUET, Store
from storage.atomic import writing

__all__ = ["text_of", "write_tables"]

GROUP = 1000  # rows per Parquet row group, which are held in memory together
_WHOLE, _NUMBERS = frozenset(WHOLE), frozenset(NUMBERS)
_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠", "\t")


def write_tables(store: Store, rows: Iterable[Mapping[str, Any]], tags: Sequence[str]) -> None:
    """Write the table as CSV in UTF-8 and, if pyarrow is installed, as Parquet; equal rows give equal bytes.

    In the CSV, numbers keep all their digits, and unknown values are empty.

    Raises
    ------
    storage.errors.WriteFailed
        If a table cannot be written; its earlier version is then kept.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        pa = pq = None
        store.keep_edited(PARQUET)
        with writing(store.folder / PARQUET):
            (store.folder / PARQUET).unlink(missing_ok=True)  # the file of an earlier pass would state outdated numbers
    columns = columns_of(tags)
    with writing(store.folder / CSV), contextlib.ExitStack() as stack:
        temporary = stack.enter_context(store.output(CSV))
        text = csv.writer(stack.enter_context(temporary.open("w", encoding="utf-8", newline="")), lineterminator="\n")
        text.writerow(columns)
        table = None
        if pq is not None:
            file = stack.enter_context(stack.enter_context(store.output(PARQUET)).open("wb"))
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
    # A spreadsheet would evaluate text that begins like a formula.
    return f"'{shown}" if shown.startswith(_FORMULA) else shown


def _type(name: str, pa: Any) -> Any:
    return pa.float64() if name in _NUMBERS else pa.int64() if name in _WHOLE else pa.string()


def text_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    """Return some columns of rows as CSV text."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(map(_cell, columns))
    writer.writerows([_cell(row[name]) for name in columns] for row in rows)
    return out.getvalue()
