"""A defect is one line with exit code 70, and what the system or the user does wrong is never called one."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from springmass.errors import INTERNAL, OK, USAGE

Cli = Callable[..., Any]
REPO_ROOT = Path(__file__).resolve().parents[2]


def defect(*_: object, **__: object) -> object:
    """Fail as no code foresees."""
    raise KeyError("a name that nobody\nthought of")


def test_a_defect_is_one_line_and_a_file(
    cli: Cli, recording: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The line says what to do and names the file with the traceback."""
    monkeypatch.setattr("springmass.commands.analyse.load", defect)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    done = cli("analyse", recording, "--no-report")
    assert done.code == INTERNAL
    assert done.complaint.startswith("springmass: internal error: KeyError")
    (details,) = tmp_path.glob("springmass-error-*.txt")
    assert str(details) in done.complaint
    assert "Traceback" in details.read_text(encoding="utf-8")


def test_a_defect_met_on_one_of_several_inputs_leaves_the_others(
    cli: Cli, recording: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The other input has its column of Table 1."""
    other = tmp_path / "other.txt"
    other.write_bytes(recording.read_bytes())
    from springmass.commands import analyse

    sound = analyse.load

    def sometimes(*args: Any, **how: Any) -> Any:
        return defect() if any(str(each).endswith("other.txt") for each in args) else sound(*args, **how)

    monkeypatch.setattr(analyse, "load", sometimes)
    done = cli("analyse", recording, other, "--no-report")
    assert done.code == 1
    assert "internal error" in done.complaint
    assert "period" in done.out


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["analyse", "--no-report"], ["formats"], ["analyse", "--json"]])
def test_a_full_output_is_one_line(recording: Path, arguments: list[str]) -> None:
    """What cannot be written to is named, without a traceback, not even when Python ends."""
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "springmass", *arguments, str(recording)],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=REPO_ROOT,
        )
    assert done.returncode == USAGE
    (line,) = done.stderr.splitlines()
    assert line.startswith("springmass: standard output cannot be written")


def test_quiet_holds_for_one_command_alone(cli: Cli, recording: Path) -> None:
    """The next command in the same process says again where its report is."""
    assert "report:" not in cli("-q", "analyse", recording).err
    done = cli("analyse", recording)
    assert done.code == OK
    assert "report:" in done.err
