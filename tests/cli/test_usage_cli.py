"""What every command shares: help, version, and one line for a command line that cannot be."""

import os
import subprocess
import sys

import pytest

import springmass
from springmass.commands import COMMANDS
from tests.cli.conftest import Cli


def test_every_command_explains_itself(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program's help names every command, and each command has its own, on a narrow terminal too."""
    assert cli("--version").out.split() == ["springmass", springmass.__version__]
    whole = cli("--help")
    assert (whole.code, whole.err) == (0, "")
    monkeypatch.setenv("COLUMNS", "20")
    for command in COMMANDS:
        done = cli(command, "--help")
        assert (done.code, done.err, command in whole.out) == (0, "", True), command


def test_the_first_help_is_short_and_quick() -> None:
    """No command is imported for it, and no numpy; it fits a screen with a line for each command of a student."""
    code = "import sys; from springmass.cli import main; main(['--help']); print('numpy' in sys.modules)"
    environment = {**os.environ, "COLUMNS": "80"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    *lines, heavy = done.stdout.splitlines()
    assert heavy == "False"
    first = [line.split()[0] for line in lines[:24] if line[:1] == " " and line.split()]
    assert set(first) >= {"demo", "analyse", "explain", "scene", "compare", "batch", "ports", "record", "page"}


def test_every_finding_is_explained(cli: Cli) -> None:
    """The list names codes that ``explain`` knows, each with a short example; a wrong code gets the right one."""
    (listed,) = cli("explain", "--json").results
    for each in listed:
        assert 0 < len(each["example"]) <= 110
        assert each["advice"] or each["severities"] == ["info"]
        assert cli("explain", each["code"]).out.startswith(each["code"])
    wrong = cli("explain", "clip")
    assert (wrong.code, wrong.out) == (2, "")
    assert "clipped" in wrong.complaint
