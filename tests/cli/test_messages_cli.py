"""Messages on stderr: problems always, what was done unless ``-q``, details with ``-v``, hints on a terminal alone.

A defect is one line with exit code 70; what the system or the user does wrong is never called one.
"""

import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from springmass.cli import main
from springmass.errors import INTERNAL, USAGE
from tests.cli.conftest import Cli


@pytest.mark.parametrize(("options", "lines"), [((), 1), (("-q",), 0), (("-v",), 2)])
def test_quiet_and_verbose_choose_what_is_printed(
    cli: Cli, recording: Path, tmp_path: Path, options: tuple[str, ...], lines: int
) -> None:
    """The file that was written; before it, with ``-v``, the file that was read."""
    done = cli("convert", recording, tmp_path / "copy.h5", *options)
    assert len(done.err.splitlines()) == lines
    assert ("copy.h5" in done.err) == (lines > 0)


@pytest.mark.parametrize("options", [(), ("-q",)])
def test_only_a_terminal_shows_the_next_command(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...]
) -> None:
    """Not a pipe, whose lines another program reads; and not if only problems are wanted."""
    shown = []
    for is_terminal in (False, True):
        stream = io.StringIO()
        monkeypatch.setattr(stream, "isatty", lambda answer=is_terminal: answer)
        monkeypatch.setattr(sys, "stderr", stream)
        assert main(["convert", str(recording), str(tmp_path / f"{is_terminal}.h5"), *options]) == 0
        shown.append("springmass analyse" in stream.getvalue())
    assert shown == [False, not options]


@pytest.fixture
def defective(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Return a recording on which the program fails as no code foresees."""
    path = tmp_path / "other.txt"
    path.write_bytes(b"")
    sound = open

    def fails(file: Any, *args: Any, **how: Any) -> Any:
        if str(file) == str(path):
            raise KeyError("a name that nobody\nthought of")
        return sound(file, *args, **how)

    monkeypatch.setattr("builtins.open", fails)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return path


def test_a_defect_is_one_line_and_a_file(cli: Cli, defective: Path, tmp_path: Path) -> None:
    """The line says what to do and names the file with the traceback."""
    done = cli("analyse", defective, "--no-report")
    assert done.code == INTERNAL
    assert "internal error: KeyError" in done.complaint
    (details,) = tmp_path.glob("springmass-error-*.txt")
    assert str(details) in done.complaint
    assert "Traceback" in details.read_text(encoding="utf-8")


def test_a_defect_met_on_one_of_several_inputs_leaves_the_others(cli: Cli, recording: Path, defective: Path) -> None:
    """The other input has its column of Table 1."""
    done = cli("analyse", recording, defective, "--no-report")
    assert done.code == 1
    assert "internal error" in done.complaint
    assert "period" in done.out


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_output_is_one_line() -> None:
    """What cannot be written to is named, without a traceback, not even when Python ends."""
    with open("/dev/full", "wb") as full:
        command = [sys.executable, "-m", "springmass", "explain", "clipped"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == USAGE
    (line,) = done.stderr.splitlines()
    assert line.startswith("springmass: standard output")


@pytest.mark.skipif(sys.platform == "win32", reason="pipes end otherwise there")
def test_a_reader_that_goes_away_ends_it_quietly(recording: Path) -> None:
    """``springmass replay ... | head`` is no failure."""
    command = [sys.executable, "-m", "springmass", "replay", str(recording), "--loop", "--speed", "max"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(timeout=120) == 0


def test_quiet_holds_for_one_command_alone(cli: Cli, recording: Path) -> None:
    """The next command in the same process says again what it does."""
    recording.with_name("run.about.toml").write_text('notes = ["by hand"]\n', encoding="utf-8")
    for line in (("-q", "analyse", recording, "--no-report"), ("analyse", recording, "--no-report", "--quiet")):
        assert cli(*line).err == ""
    assert "run.about.toml" in cli("analyse", recording, "--no-report").complaint
