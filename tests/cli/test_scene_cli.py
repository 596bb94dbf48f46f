"""A scene to fill in, checked, given value by value, and noted beside a recording."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from pipeline.bench.scene import Scene
from springmass.loading.scenes import read_scene, stated_keys
from tests.cli.conftest import Cli


@pytest.fixture
def run(tmp_path: Path, data: Path) -> Path:
    """Return a copy of the damped recording in a new folder."""
    path = tmp_path / "damped.txt"
    path.write_bytes((data / "damped_simulated_position.txt").read_bytes())
    return path


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_scene_may_have_the_encoding_of_a_shell_or_editor(cli: Cli, tmp_path: Path, encoding: str) -> None:
    """PowerShell 5 saves the template in UTF-16; some editors begin UTF-8 with a byte order mark."""
    path = tmp_path / "bench.toml"
    path.write_text(cli("scene").out.replace("[spring]", "[spring]\nmass_kg = 0.01"), encoding=encoding)
    assert read_scene(path).spring_mass_kg is not None


def test_the_template_states_nothing_until_it_is_filled_in(cli: Cli, tmp_path: Path, run: Path) -> None:
    """Unedited it is no measurement, and no rangefinder; a key without a number of one's own is named and refused."""
    text, path = cli("scene").out, tmp_path / "bench.toml"
    path.write_text(text)
    done = cli("scene", "--check", path)
    assert (done.code, done.err) == (0, "")
    assert read_scene(path) == Scene()
    path.write_text(text.replace("# diameter_m", "diameter_m"))
    refused = cli("analyse", run, "--scene", path, "--no-report")
    assert refused.code == 2
    assert "diameter_m" in refused.complaint
    text = re.sub(r"^# none = .*\n", "", text, flags=re.MULTILINE)  # a bench with a spring
    filled = re.sub(r"^# (\w+ = |\[)", r"\1", text, flags=re.MULTILINE).replace(
        "pressure_pa = ...", "pressure_pa = 1e5"
    )
    path.write_text(filled.replace("{ value = ..., u = ... }", "0.2").replace("= ...", "= 1"))
    assert cli("scene", "--check", path).code == 0
    assert len(stated_keys(read_scene(path)).split(", ")) == len(re.findall(r"^# \w+ = ", text, re.MULTILINE))


def test_a_scene_given_as_a_recording_gets_the_command_that_checks_it(cli: Cli, tmp_path: Path) -> None:
    """The line ends in a command that works."""
    path = tmp_path / "my bench.toml"
    path.write_text("[bob]\nmass_kg = 0.2\n")
    done = cli("scene", path)
    assert done.code == 2
    _, command = done.complaint.split("springmass scene ")
    assert cli("scene", *shlex.split(command)).code == 0


def test_values_of_the_bench_on_the_command_line_stand_for_a_scene(cli: Cli, run: Path, data: Path) -> None:
    """Masses with their uncertainties give the spring constant that the scene gives; one amends a scene."""
    masses = ("--mass-kg", "0.2176+/-0.00005", "--set", "spring.mass_kg=0.0100(5)")
    bench = (*masses, "--set", "disc.diameter_m=0.102+/-0.0005", "--set", "air.temperature_c=20")
    (typed,) = cli("analyse", run, "--json", *bench).results
    (filed,) = cli("analyse", run, "--json", "--scene", data / "damped.scene.toml").results
    for name in ("value", "u"):
        typed_k, filed_k = (result["estimates"]["spring_constant"][name] for result in (typed, filed))
        assert typed_k == pytest.approx(filed_k, rel=1e-3)
    (amended,) = cli("analyse", run, "--json", "--scene", data / "damped.scene.toml", "--mass-kg", "0.3").results
    assert amended["provenance"]["parameters"]["scene"]["bob"]["mass_kg"] == 0.3
    assert amended["provenance"]["parameters"]["scene"]["disc"] == filed["provenance"]["parameters"]["scene"]["disc"]


