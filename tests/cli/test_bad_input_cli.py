"""Bad input: one line that names the file and what to do; never a wrong number."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Cli

Write = Callable[..., Path]

COMMANDS = ("analyse", "formats", "convert", "replay")


def run(cli: Cli, command: str, path: Path, out: Path) -> Any:
    """Run a command on an input, as little else asked of it as it allows."""
    options = {"analyse": ["--json"], "formats": [], "convert": [out], "replay": ["--speed", "max"]}
    return cli(command, path, *options[command])


def refused(done: Any, path: Path, *words: str) -> None:
    """Demand exit code 3, nothing on stdout, and one line that names the file, what is wrong and what to do."""
    assert (done.code, done.out) == (3, "")
    assert done.complaint.startswith(f"springmass: {path}")
    assert "; " in done.complaint or "? springmass " in done.complaint  # what to do stands behind it
    assert all(word in done.complaint for word in words)


@pytest.mark.parametrize("command", COMMANDS)
def test_what_cannot_be_opened_is_refused(
    cli: Cli, recording: Path, tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder, a name that is not there and a file without read permission: the system's reason in one line."""
    out = tmp_path / "out.h5"
    if command not in ("analyse", "formats"):  # to these a folder is all the recordings in it
        refused(run(cli, command, tmp_path, out), tmp_path)
    absent = tmp_path / "absent.txt"
    refused(run(cli, command, absent, out), absent, "No such file")

    def forbid(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("builtins.open", forbid)
    refused(run(cli, command, recording, out), recording, "Permission denied")


def analysed(cli: Cli, path: Path) -> Any:
    """Demand that a file is analysed without complaint; return the result."""
    done = cli("analyse", "--json", path)
    assert (done.code, done.err) == (0, "")
    return done.results[0]


@pytest.mark.parametrize("start", ["nothing", "header"])
def test_a_hundred_megabytes_of_one_line_are_refused_at_once(cli: Cli, write: Write, start: str) -> None:
    """The first MiB without a line end is enough."""
    path = write([b"0.000\t2"])
    if start == "nothing":
        path.write_bytes(b"0.000\t2")
    os.truncate(path, 1 << 27)
    done = run(cli, "analyse", path, path)
    refused(done, path)
    assert ("line 3" in done.complaint) == (start == "header")


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda data: data.replace(b".", b","), id="decimal commas"),
        pytest.param(lambda data: data.decode().encode("utf-16"), id="UTF-16"),
        pytest.param(lambda data: data.replace(b"\r\n", b"\r"), id="CR"),
        pytest.param(lambda data: data.replace(b"\r\n", b"\r\n\r\n"), id="blank lines"),
    ],
)
def test_other_ways_to_write_the_same_numbers_are_read(
    cli: Cli, recording: Path, tmp_path: Path, change: Callable[[bytes], bytes]
) -> None:
    """Decimal commas, byte order marks, UTF-16 and other line ends give the very same estimates."""
    other = tmp_path / "other.txt"
    other.write_bytes(change(recording.read_bytes()))
    sound, result = analysed(cli, recording), analysed(cli, other)
    assert (result["quality"], result["estimates"]) == (sound["quality"], sound["estimates"])
