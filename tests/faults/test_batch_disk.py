"""A course whose results cannot be written: one line and an exit code, and what can be written is."""

import errno
import fcntl
from pathlib import Path

import pytest

from springmass.cli import main
from springmass.errors import OK, SOME_FAILED, UNREADABLE, USAGE
from tests.courses import contents, short_course
from tests.faults.conftest import files_up_to
from tests.sampling import sampled

RUNS = 3


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of recordings."""
    return short_course(tmp_path_factory.mktemp("course") / "runs", RUNS)


def passed(runs: Path, out: Path, *options: str) -> int:
    """Return the exit code of a pass."""
    return main(["-q", "batch", str(runs), "-o", str(out), "--accuracy", "fast", *options])


@pytest.fixture(scope="module")
def clean(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an undisturbed pass writes."""
    out = tmp_path_factory.mktemp("clean") / "out"
    assert passed(runs, out, "--jobs", "1", "--reports", "1") == OK
    return contents(out)


def errors_of(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the lines on stderr: errors of the program, and no part of a traceback."""
    lines = capsys.readouterr().err.splitlines()
    assert lines
    assert [line for line in lines if not line.startswith("springmass: ")] == []
    return lines


@pytest.mark.parametrize("largest", sampled([3000, 70_000, 0, 60, 10_000, 30_000]))
def test_a_full_disk_is_one_line_and_the_next_pass_completes_the_course(
    runs: Path, clean: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str], largest: int
) -> None:
    """Wherever the disk fills up, the pass ends with lines and an exit code, and the next pass makes the rest."""
    options = ("--jobs", "1", "--reports", "1")
    with files_up_to(largest):
        code = passed(runs, tmp_path / "out", *options)
    assert code in (USAGE, SOME_FAILED)
    errors_of(capsys)
    assert passed(runs, tmp_path / "out", *options) == OK
    assert contents(tmp_path / "out") == clean


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.trials)])
@pytest.mark.parametrize("place", ["course.db", "course.lock", "results.csv", "index.html"])
def test_a_place_that_cannot_be_written_is_named(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str, jobs: str
) -> None:
    """A folder in place of a file: a line names it, by one process or by two."""
    obstacle = tmp_path / "out" / place
    obstacle.mkdir(parents=True)
    assert passed(runs, tmp_path / "out", "--jobs", jobs, "--reports", "0") == USAGE
    assert any(str(obstacle) in line for line in errors_of(capsys))


def test_a_report_that_cannot_be_written_costs_that_report(
    runs: Path, clean: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The tables and the page are written without it, one line names it, and the next pass makes it."""
    (name,) = [name.split("/")[1] for name in clean if name.endswith("report.html")]
    obstacle = tmp_path / "out" / "reports" / name
    obstacle.parent.mkdir(parents=True)
    obstacle.write_bytes(b"")
    options = ("--jobs", "1", "--reports", "1")
    assert passed(runs, tmp_path / "out", *options) == SOME_FAILED
    (line,) = errors_of(capsys)
    assert name in line
    assert name not in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    obstacle.unlink()
    assert passed(runs, tmp_path / "out", *options) == OK
    assert contents(tmp_path / "out") == clean


def test_damaged_data_are_named_with_what_to_do(
    runs: Path, clean: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line names the file; without it the next pass makes everything anew."""
    options = ("--jobs", "1", "--reports", "1")
    assert passed(runs, tmp_path / "out", *options) == OK
    data = tmp_path / "out" / "course.db"
    data.write_bytes(b"no database" * 1000)
    assert passed(runs, tmp_path / "out", *options) == UNREADABLE
    (line,) = errors_of(capsys)
    assert str(data) in line
    data.unlink()
    assert passed(runs, tmp_path / "out", *options) == OK
    assert contents(tmp_path / "out") == clean


def test_a_disk_without_locks_costs_one_line(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The course is analysed, and a line says that nothing keeps a second pass out."""

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert main(["batch", str(runs), "-o", str(tmp_path / "out"), "--accuracy", "fast", "--jobs", "1"]) == OK
    assert [line for line in capsys.readouterr().err.splitlines() if "no locks" in line]
