"""Findings on the scene: what was not stated, or stated without an uncertainty."""

from __future__ import annotations

from types import ModuleType

import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.findings.scene import scene_findings
from pipeline.track import Track

EXACT = 0.2
KNOWN = {"value": 0.2, "u": 5e-5}


@pytest.mark.parametrize(
    ("tables", "named", "silent"),
    [
        ({"bob": {"mass_kg": EXACT}}, ["[bob] mass_kg"], ["[spring]", "[disc]"]),
        ({"bob": {"mass_kg": KNOWN}, "disc": {"diameter_m": 0.1}}, ["[disc] diameter_m"], ["[bob]"]),
        ({"bob": {"mass_kg": KNOWN}, "spring": {"mass_kg": 0.01}}, ["[spring] mass_kg"], ["[bob]"]),
    ],
)
def test_inputs_without_uncertainty_are_named(
    synthetic: ModuleType, tables: dict[str, object], named: list[str], silent: list[str]
) -> None:
    """A plain number is exact, and a warning says which ones were: no other input is named."""
    t = synthetic.times(20)
    result = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, 1)), Scene.from_mapping(tables))
    (finding,) = (f for f in result.findings if f.code == "uncertainty_missing")
    assert finding.severity == "warning"
    assert all(name in finding.message for name in named)
    assert not any(name in finding.message for name in silent)
    assert len(finding.message) <= 110
    severities = [f.severity for f in result.findings]
    assert severities == sorted(severities, key=["error", "warning", "info"].index)


@pytest.mark.parametrize(
    "tables", [{}, {"bob": {"mass_kg": KNOWN}}, {"bob": {"mass_kg": KNOWN}, "spring": {"mass_kg": 1e-9}}]
)
def test_a_scene_that_states_them_all_is_not_blamed(synthetic: ModuleType, tables: dict[str, object]) -> None:
    """Nothing unknown, and nothing too small to count, is named."""
    t = synthetic.times(20)
    result = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, 1)), Scene.from_mapping(tables))
    assert "uncertainty_missing" not in {f.code for f in result.findings}


def test_implausible_values_are_one_short_warning() -> None:
    """Two masses in grams are one warning of at most 110 characters, with both in the details."""
    scene = Scene.from_mapping({"bob": {"mass_kg": 217.6}, "spring": {"mass_kg": 27.5}})
    (finding,) = (f for f in scene_findings(scene, ()) if f.code == "scene_implausible")
    assert finding.severity == "warning"
    assert len(finding.message) <= 110
    assert all(word in finding.details for word in ("217.6", "27.5"))
