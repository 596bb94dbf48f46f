"""Test without timing limits that the benchmark of many inputs runs and gives the expected results."""

from __future__ import annotations

import pytest

from benchmarks import many


@pytest.mark.trials
def test_many_runs_share_a_table_and_a_report(tmp_path):
    """Three short records give one table and one report."""
    files = many.recordings(tmp_path, runs=3, seconds=12)
    taken = many.analysed(files, tmp_path / "out")
    assert taken.wall_s > 0
    assert [taken.table.count(f"run0{k}") for k in range(3)] == [1, 1, 1]
    # Runs that do not fit side by side follow in a further block. A row has name, symbol, value and unit of each run.
    assert sum(len(line.split()) - 2 for line in taken.table.splitlines() if line.startswith("frequency")) == 6
    assert (tmp_path / "out" / "together.results" / "report.html").is_file()
