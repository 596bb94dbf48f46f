"""Run files that are not what was written: refused by name, looked at only when asked, never blessed."""

from pathlib import Path

import h5py
import pytest

from tests.cli.conftest import Cli

CALLS = (
    "analyse RUN --json --unverified",
    "convert RUN OUT --unverified",
    "formats RUN --unverified",
    "replay RUN --speed max --read unverified=yes",
    "trade RUN --seeds 1 --read unverified=yes",
    "simulate --scene SCENE --json --against RUN --read unverified=yes",
    "compare RUN RUN --scene SCENE --json --read unverified=yes",
)
"""Command lines that read a run, each with the words at its end that ask for it."""


@pytest.fixture
def edited(cli: Cli, recording: Path, tmp_path: Path) -> Path:
    """Return a run file with one distance rewritten, its chunk's checksum right."""
    path = tmp_path / "edited.h5"
    assert cli("convert", recording, path).code == 0
    with h5py.File(path, "r+") as file:
        file["entry/signal/distance"][7] += 0.001
    return path


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.split()[0])
def test_a_rewritten_array_is_refused_until_it_is_asked_for(
    cli: Cli, edited: Path, tmp_path: Path, data: Path, call: str
) -> None:
    """Exit code 3, nothing made, and a line that names the column and the way to look; then it works, and says so."""
    places = {"RUN": edited, "OUT": tmp_path / "out.h5", "SCENE": data / "undamped.scene.toml"}
    words = [places.get(word, word) for word in call.split()]
    done = cli(*(word for word in words if word not in ("--unverified", "--read", "unverified=yes")))
    assert (done.code, done.out) == (3, "")
    assert done.complaint.startswith(f"springmass: {edited}: the column 'distance' is damaged")
    assert "--unverified" in done.complaint
    assert not places["OUT"].exists()
    done = cli(*words)
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
