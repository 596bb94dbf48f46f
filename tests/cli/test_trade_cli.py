"""``springmass trade``: tiers and integrators measured against each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Cli

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
