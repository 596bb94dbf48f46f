"""Options given twice, scenes one a run, and words nearly right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]


def test_each_input_has_its_own_scene(cli: Cli, data: Path) -> None:
    """The masses of two scenes go to two inputs in their order, and exchanged with the scenes."""
    runs = [data / f"{name}_simulated_position.txt" for name in ("undamped", "damped")]
    scenes = [data / f"{name}.scene.toml" for name in ("undamped", "damped")]
    fast = ("--json", "--accuracy", "fast")
    own = cli("analyse", *runs, *fast, "--scene", scenes[0], "--scene", scenes[1]).results
    other = cli("analyse", *runs, *fast, "--scene", scenes[1], "--scene", scenes[0]).results
    for right, wrong in zip(own, other, strict=True):
        assert right["estimates"]["spring_constant"]["value"] == pytest.approx(14.0, abs=0.05)
        assert abs(wrong["estimates"]["spring_constant"]["value"] - 14.0) > 0.5


def test_scenes_that_do_not_match_the_inputs_are_refused(cli: Cli, data: Path) -> None:
    """Two scenes for one input leave nobody guessing which counts."""
    scene = data / "damped.scene.toml"
    done = cli("analyse", data / "damped_simulated_position.txt", "--scene", scene, "--scene", scene)
    assert done.code == 2
    assert "--scene was given 2 times for 1 runs" in done.err


@pytest.mark.parametrize(
    "line",
    [
        ("analyse", "x.txt", "--rate-hz", "100", "--rate-hz", "50"),
        ("record", "--simulate", "a.toml", "--simulate", "b.toml", "-o", "x.h5"),
        ("simulate", "--scene", "a.toml", "--scene", "b.toml"),
    ],
)
def test_an_option_given_twice_is_refused(cli: Cli, line: tuple[str, ...]) -> None:
    """No value is forgotten in silence."""
    done = cli(*line)
    assert done.code == 2
    assert "was given twice; give it once" in done.err


@pytest.mark.parametrize(
    ("line", "near"),
    [
        (("analyze", "x.txt"), "analyse"),
        (("analyse", "x.txt", "--accuracy", "bst"), "best"),
        (("analyse", "x.txt", "--chanel", "y"), "--channel"),
        (("record", "--trigg", "0.01"), "--trigger"),
        (("--verison",), "--version"),
    ],
)
def test_a_word_nearly_right_is_answered_with_the_right_one(cli: Cli, line: tuple[str, ...], near: str) -> None:
    """A command, an option or a choice mistyped; nothing is abbreviated."""
    done = cli(*line)
    assert done.code == 2
    assert done.complaint.endswith(f"did you mean {near}?")


def test_a_mass_in_grams_is_asked_about(cli: Cli, data: Path, tmp_path: Path) -> None:
    """A bob of 217.6 kg is analysed, with a warning that names range and likely unit."""
    scene = tmp_path / "grams.toml"
    scene.write_text("[bob]\nmass_kg = 217.6\n", encoding="utf-8")
    done = cli("analyse", data / "damped_simulated_position.txt", "--json", "--accuracy", "fast", "--scene", scene)
    messages = [f["message"] for f in done.results[0]["findings"] if f["code"] == "scene_implausible"]
    assert len(messages) == 1
    assert "[bob] mass_kg = 217.6 is beyond 0.001 to 20 kg (did you mean grams: 0.2176?)" in messages[0]


def test_the_earlier_name_of_the_output_still_works(cli: Cli, data: Path, tmp_path: Path) -> None:
    """`--out` is `-o`, of a simulation `--folder`; after `--` it is a file."""
    recording = data / "undamped_simulated_position.txt"
    for option in (("-o", "{}"), ("--output={}",), ("--out", "{}"), ("--out={}",)):
        folder = tmp_path / f"folder{len(list(tmp_path.iterdir()))}"
        assert cli("analyse", recording, "--accuracy", "fast", *(word.format(folder) for word in option)).code == 0
        assert (folder / "undamped_simulated_position.results" / "report.html").is_file()
    scene = ("--against", recording, "--scene", data / "undamped.scene.toml", "--json")
    assert cli("simulate", *scene, "--out", tmp_path / "predicted").code == 0
    assert (tmp_path / "predicted" / "undamped.simulated" / "run.h5").is_file()
    assert cli("analyse", "--json", "--", "--out").complaint.startswith("springmass: --out: ")
    assert cli("analyse", recording, "-o", "a", "--out", "b").complaint.startswith(
        "springmass: --output was given twice"
    )


def test_a_value_that_begins_with_a_minus_hangs_on_its_option(cli: Cli, data: Path) -> None:
    """A text takes an equals sign, a number stands alone."""
    recording = data / "undamped_simulated_position.txt"
    assert "--channel=-..." in cli("analyse", recording, "--channel", "-x").complaint
    assert '"-x"' in cli("analyse", recording, "--json", "--channel=-x").complaint
    (result,) = cli("analyse", recording, "--json", "--from", "-2").results
    assert result["provenance"]["parameters"]["from_s"] == -2.0
