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
    ("line", "near"), [(("analyze", "x.txt"), "analyse"), (("analyse", "x.txt", "--accuracy", "bst"), "best")]
)
def test_a_word_nearly_right_is_answered_with_the_right_one(cli: Cli, line: tuple[str, ...], near: str) -> None:
    """A command or a choice mistyped."""
    done = cli(*line)
    assert done.code == 2
    assert done.err.rstrip().endswith(f"did you mean {near}?")


def test_a_mass_in_grams_is_asked_about(cli: Cli, data: Path, tmp_path: Path) -> None:
    """A bob of 217.6 kg is analysed, with a warning that names range and likely unit."""
    scene = tmp_path / "grams.toml"
    scene.write_text("[bob]\nmass_kg = 217.6\n", encoding="utf-8")
    done = cli("analyse", data / "damped_simulated_position.txt", "--json", "--accuracy", "fast", "--scene", scene)
    said = [f["message"] for f in done.results[0]["findings"] if f["code"] == "scene_implausible"]
    assert len(said) == 1
    assert "[bob] mass_kg = 217.6 is beyond 0.001 to 20 kg (did you mean grams: 0.2176?)" in said[0]
