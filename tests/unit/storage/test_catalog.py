"""The catalog: searches read, are fast to ask, and cannot do anything else."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from storage.catalog import build_catalog, catalog_stamp, count_of_catalog, search_catalog
from storage.errors import QueryRefused, RunDamaged

COLUMNS = ("run", "section", "period_u", "findings")
ROWS = [
    {"run": f"run{i}", "section": "AB"[i % 2], "period_u": i * 1e-5 if i else None, "findings": f'["f{i}"]'}
    for i in range(10)
]


@pytest.fixture
def catalog(tmp_path: Path) -> Path:
    """Ten runs."""
    path = tmp_path / "a b?.sqlite"
    return build_catalog(path, COLUMNS, ROWS, long=("findings",), indexed=("section",), stamp="one")


def test_an_expression_filters_sorts_and_limits(catalog):
    """Rows come in their order or sorted, also by what stands among the long texts."""
    assert search_catalog(catalog, where="section = 'A' and period_u < 5e-5", columns=["run"])[1] == [
        ("run2",),
        ("run4",),
    ]
    assert search_catalog(catalog, columns=["run"], sort="-period_u", limit=2)[1] == [("run9",), ("run8",)]
    assert search_catalog(catalog, where="findings like '%f7%'", columns=["run"])[1] == [("run7",)]
    names, rows = search_catalog(catalog, where="period_u is null -- a remark")
    assert names == ["run", "section", "period_u"]
    assert rows == [("run0", "A", None)]
    assert count_of_catalog(catalog) == 10
    assert catalog_stamp(catalog) == "one"


@pytest.mark.parametrize(
    "where",
    [
        "nonsense = 1", "section =", "1); DROP TABLE runs; --", "1) UNION SELECT text FROM stamp --",
        "(SELECT count(*) FROM sqlite_master) > 0", "load_extension('x')", "section = 'A' and",
    ],
)  # fmt: skip
def test_what_is_no_filter_is_refused(catalog, where):
    """One line, and the catalog stands."""
    before = catalog.read_bytes()
    with pytest.raises(QueryRefused):
        search_catalog(catalog, where=where)
    assert catalog.read_bytes() == before


def test_what_is_no_catalog_is_refused(tmp_path):
    """Another file, an absent one, and a column that is not there."""
    (tmp_path / "text").write_text("no catalog" * 100)
    assert catalog_stamp(tmp_path / "text") is None
    assert catalog_stamp(tmp_path / "absent") is None
    with pytest.raises(RunDamaged):
        search_catalog(tmp_path / "text")


def test_a_column_that_is_not_there_is_named(catalog):
    """Of the list and of the order."""
    with pytest.raises(QueryRefused, match="no 'mass'"):
        search_catalog(catalog, columns=["mass"])
    with pytest.raises(QueryRefused, match="no 'mass'"):
        search_catalog(catalog, sort="mass")


def test_numbers_come_back_bit_for_bit(tmp_path):
    """Also the smallest and those that end in no digit."""
    values = [math.pi, 5e-324, 0.1 + 0.2, -1e300]
    path = build_catalog(tmp_path / "c", ("x",), [{"x": value} for value in values])
    assert [row[0] for row in search_catalog(path)[1]] == values
