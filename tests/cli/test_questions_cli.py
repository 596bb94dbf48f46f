"""What a recording leaves out is asked as the command that was typed, and the line that is suggested works."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from springmass.loading.load import sample_data
from tests.cli.conftest import Cli, Viewer


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Return a table in a folder with a blank in its name: channel and unit of a decaying oscillation are missing."""
    folder = tmp_path / "my runs"
    folder.mkdir()
    t = np.arange(1200) / 50
    noise = np.random.default_rng(1).normal(0, 1e-4, (2, t.size))
    x, y = 0.2 + 0.05 * np.exp(-0.02 * t) * np.cos(8.3 * t + np.array([[0.0], [1.0]])) + noise
    path = folder / "run.csv"
    rows = "".join(f"{a:.2f},{b:.5f},{c:.5f}\n" for a, b, c in zip(t, x, y, strict=True))
    path.write_text("t,height of bob,y\n" + rows, encoding="utf-8")
    return path


SCENE = str(sample_data() / "damped.scene.toml")
COMMANDS = {
    "analyse": ["analyse", "FILE", "--no-report"],
    "analyse with a scene": ["analyse", "--scene", SCENE, "FILE", "--json"],
    "a channel that is not there": ["analyse", "FILE", "--json", "--channel=z"],
    "convert": ["convert", "FILE", "OUT", "--overwrite"],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_the_line_that_is_suggested_does_what_was_asked(cli: Cli, table: Path, tmp_path: Path, name: str) -> None:
    """It is the line that was typed, every option of it, with what is missing at its end."""
    places = {"FILE": str(table), "OUT": str(tmp_path / "out.h5")}
    typed = [places.get(word, word) for word in COMMANDS[name]]
    done = cli(*typed)
    assert (done.code, done.out) == (3, "")
    program, *suggested = shlex.split(done.complaint[done.complaint.index("? springmass ") + 2 :])
    refused = {"--channel=z", "--chan", "z"}
    assert program == "springmass"
    assert suggested == [
        *(word for word in typed if word not in refused),
        *("--channel", "height of bob"),
        *([] if refused & {*typed} else ["--unit", "m"]),
    ]
    # The unit of a channel that was not there is asked next.
    unit = ["--unit", "m"] if refused & {*typed} else []
    assert cli(*suggested, *unit).code == 0


PAIRS = {
    "replay": ["replay", "FILE", "--speed", "max"],
    "replay a wrong channel": ["replay", "--read", "channel=z", "--read", "unit=cm", "FILE", "--speed", "max"],
    "simulate": ["simulate", "--against", "FILE", "--scene", SCENE, "--json"],
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_line_with_pairs_that_is_suggested_works(cli: Cli, table: Path, name: str) -> None:
    """What is missing is stated as --read KEY=VALUE."""
    done = cli(*(str(table) if word == "FILE" else word for word in PAIRS[name]))
    assert (done.code, done.out) == (3, "")
    _, *suggested = shlex.split(done.complaint[done.complaint.index("? springmass ") + 2 :])
    assert "channel=z" not in suggested
    assert "channel=height of bob" in suggested
    assert cli(*suggested).code == 0


def test_several_files_are_asked_for_notes(cli: Cli, table: Path) -> None:
    """The suggested line keeps the answers next to the file that asks; then the same command works."""
    typed = ("compare", table, sample_data() / "damped_simulated_position.txt", "--scene", SCENE, "--json")
    done = cli(*typed)
    assert done.code == 3
    _, *suggested = shlex.split(done.complaint[done.complaint.index("? springmass ") + 2 :])
    assert cli(*suggested).code == 0
    assert cli(*typed).code == 0


def test_a_course_is_asked_for_pairs_that_work(cli: Cli, table: Path, tmp_path: Path) -> None:
    """The words in the message, behind those that were typed, answer for all recordings."""
    typed = ("batch", table, "-o", tmp_path / "course", "--jobs", "1", "--reports", "0")
    done = cli(*typed)
    assert done.code == 3
    (words,) = re.findall(r"give batch (--read .*) for all recordings", done.err)
    assert cli(*typed, *shlex.split(words)).code == 0


def test_the_page_is_asked_for_a_line_that_works(cli: Cli, table: Path, viewer: Viewer) -> None:
    """It keeps the answers, with which the run is shown; without them there is no page."""
    shown = ("page", "--play", table, "--no-browser")
    done = cli(*shown)
    assert (done.code, viewer.seen) == (3, [])
    _, *suggested = shlex.split(done.complaint[done.complaint.index("? springmass ") + 2 :])
    assert (cli(*suggested).code, cli(*shown).code) == (0, 0)
    assert "estimates" in viewer.seen[0]


def test_each_of_several_inputs_is_asked_for_alone(cli: Cli, table: Path) -> None:
    """An answer for one file may be wrong for another: the line names the one that asks."""
    done = cli("analyse", table, sample_data() / "damped_simulated_position.txt", "--json", "--unit", "cm")
    (line,) = (line for line in done.err.splitlines() if "? " in line)
    assert line.endswith(f'? springmass analyse "{table}" --unit cm --channel "height of bob"')
