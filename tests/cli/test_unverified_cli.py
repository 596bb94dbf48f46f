"""Run files that are not what was written: refused by name, looked at only when asked, never blessed."""

from pathlib import Path
from typing import Any

import h5py
import pytest

from tests.cli.conftest import Cli

COMMANDS = ("analyse", "convert", "replay", "trade", "simulate", "compare", "formats")


@pytest.fixture
def edited(cli: Cli, recording: Path, tmp_path: Path) -> Path:
    """Return a run file with one distance rewritten, its chunk's checksum right."""
    path = tmp_path / "edited.h5"
    assert cli("convert", recording, path).code == 0
    with h5py.File(path, "r+") as file:
        file["entry/signal/distance"][7] += 0.001
    return path


def arguments(command: str, path: Path, out: Path, data: Path) -> list[Any]:
    """Return a command line that reads the run."""
    scene = data / "undamped.scene.toml"
    return {
        "analyse": ["analyse", "--json", path],
        "convert": ["convert", path, out],
        "replay": ["replay", path, "--speed", "max"],
        "trade": ["trade", path, "--seeds", "1"],
        "simulate": ["simulate", "--scene", scene, "--json", "--against", path],
        "compare": ["compare", path, path, "--scene", scene, "--json"],
        "formats": ["formats", path],
    }[command]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_rewritten_array_is_refused_until_it_is_asked_for(
    cli: Cli, edited: Path, tmp_path: Path, data: Path, command: str
) -> None:
    """Exit code 3, nothing made, and a line that names the column and the way to look; then it works, and says so."""
    out = tmp_path / "out.h5"
    done = cli(*arguments(command, edited, out, data))
    assert (done.code, done.out) == (3, "")
    assert done.complaint.startswith(f"springmass: {edited}: the column 'distance' is damaged")
    assert "--unverified" in done.complaint
    assert not out.exists()
    as_typed = command in ("analyse", "convert", "formats")
    done = cli(
        *arguments(command, edited, out, data), *(["--unverified"] if as_typed else ["--read", "unverified=yes"])
    )
    assert done.code == 0
    assert str(edited) in done.err
    assert "the column 'distance'" in done.err


def test_what_is_made_of_it_is_never_blessed(cli: Cli, edited: Path, tmp_path: Path) -> None:
    """A run file made of it has valid digests and says that it comes from one without, down the generations."""
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    assert cli("convert", edited, first, "--unverified").code == 0
    assert cli("convert", first, second).code == 0
    for path in (first, second):
        done = cli("analyse", "--json", "--strict", path)
        assert done.code == 5
        (finding,) = (f for f in done.results[0]["findings"] if f["code"] == "unverified")
        assert finding["severity"] == "error"
        assert "edited.h5" in finding["message"]
