"""Findings: each comes from a run made to show it, with its severity and its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.findings.finding import word
from pipeline.registry.found import Found
from pipeline.track import F8, Track
from tests.synthetic import Truth, noisy, times

KNOWN = {"value": 0.2, "u": 5e-5}


def record(seconds: float = 60.0, sigma_m: float = 1e-4, **truth: float) -> Track:
    """Return a plain run of linear drag, timed by its device."""
    t = times(seconds)
    return replace(Track.from_arrays(t, noisy(Truth(**({"gamma": 0.01463} | truth)), t, sigma_m, 1)), clock="device")


def with_(add: Callable[[F8], F8], track: Track | None = None) -> Track:
    """Return a run with a function of time added to its distances."""
    track = track or record()
    return replace(track, y=track.y + add(track.t))


def without(rows: slice) -> Track:
    """Return a run in which some distances are missing."""
    track = record()
    y = track.y.copy()
    y[rows] = np.nan
    return replace(track, y=y)


def with_time(row: int, other: int) -> Track:
    """Return a run in which a row has the time of another one."""
    track = record()
    t = track.t.copy()
    t[row] = t[other]
    return replace(track, t=t)


MAKERS: dict[str, tuple[str, str, dict[str, float], Callable[[], Track]]] = {
    "some echoes": (
        *("false_echoes", "info", {"samples": 10, "share": 10 / 6000}),
        lambda: with_(lambda t: 0.01 * ((t > 4.995) & (t < 5.095))),
    ),
    "many echoes": (
        *("false_echoes", "warning", {"samples": 948, "share": 948 / 6000}),
        lambda: with_(lambda t: 0.01 * (np.arange(t.size) % 76 < 12)),
    ),
    "missing": ("missing_samples", "info", {"samples": 7}, lambda: without(slice(100, 107))),
    "lost periods": ("missing_samples", "warning", {"periods": 4.0}, lambda: without(slice(1000, 1300))),
    "duplicate": ("duplicate_time", "warning", {"samples": 1}, lambda: with_time(50, 49)),
    "backward": ("non_monotonic_time", "warning", {"samples": 1}, lambda: with_time(50, 45)),
    "stated error": (
        *("stated_error_is_not_noise", "info", {"stated_error_m": 0.00239, "noise_m": 1e-4}),
        lambda: replace(record(), stated_error_m=0.00239),
    ),
    "quantised": (
        *("quantised", "warning", {"step_m": 0.01, "noise_m": 1e-4}),
        lambda: replace(record(), quantum_m=0.01),
    ),
    "nominal clock": ("nominal_clock", "info", {}, lambda: replace(record(), clock="nominal")),
    "late": (
        *("late_readings", "info", {"readings": 3, "longest_stall_s": 0.2}),
        lambda: replace(record(), held_samples=3, longest_stall_s=0.2),
    ),
    "short": ("short_record", "warning", {"periods": 2.64}, lambda: record(2.0)),
    "bent": (
        *("amplitude_dependent_frequency", "warning", {"relative_shift": -4.3 * 0.05**2 / 8.3, "amplitude_m": 0.05}),
        lambda: record(120.0, kappa=-4.3),
    ),
    "drift": ("rest_drift", "warning", {"drift_m": 1e-3}, lambda: with_(lambda t: 1e-3 * t / t[-1])),
    "wobble": (
        *("model_misfit", "warning", {"noise_m": 1e-4}),
        lambda: with_(lambda t: 1e-3 * np.cos(2 * np.pi * t / 20.0) * np.cos(8.3 * t + 0.7)),
    ),
    "beats": (
        *("sideways_mode", "warning", {"frequency_hz": 0.8, "amplitude_m": 1e-3, "beat_s": 1.92}),
        lambda: with_(lambda t: 1e-3 * np.cos(2 * np.pi * 0.8 * t)),
    ),
    "growing": ("growing", "warning", {"growth_rate": 0.02}, lambda: record(amplitude=0.01, gamma=-0.02)),
}


@pytest.mark.parametrize("name", MAKERS)
def test_a_run_made_to_show_it_shows_it(name: str) -> None:
    """Each code comes once, with its severity and its numbers, in one short line."""
    code, severity, values, make = MAKERS[name]
    (finding,) = (one for one in analyse(make()).findings if (one.code, one.severity) == (code, severity))
    assert {key: finding.values[key] for key in values} == pytest.approx(values, rel=0.15)
    assert len(finding.message) <= 110
    assert bool(finding.advice) or finding.severity == "info"


def test_a_plain_run_has_no_warning() -> None:
    """A plain run of device time, 120 s of linear drag, has only notes."""
    assert {f.severity for f in analyse(record(120.0, 3e-4)).findings} <= {"info"}


def test_a_cut_crest_is_measured() -> None:
    """The crest cut off over a quarter of every period is a warning with the number of samples."""
    track = record(20.0, 1e-5)
    noise = 1e-4 * np.random.default_rng(2).standard_normal(len(track))
    result = analyse(replace(track, y=np.minimum(track.y, 0.255) + noise))
    (finding,) = (finding for finding in result.findings if finding.code == "clipped")
    assert finding.severity == "warning"
    assert finding.values["samples"] == result.quality["clipped"]


def test_strong_damping_and_none_are_reported() -> None:
    """A bob that returns without oscillating is a warning, strong damping a note, and neither is an error."""
    t = np.arange(1500) / 100.0
    noise = 2e-5 * np.random.default_rng(3).standard_normal(t.size)
    slow = 0.05 * (1.3 * np.exp(-2.0 * t) - 0.3 * np.exp(-8.7 * t))
    fast = 0.05 * np.exp(-0.5 * t) * np.cos(8.3 * t)
    for x, code, severity in ((slow, "overdamped", "warning"), (fast, "strongly_damped", "info")):
        findings = analyse(Track.from_arrays(t, 0.3 + x + noise)).findings
        assert (code, severity) in {(finding.code, finding.severity) for finding in findings}
        assert "error" not in {finding.severity for finding in findings}


def test_two_modes_have_no_single_period() -> None:
    """Two oscillations of like strength are an error, with both periods in the values."""
    t = np.arange(3000) / 100.0
    y = 0.3 + 0.02 * np.cos(8.3 * t) + 0.018 * np.cos(7.4 * t) + 1e-4 * np.random.default_rng(3).standard_normal(t.size)
    result = analyse(Track.from_arrays(t, y))
    assert (result.findings[0].code, result.findings[0].severity) == ("two_modes", "error")
    assert set(result.findings[0].values) <= set(result.estimates)
    periods = sorted(value for name, value in result.findings[0].values.items() if name.endswith("_period"))
    assert periods == pytest.approx([2.0 * np.pi / 8.3, 2.0 * np.pi / 7.4], rel=1e-3)
    assert "period" not in result.estimates


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


def test_implausible_values_are_one_warning() -> None:
    """Two masses in grams are one warning."""
    found = in_scene({"bob": {"mass_kg": 217.6}, "spring": {"mass_kg": 27.5}}).findings
    assert [f.severity for f in found if f.code == "scene_implausible"] == ["warning"]


def test_numbers_have_the_unit_of_the_recording() -> None:
    """A step of a length is in mm, one of a voltage in V, and the sentence names what steps."""
    found = Found("quantised", {"step_m": 0.002, "noise_m": 1e-4})
    assert {"distances", "2", "mm,"} <= set(word(found, "m").message.split())
    assert {"voltages", "0.002", "V,"} <= set(word(found, "V").message.split())
    assert word(found, "V").values == found.numbers
