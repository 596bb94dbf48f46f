"""Findings that name what a scene leaves out."""

import math
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


@pytest.mark.parametrize(("length_m", "asked"), [(0.2193, False), (0.5, True)])
def test_a_gravity_that_is_not_the_earths_asks_about_the_length(length_m: float, asked: bool) -> None:
    """The result of a length that was mistyped is not sound, and the finding says why."""
    t = times(20.0)
    angle = Track.from_arrays(t, noisy(Truth(omega=math.sqrt(9.81 / 0.2193)), t, 3e-4, 1), unit="rad")
    findings = analyse(angle, Scene(pendulum_length_m=(length_m, 1e-4))).findings
    assert (("scene_implausible", "warning") in {(each.code, each.severity) for each in findings}) == asked
