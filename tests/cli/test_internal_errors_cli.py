"""A defect is one line with exit code 70, and what the system or the user does wrong is never called one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from springmass.errors import INTERNAL, USAGE
from tests.cli.conftest import Cli

REPO_ROOT = Path(__file__).resolve().parents[2]


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
def test_a_full_output_is_one_line(recording: Path) -> None:
    """What cannot be written to is named, without a traceback, not even when Python ends."""
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "springmass", "analyse", "--json", str(recording)],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=REPO_ROOT,
        )
    assert done.returncode == USAGE
    (line,) = done.stderr.splitlines()
    assert line.startswith("springmass: standard output")


def test_quiet_holds_for_one_command_alone(cli: Cli, recording: Path) -> None:
    """The next command in the same process says again what it does."""
    recording.with_name("run.about.toml").write_text('notes = ["by hand"]\n', encoding="utf-8")
    for line in (("-q", "analyse", recording, "--no-report"), ("analyse", recording, "--no-report", "--quiet")):
        assert cli(*line).err == ""
    assert "run.about.toml" in cli("analyse", recording, "--no-report").complaint
