"""``springmass trade``: tiers and integrators measured against each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Cli

TIERS = {"fast", "standard", "best"}


def test_a_recording_has_its_own_trade(cli: Cli, data: Path) -> None:
    """The motion has the period, law and length of the recording; every tier and every integrator is measured on it."""
    recording = data / "damped_simulated_position.txt"
    words = ("--seeds", "1", "--law", "linear+quadratic", "--to", "20")
    (found,) = cli("trade", "--json", recording, *words).results
    assert found["motion"]["frequency"] == pytest.approx(1.2657, abs=1e-3)
    assert (found["motion"]["law"], round(found["motion"]["seconds"])) == ("linear+quadratic", 20)
    clean = [row for row in found["tiers"] if row["record"] == "clean"]
    assert {row["tier"] for row in clean} == TIERS
    assert all(row["error_over_bound"]["frequency"] < 4.0 for row in clean)
    best = min(row["error"] for row in found["integrators"] if row["method"] == "auto 1e-09")
    assert best < 1e-8
