"""Findings that name what a scene leaves out."""

from dataclasses import replace

import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.synthetic import Truth, noisy, times

KNOWN = {"value": 0.2, "u": 5e-5}


@pytest.mark.parametrize(
    ("tables", "named"),
    [
        ({"bob": {"mass_kg": 0.2}}, "mass of the bob"),
        ({"bob": {"mass_kg": KNOWN}, "disc": {"diameter_m": 0.1}}, "diameter of the disc"),
        ({"bob": {"mass_kg": KNOWN}, "spring": {"mass_kg": 0.01}}, "mass of the spring"),
        ({"bob": {"mass_kg": KNOWN}}, ""),
        ({"bob": {"mass_kg": KNOWN}, "spring": {"mass_kg": 1e-9}}, ""),
    ],
)
def test_inputs_without_uncertainty_are_named(tables: dict[str, object], named: str) -> None:
    """A plain number is exact, and a warning names those that are; what is known or too small to count is not named."""
    t = times(20.0)
    track = replace(Track.from_arrays(t, noisy(Truth(gamma=0.01463), t, 3e-4, 1)), clock="device")
    findings = analyse(track, Scene.from_mapping(tables)).findings
    messages = [finding.message for finding in findings if finding.code == "uncertainty_missing"]
    assert [message.rpartition(": ")[2].rstrip(".") for message in messages] == ([named] if named else [])