def test_what_is_noted_beside_a_recording_is_used_and_said(cli: Cli, run: Path, data: Path) -> None:
    """Scene, remarks and marks outlive the command; a given scene goes before; the recording stays as it was."""
    before = run.read_bytes()
    first = cli("scene", run, "--scene", data / "damped.scene.toml", "--mark", '12.5=touched "it"', "--note", "by hand")
    assert first.code == 0
    assert cli("scene", run, "--mark", "3=door").code == 0
    beside = run.with_name("damped.txt.about.toml")
    assert [mark["t_s"] for mark in tomllib.loads(beside.read_text())["marks"]] == [3.0, 12.5]
    done = cli("analyse", run, "--json")
    assert str(beside) in done.complaint
    (result,) = done.results
    assert "spring_constant" in result["estimates"]
    assert result["recorded"]["marks"] == [{"t_s": 3.0, "text": "door"}, {"t_s": 12.5, "text": 'touched "it"'}]
    assert result["recorded"]["notes"] == ["by hand"]
    (given,) = cli("analyse", run, "--json", "--scene", data / "undamped.scene.toml").results
    assert given["provenance"]["parameters"]["scene"]["bob"]["mass_kg"]["value"] == 0.2007
    assert run.read_bytes() == before


def test_scenes_are_saved_on_request_under_the_whole_name(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Nothing is saved unasked; ``a.txt`` and ``a.csv`` have their own, and one of 0.2 is read where it is alone."""
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).write_bytes((data / "damped_simulated_position.txt").read_bytes())
    runs = sorted(tmp_path.glob("*.txt"))
    scene = ("--scene", data / "damped.scene.toml", "--accuracy", "fast")
    cli("analyse", *runs, *scene, "--output", tmp_path / "out")
    assert not list(tmp_path.glob("*.about.toml"))
    for run in runs:
        cli("scene", run, *scene[:2])
    assert sorted(path.name for path in tmp_path.glob("*.about.toml")) == ["a.txt.about.toml", "b.txt.about.toml"]
    (tmp_path / "a.txt.about.toml").rename(tmp_path / "a.about.toml")
    assert "spring_constant" in cli("analyse", tmp_path / "a.txt", "--json").results[0]["estimates"]
    (tmp_path / "a.csv").write_text("t (s),x (m)\n0,1\n0.1,2\n")
    assert "spring_constant" not in cli("analyse", tmp_path / "a.txt", "--json").results[0]["estimates"]


@pytest.mark.parametrize("note", ["x" * 17000, "\udce9"])
def test_notes_that_could_not_be_read_again_are_not_written(cli: Cli, run: Path, note: str) -> None:
    """One line that names the file; the earlier notes stay, and the recording can still be analysed."""
    beside = run.with_name("damped.txt.about.toml")
    assert cli("scene", run, "--note", "by hand").code == 0
    before = beside.read_bytes()
    done = cli("scene", run, "--note", note)
    assert (done.code, str(beside) in done.complaint) == (2, True)
    assert beside.read_bytes() == before
    assert cli("analyse", run, "--json", "--accuracy", "fast").code == 0


def test_notes_up_to_the_limit_are_read_again(cli: Cli, run: Path) -> None:
    """Remarks are added until one is refused; the recording then opens with all that were accepted."""
    note, accepted = 'é " \\ \x01 ' * 250, 0
    while cli("scene", run, "--note", note).code == 0:
        accepted += 1
    (result,) = cli("analyse", run, "--json", "--accuracy", "fast").results
    assert accepted > 1
    assert result["recorded"]["notes"] == [note] * accepted


@pytest.mark.parametrize(
    "text",
    [
        "marks = 3",
        "[scene.bob]\nmass_kg = -1",
        "what = 1",
        "notes = [",
        "[[marks]]\nt_s = 'a'",
        "[reading]\nunits = 'cm'",
    ],
)
def test_notes_that_cannot_be_read_are_refused(cli: Cli, run: Path, text: str) -> None:
    """One line that names the file; nothing is guessed from half of it."""
    beside = run.with_name("damped.txt.about.toml")
    beside.write_text(text)
    done = cli("analyse", run, "--json")
    assert done.code == 2
    assert str(beside) in done.complaint
