"""A course whose results cannot be written: one line and an exit code, and what can be written is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from springmass.batch import reports
from springmass.batch.plan import Job, plan
from springmass.errors import OK, SOME_FAILED, USAGE
from tests.courses import contents, short_course

LIMIT_S = 120.0
RUNS = 5
LIMITED = """
import resource, sys
from springmass.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
sys.exit(main(sys.argv[2:]))
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of recordings."""
    return short_course(tmp_path_factory.mktemp("course") / "runs", RUNS)


@pytest.fixture(scope="module")
def clean(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an undisturbed pass writes."""
    out = tmp_path_factory.mktemp("clean") / "out"
    code, _ = batch(runs, out)
    assert code == OK
    return contents(out)


def batch(runs: Path, out: Path, *, jobs: int = 1, largest: int = -1) -> tuple[int, str]:
    """Run a pass whose files may not grow beyond so many bytes; return the exit code and what stands on stderr."""
    command = [sys.executable, "-c", LIMITED, str(largest), "-q", "batch", str(runs), "-o", str(out)]
    options = ["--jobs", str(jobs), "--reports", "2", "--accuracy", "fast"]
    done = subprocess.run([*command, *options], capture_output=True, text=True, timeout=LIMIT_S)
    return done.returncode, done.stderr


def assert_lines(stderr: str) -> None:
    """Every line is an error of the program and none is part of a traceback."""
    lines = stderr.splitlines()
    assert lines
    assert [line for line in lines if not line.startswith("springmass: ")] == []


@pytest.mark.parametrize("largest", [0, 60, 3000, 10_000, 30_000, 150_000])
def test_a_full_disk_is_one_line_and_the_next_pass_completes_the_course(runs, clean, tmp_path, largest):
    """Wherever the disk fills up, the pass ends with lines and an exit code, and the next pass makes the rest."""
    code, stderr = batch(runs, tmp_path / "out", largest=largest)
    assert code in (USAGE, SOME_FAILED)
    assert_lines(stderr)
    assert batch(runs, tmp_path / "out") == (OK, "")
    assert contents(tmp_path / "out") == clean


@pytest.mark.parametrize(
    ("place", "kind", "expected"),
    [
        ("parts", "file", USAGE),
        ("parts/lock", "folder", USAGE),
        ("parts/course.json", "folder", USAGE),
        ("results.csv", "folder", USAGE),
        ("results.parquet", "folder", USAGE),
        ("index.html", "folder", USAGE),
        ("batch.log", "folder", SOME_FAILED),
        ("reports", "file", SOME_FAILED),
    ],
)
def test_a_place_that_cannot_be_written_is_named(runs, tmp_path, place, kind, expected):
    """A file where a folder must stand, or a folder in place of a file: a line names it, by one process or by two."""
    obstacle = tmp_path / "out" / place
    obstacle.parent.mkdir(parents=True)
    obstacle.mkdir() if kind == "folder" else obstacle.write_bytes(b"")
    for jobs in (1, 2):
        code, stderr = batch(runs, tmp_path / "out", jobs=jobs)
        assert code == expected
        assert_lines(stderr)
        assert str(obstacle) in stderr or place == "results.parquet"
    if expected == SOME_FAILED:  # the tables and the page do not need it
        assert len((tmp_path / "out" / "results.csv").read_text().splitlines()) == RUNS + 1
        assert (tmp_path / "out" / "index.html").is_file()


def test_a_report_that_cannot_be_written_costs_that_report(runs, clean, tmp_path):
    """The other report, the tables and the page are written; the next pass writes what is missing."""
    first, second = sorted(name.split("/")[1] for name in clean if name.endswith("report.html"))
    obstacle = tmp_path / "out" / "reports" / first
    obstacle.parent.mkdir(parents=True)
    obstacle.write_bytes(b"")
    code, stderr = batch(runs, tmp_path / "out", jobs=2)
    assert code == SOME_FAILED
    assert_lines(stderr)
    assert stderr.count("\n") == 1
    assert first in stderr
    assert (tmp_path / "out" / "reports" / second / "report.html").is_file()
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert first not in page
    assert second in page
    obstacle.unlink()
    assert batch(runs, tmp_path / "out", jobs=2) == (OK, "")
    assert contents(tmp_path / "out") == clean


def dies_at_run001(tasks: Sequence[tuple[str, Job, Path]]) -> list[str]:
    """Stand for the writing of reports, in a process that is killed at one of them."""
    for run, _, folder in tasks:
        if run == "run001":
            os.kill(os.getpid(), signal.SIGKILL)
        folder.mkdir(parents=True, exist_ok=True)
    return [""] * len(tasks)


def test_a_report_that_kills_its_worker_costs_that_report(runs, tmp_path, monkeypatch):
    """The reports of the other runs are written."""
    monkeypatch.setattr(reports, "_attempts", dies_at_run001)
    jobs = plan([str(runs)]).jobs
    chosen = [(Path(job.path).stem, job) for job in jobs]
    failed = reports.write_reports(tmp_path, chosen, 2)
    assert list(failed) == ["run001.results"]
    made = {path.name for path in (tmp_path / "reports").iterdir()}
    assert made == {f"run{i:03d}.results" for i in range(RUNS)} - {"run001.results"}
