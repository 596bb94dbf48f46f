"""What the user states about a file is kept next to it, and every later command reads it."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import springmass as sm
from tests.cli.conftest import Cli

T = np.arange(900) / 100
X = 20.0 + 5.0 * np.cos(8.3 * T)


@pytest.fixture
def bob(tmp_path: Path) -> Path:
    """Return a file that states neither a unit nor a rate."""
    path = tmp_path / "bob.csv"
    path.write_text("height\n" + "\n".join(f"{x:.4f}" for x in X))
    return path


def notes_of(path: Path) -> dict[str, object]:
    """Return the answers in the notes next to a file."""
    return dict(tomllib.loads(path.with_name(f"{path.name}.about.toml").read_text())["reading"])


def test_a_scene_keeps_the_answers_of_several_files(cli: Cli, bob: Path) -> None:
    """Later commands and Python read them, say so in one line, and options take precedence."""
    other = bob.with_name("other.csv")
    other.write_bytes(bob.read_bytes())
    assert cli("analyse", bob, "--no-report").code == 3
    assert cli("scene", bob, other, "--unit", "cm", "--rate-hz", "100", "--note", "windy").code == 0
    done = cli("analyse", bob, "--json")
    assert done.code == 0
    assert "unit cm" in done.err
    assert "rate_hz 100" in done.err
    assert abs(json.loads(done.out)["input"]["rate_hz"] - 100.0) < 1e-9
    assert cli("replay", other, "--speed", "max").code == 0
    assert sm.load(bob)["A0"].nominal_value == pytest.approx(0.05, rel=0.01)
    assert sm.load(bob, unit="mm")["A0"].nominal_value == pytest.approx(0.005, rel=0.01)


def test_no_answers_are_kept_that_do_not_open_the_file(cli: Cli, bob: Path) -> None:
    """Nothing is written."""
    assert cli("scene", bob, "--unit", "furlong", "--rate-hz", "100").code != 0
    assert cli("scene", bob, "--unit", "cm").code != 0
    assert [each.name for each in bob.parent.iterdir()] == ["bob.csv"]


def test_a_file_that_does_not_open_does_not_stop_the_others(cli: Cli, bob: Path) -> None:
    """A line says why for each; the exit code is that of several inputs, some of which failed."""
    absent, diary, other = (bob.with_name(name) for name in ("absent.csv", "diary.txt", "other.csv"))
    diary.write_text("Dear diary\n")
    other.write_bytes(bob.read_bytes())
    done = cli("scene", absent, bob, diary, other, "--unit", "cm", "--rate-hz", "100")
    assert done.code == 1
    assert [line for line in done.err.splitlines() if line.startswith(f"springmass: {absent}")]
    assert [line for line in done.err.splitlines() if line.startswith(f"springmass: {diary}")]
    assert notes_of(bob)["unit"] == notes_of(other)["unit"] == "cm"
    asked = cli("scene", bob, other, "--unit", "cm", "--channel", "nope")
    assert asked.code == 3
    assert asked.err.count("? springmass scene") == 2


def test_an_analysis_keeps_its_answers(cli: Cli, bob: Path) -> None:
    """A changed file is said to be newer than its answers; a run file states them among its provenance."""
    assert cli("analyse", bob, "--unit", "cm", "--rate-hz", "100", "--no-report", "--keep").code == 0
    assert {**notes_of(bob), "sha256": ""} == {"unit": "cm", "rate_hz": 100.0, "sha256": ""}
    assert "changed" not in cli("analyse", bob, "--no-report").err
    bob.write_text(bob.read_text() + "\n20.0")
    assert "changed" in cli("analyse", bob, "--no-report").err
    assert cli("convert", bob, bob.with_suffix(".h5")).code == 0
    assert sm.load(bob.with_suffix(".h5")).recorded["reading"] == {"unit": "cm", "rate_hz": 100.0}


def test_another_channel_takes_the_unit_with_it(cli: Cli, tmp_path: Path) -> None:
    """The unit that was stated belongs to the channel that was stated."""
    path = tmp_path / "two.csv"
    path.write_text("t (s),a,b\n" + "\n".join(f"{t:.2f},{x:.4f},{x:.4f}" for t, x in zip(T, X, strict=True)))
    assert cli("scene", path, "--channel", "a", "--unit", "cm").code == 0
    assert cli("analyse", path, "--no-report").code == 0
    assert "--unit" in cli("analyse", path, "--channel", "b", "--no-report").complaint
