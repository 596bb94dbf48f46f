"""Findings on samples: each comes from a run made to show it, with its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.instrument import Instrument
from pipeline.findings.finding import Finding
from pipeline.findings.samples import clock_findings, held_finding, sample_findings
from pipeline.samples.condition import condition
from pipeline.track import Quality, Track

Maker = Callable[[ModuleType], Track]


def record(synthetic: ModuleType, seconds: float = 60.0, sigma_m: float = 1e-4, **truth: float) -> Track:
    """Return a plain run of linear drag, timed by its device."""
    t = synthetic.times(seconds)
    y = synthetic.noisy(synthetic.Truth(**({"gamma": 0.01463} | truth)), t, sigma_m, 1)
    return replace(Track.from_arrays(t, y), clock="device")


def edited(track: Track, rows: slice, value: float, *, add: bool = False) -> Track:
    """Return the track with some distances replaced, or raised."""
    y = track.y.copy()
    y[rows] = y[rows] + value if add else value
    return replace(track, y=y)


def echoes_everywhere(synthetic: ModuleType) -> Track:
    """A cluster of twelve samples in every period false."""
    track = record(synthetic)
    return replace(track, y=track.y + 0.01 * (np.arange(len(track)) % 76 < 12))


def times_changed(row: int, other: int) -> Maker:
    """Return a maker of a run in which a row has another's time."""

    def make(synthetic: ModuleType) -> Track:
        track = record(synthetic)
        t = track.t.copy()
        t[row] = t[other]
        return replace(track, t=t)

    return make


def only(track: Track, code: str) -> Finding:
    """Return the one finding of this code on a run."""
    (finding,) = (finding for finding in analyse(track).findings if finding.code == code)
    return finding


MAKERS: dict[str, tuple[str, str, dict[str, float], Maker]] = {
    "some echoes": (
        "false_echoes",
        "info",
        {"samples": 10, "share": 10 / 6000},
        lambda s: edited(record(s), slice(500, 510), 0.01, add=True),
    ),
    "many echoes": ("false_echoes", "warning", {"samples": 948, "share": 948 / 6000}, echoes_everywhere),
    "missing": (
        "missing_samples",
        "info",
        {"samples": 7},
        lambda s: edited(record(s), slice(100, 107), np.nan),
    ),
    "duplicate": ("duplicate_time", "warning", {"samples": 1}, times_changed(50, 49)),
    "backward": ("non_monotonic_time", "warning", {"samples": 1}, times_changed(50, 45)),
    "stated error": (
        "stated_error_is_not_noise",
        "info",
        {"stated_error_m": 0.00239, "noise_m": 1e-4},
        lambda s: replace(record(s), stated_error_m=0.00239),
    ),
    "quantised": (
        "quantised",
        "warning",
        {"step_m": 0.01, "noise_m": 1e-4},
        lambda s: replace(record(s), quantum_m=0.01),
    ),
    "nominal clock": ("nominal_clock", "info", {}, lambda s: replace(record(s), clock="nominal")),
    "late": (
        "late_readings",
        "info",
        {"readings": 3, "longest_stall_s": 0.2},
        lambda s: replace(record(s), held_samples=3, longest_stall_s=0.2),
    ),
}


@pytest.mark.parametrize("name", MAKERS)
def test_a_run_made_to_show_it_shows_it(synthetic: ModuleType, name: str) -> None:
    """Each code comes once, with its severity and its numbers."""
    code, severity, values, make = MAKERS[name]
    finding = only(make(synthetic), code)
    assert finding.severity == severity
    assert dict(finding.values) == pytest.approx(values, rel=0.15)


def test_a_cut_crest_is_measured(synthetic: ModuleType) -> None:
    """The crest cut off over a quarter of every period: at which level, and for how many samples."""
    track = record(synthetic, 20.0, 1e-5)
    noise = 1e-4 * np.random.default_rng(2).standard_normal(len(track))
    result = analyse(replace(track, y=np.minimum(track.y, 0.255) + noise))
    (finding,) = (finding for finding in result.findings if finding.code == "clipped")
    assert finding.severity == "warning"
    assert finding.values["level_1_m"] == pytest.approx(0.255, abs=2e-4)
    assert finding.values["samples"] == result.quality["clipped"]


@pytest.mark.parametrize(("sign", "way"), [(1.0, "nearer"), (-1.0, "away")])
def test_advice_on_a_cut_says_how_far_to_move_the_sensor(synthetic: ModuleType, sign: float, way: str) -> None:
    """Of 50 mm cut at 35 mm, 15 mm lack, and 1 cm is to spare; a cut at both ends has the registry's advice."""
    t = synthetic.times(20.0)
    x = synthetic.noisy(synthetic.Truth(), t, 1e-4, 1) - 0.22
    noise = 1e-4 * np.random.default_rng(2).standard_normal(t.size)
    one = only(Track.from_arrays(t, 0.3 + sign * np.minimum(x, 0.035) + noise), "clipped")
    assert way in one.advice
    assert "3 cm" in one.advice
    both = analyse(Track.from_arrays(t, 0.3 + np.clip(x, -0.035, 0.035) + noise))
    advice = {finding.advice for finding in both.findings if finding.code == "clipped"}
    assert len(advice) == 1
    assert "cm" not in advice.pop()


def test_samples_that_the_recording_flags_as_clipped_are_reported(synthetic: ModuleType) -> None:
    """They are counted though no plateau is to be seen."""
    track = record(synthetic)
    flags = np.zeros(len(track), np.uint8)
    flags[10] = Quality.CLIPPED
    (finding, *_) = sample_findings(condition(track), flags, 1e-4)
    assert (finding.code, dict(finding.values)) == ("clipped", {"samples": 1})


def test_a_stated_error_that_is_the_noise_is_no_finding(synthetic: ModuleType) -> None:
    """Where samples scatter as the file states there is no finding."""
    track = replace(record(synthetic, sigma_m=2e-3), stated_error_m=0.00239)
    assert "stated_error_is_not_noise" not in {f.code for f in analyse(track).findings}


def test_a_still_run_has_the_findings_on_its_samples(synthetic: ModuleType) -> None:
    """A run that does not oscillate has them too, after the error."""
    track = edited(edited(record(synthetic), slice(None), 0.2), slice(5, 8), np.nan)
    codes = [f.code for f in analyse(replace(track, clock="nominal")).findings]
    assert codes[0] == "no_oscillation"
    assert {"missing_samples", "nominal_clock"} <= set(codes)


def test_held_distances_have_their_number() -> None:
    """The finding carries over how many samples a distance is held, and the sensor's interval."""
    finding = held_finding(4, 0.04, "m")
    assert (finding.severity, dict(finding.values)) == ("warning", {"count": 4, "interval_s": 0.04})


def test_clocks_that_disagree_are_a_warning(synthetic: ModuleType) -> None:
    """A correction that no clock can need is refused; a device's own clock alone gives no finding."""
    track = record(synthetic)
    assert list(clock_findings(track, Instrument.of(track))) == []
    wrong = replace(track, rate_error=0.03, u_rate_error=1e-5, clock_limit=0.01)
    (finding,) = clock_findings(wrong, Instrument.of(wrong))
    assert (finding.code, finding.severity) == ("clock_refused", "warning")
