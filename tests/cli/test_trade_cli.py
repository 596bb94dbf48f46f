"""``springmass trade``: tiers and integrators measured against each other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]
TIERS = {"fast", "standard", "best"}


def test_the_errors_are_those_of_the_seeds(cli: Cli) -> None:
    """Two measurements give the same errors of every tier, and on clean records these are a few bounds at most."""
    (first,), (second,) = (cli("trade", "--json", "--seeds", "1", "--seconds", "8").results for _ in range(2))
    errors = [
        [(row["record"], row["tier"], row["error_over_bound"]) for row in one["tiers"]] for one in (first, second)
    ]
    assert errors[0] == errors[1]
    clean = [row for row in first["tiers"] if row["record"] == "clean"]
    assert {row["tier"] for row in clean} == TIERS
    assert all(row["error_over_bound"]["frequency"] < 4.0 for row in clean)


def test_a_recording_has_its_own_trade(cli: Cli, data: Path) -> None:
    """The motion has the period, the damping law and the length that the recording has; every integrator solves it."""
    recording = data / "damped_simulated_position.txt"
    (found,) = cli("trade", "--json", recording, "--seeds", "1", "--law", "linear+quadratic").results
    assert found["motion"]["frequency"] == pytest.approx(1.2657, abs=1e-3)
    assert (found["motion"]["law"], round(found["motion"]["seconds"])) == ("linear+quadratic", 120)
    best = min(row["error"] for row in found["integrators"] if row["method"] == "auto 1e-09")
    assert best < 1e-8
<<<<<<< HEAD


def test_a_scene_has_its_own_trade(cli: Cli, tmp_path: Path) -> None:
    """Both tables for the motion of a scene, as text."""
    scene = tmp_path / "bench.toml"
    scene.write_text("[bob]\nmass_kg = 0.2\n[spring]\nconstant_n_per_m = 14.0\n[start]\ndisplacement_m = 0.05\n")
    done = cli("-q", "trade", "--scene", scene, "--seeds", "1", "--seconds", "8")
    assert (done.code, done.err) == (0, "")
    assert all(word in done.out for word in (*TIERS, "strang", "dop853", "rk4", "20 % false echoes"))
    unstable = {line.split()[0] for line in done.out.splitlines() if "unstable" in line}
    assert unstable == {"forward-euler"}  # which grows at any step without damping


@pytest.mark.parametrize("arguments", [("--seeds", "0"), ("--seconds", "-1"), ("--seconds", "1")])
def test_what_cannot_be_measured_is_refused(cli: Cli, arguments: tuple[str, ...]) -> None:
    """Options out of their range end with exit code 2 and are named."""
    done = cli("trade", *arguments)
    assert (done.code, done.out, arguments[0] in done.complaint) == (2, "", True)


def test_a_recording_that_does_not_oscillate_has_no_trade(cli: Cli, tmp_path: Path) -> None:
    """One line and exit code 3."""
    still = tmp_path / "still.csv"
    still.write_text("time (s),distance (m)\n" + "".join(f"{i / 100:.2f},0.2\n" for i in range(1000)))
    done = cli("trade", still)
    assert (done.code, done.out, "still.csv" in done.complaint) == (3, "", True)
=======
>>>>>>> dietA
