"""The benchmark of many inputs runs with timing off and gives what it should."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

MANY = Path(__file__).with_name("many.py")


@pytest.mark.trials
def test_many_runs_share_a_table_and_get_reports_on_request(tmp_path):
    """Three short records: one table, three reports."""
    spec = importlib.util.spec_from_file_location("many", MANY)
    many = importlib.util.module_from_spec(spec)
    sys.modules["many"] = many  # where a dataclass looks for its module
    spec.loader.exec_module(many)
    files = many.recordings(tmp_path, runs=3, seconds=12)
    taken = many.analysed(files, tmp_path / "out", "--report")
    assert taken.wall_s > 0
    assert taken.table.count("period  ") == 1
    assert [len(line.split()) for line in taken.table.splitlines() if line.startswith("frequency")] == [8]
    assert all((tmp_path / "out" / f"run{i:02d}.results" / "report.html").is_file() for i in range(3))
