"""``springmass trade``: methods and integrators measured against each other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]


def test_the_errors_are_those_of_the_seeds(cli: Cli) -> None:
    """Two measurements give the same errors for every method, and one of the tiers is recommended."""
    (first,), (second,) = (cli("trade", "--json", "--seeds", "1", "--seconds", "8").results for _ in range(2))
    errors = [[(each["name"], each["error_over_bound"]) for each in result["methods"]] for result in (first, second)]
    assert errors[0] == errors[1]
    assert {"fast", "standard", "best", "classic", "scipy"} <= {name for name, _ in errors[0]}
    assert first["recommended"] in ("fast", "standard", "best")


def test_a_recording_is_analysed_by_every_method(cli: Cli, recording: Path) -> None:
    """All periods agree within a hundredth."""
    (result,) = cli("trade", "--json", recording).results
    periods = [each["estimates"]["period"]["value"] for each in result["methods"]]
    assert periods == pytest.approx([periods[0]] * len(periods), rel=0.01)


def test_a_scene_has_its_own_trade(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Every integrator's error and time on a scene, and one recommendation that keeps what is wanted."""
    scene = tmp_path / "bench.toml"
    scene.write_text("[bob]\nmass_kg = 0.2\n[spring]\nconstant_n_per_m = 14.0\n[start]\ndisplacement_m = 0.05\n")
    options = ("--scene", scene, "--seconds", "1", "--tolerance", "1e-9", "--json")
    (found,) = cli("trade", "--integrators", *options).results
    assert {"strang", "dop853", "rk4"} <= {row["method"] for row in found["integrators"]}
    assert found["recommended"]["error"] <= found["recommended"]["wanted"] == 1e-9


@pytest.mark.parametrize(
    "arguments", [("--seeds", "0"), ("--noise-m", "-1"), ("--seconds", "1"), ("--integrators", "--seeds", "3")]
)
def test_what_cannot_be_measured_is_refused(cli: Cli, arguments: tuple[str, ...]) -> None:
    """Options out of their range, or of another trade, end with exit code 2 and are named."""
    done = cli("trade", *arguments)
    assert (done.code, done.out) == (2, "")
    assert arguments[-2].removeprefix("--").partition("-")[0] in done.err
