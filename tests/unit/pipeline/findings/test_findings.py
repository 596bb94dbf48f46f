"""Findings: each comes from a run made to show it, with its severity and its numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.synthetic import Truth, noisy, times

KNOWN = {"value": 0.2, "u": 5e-5}


def record(seconds: float = 60.0, sigma_m: float = 1e-4, **truth: float) -> Track:
    """Return a plain run of linear drag, timed by its device."""
    t = times(seconds)
    return replace(Track.from_arrays(t, noisy(Truth(**({"gamma": 0.01463} | truth)), t, sigma_m, 1)), clock="device")


def in_scene(tables: dict[str, object]) -> Analysis:
    """Return the analysis of a run in a scene."""
    return analyse(record(20.0, 3e-4), Scene.from_mapping(tables))


@pytest.mark.parametrize(
    ("tables", "named"),
    [
        ({"bob": {"mass_kg": 0.2}}, "[bob] mass_kg"),
        ({"bob": {"mass_kg": KNOWN}, "disc": {"diameter_m": 0.1}}, "[disc] diameter_m"),
        ({"bob": {"mass_kg": KNOWN}, "spring": {"mass_kg": 0.01}}, "[spring] mass_kg"),
        ({"bob": {"mass_kg": KNOWN}}, ""),
        ({"bob": {"mass_kg": KNOWN}, "spring": {"mass_kg": 1e-9}}, ""),
    ],
)
def test_inputs_without_uncertainty_are_named(tables: dict[str, object], named: str) -> None:
    """A plain number is exact, and a warning names those that are; what is known or too small to count is not named."""
    messages = [f.message for f in in_scene(tables).findings if f.code == "uncertainty_missing"]
    assert [message.count("[") for message in messages] == ([1] if named else [])
    assert all(named in message for message in messages)
