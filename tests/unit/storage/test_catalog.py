"""Rows are searched by an expression, which can do nothing but read them."""

from __future__ import annotations

import math

import pytest

from storage.catalog import search_rows
from storage.errors import QueryRefused

COLUMNS = ("run", "section", "period_u", "findings")
ROWS = [
    {"run": f"run{i}", "section": "AB"[i % 2], "period_u": i * 1e-5 if i else None, "findings": f'["f{i}"]'}
    for i in range(10)
]


def runs(**how: object) -> list[str]:
    """Return the names of the runs that a search gives."""
    result, total = search_rows(COLUMNS, ROWS, shown=["run"], **how)  # type: ignore[arg-type]
    assert total == len(ROWS)
    return [row["run"] for row in result]


def test_an_expression_filters_sorts_and_limits():
    """Rows come in their order or sorted by a column, at most as many as were asked for."""
    assert runs(where="section = 'A' and period_u < 5e-5") == ["run2", "run4"]
    assert runs(sort="-period_u", limit=2) == ["run9", "run8"]
    assert runs(where="findings like '%f7%'") == ["run7"]
    assert runs(where="period_u is null -- a remark") == ["run0"]
    assert runs() == [row["run"] for row in ROWS]


def test_all_columns_come_if_none_are_named():
    """A row is a mapping by column; a column that a row lacks is None."""
    result, total = search_rows(("run", "period"), [{"run": "a"}])
    assert result == [{"run": "a", "period": None}]
    assert total == 1
    assert search_rows(("run",), []) == ([], 0)


@pytest.mark.parametrize(
    "where",
    [
        "nonsense = 1",
        "section = 'A' and",
        "1); DROP TABLE runs; --",
        "1) ; ATTACH 'x' AS y; --",
        "load_extension('x')",
        "a\0b",
        "\ud800",
        "(" * 2000 + "1" + ")" * 2000,
    ],
)
def test_what_is_no_filter_is_refused(where):
    """Refuse a name that is no column, another statement, a function that loads code and text that is no SQL."""
    with pytest.raises(QueryRefused):
        runs(where=where)


@pytest.mark.parametrize("how", [{"shown": ["mass"]}, {"sort": "mass"}, {"sort": "-mass"}])
def test_a_column_that_does_not_exist_is_named(how):
    """In the list of columns and in the order."""
    with pytest.raises(QueryRefused, match="'mass'"):
        search_rows(COLUMNS, ROWS, **how)


def test_numbers_come_back_bit_for_bit():
    """Also the smallest number and those without a short decimal form."""
    values = [math.pi, 5e-324, 0.1 + 0.2, -1e300]
    result, _ = search_rows(("x",), [{"x": value} for value in values])
    assert [row["x"] for row in result] == values
