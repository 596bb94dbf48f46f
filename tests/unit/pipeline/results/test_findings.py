"""Every finding is emitted by a record made to show it, and by no clean one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.oscillation.condition import condition
from pipeline.results.checks.finding import Finding
from pipeline.results.checks.sample_findings import count_quality, judge_samples
from pipeline.track import Quality, Track

RANK = {"error": 0, "warning": 1, "info": 2}
Maker = Callable[[ModuleType], Track]


def record(synthetic: ModuleType, seconds: float = 60.0, sigma_m: float = 1e-4, **truth: float) -> Track:
    """Return a clean record, timed by its device, of linear drag."""
    t = synthetic.times(seconds)
    y = synthetic.noisy(synthetic.Truth(**({"gamma": 0.01463} | truth)), t, sigma_m, 1)
    return replace(Track.from_arrays(t, y), clock="device")


def edited(track: Track, rows: slice, value: float, *, add: bool = False) -> Track:
    """Return the track with some distances replaced, or raised."""
    y = track.y.copy()
    y[rows] = y[rows] + value if add else value
    return replace(track, y=y)


def clipped(synthetic: ModuleType) -> Track:
    """The crest cut off over a quarter of every cycle."""
    track = record(synthetic, 20.0, 1e-5)
    y = np.minimum(track.y, 0.255) + 1e-4 * np.random.default_rng(2).standard_normal(len(track))
    return replace(track, y=y)


def echoes_everywhere(synthetic: ModuleType) -> Track:
    """A cluster of twelve samples in every period false."""
    track = record(synthetic)
    return replace(track, y=track.y + 0.01 * (np.arange(len(track)) % 76 < 12))


def times_changed(row: int, other: int) -> Maker:
    """Return a maker of a record in which a row has another's time."""

    def make(synthetic: ModuleType) -> Track:
        track = record(synthetic)
        t = track.t.copy()
        t[row] = t[other]
        return replace(track, t=t)

    return make


def drifting(synthetic: ModuleType) -> Track:
    """The rest position moves by 1 mm."""
    track = record(synthetic)
    return replace(track, y=track.y + 1e-3 * track.t / track.t[-1])


def stepping(synthetic: ModuleType) -> Track:
    """The rest position jumps up at 20 s and down at 41 s."""
    track = record(synthetic)
    return replace(track, y=track.y + 1.5e-3 * (track.t >= 20.0) - 1e-3 * (track.t >= 41.0))


def beating(synthetic: ModuleType) -> Track:
    """A pendulum's swing of 1 mm at 0.8 Hz beats with the oscillation of 1.32 Hz."""
    track = record(synthetic)
    return replace(track, y=track.y + 1e-3 * np.cos(2 * np.pi * 0.8 * track.t))


def faintly_beating(synthetic: ModuleType) -> Track:
    """A line of 0.7 mm far from the oscillation's, for two minutes in noise of 3 mm."""
    track = record(synthetic, 120.0, 3e-3)
    return replace(track, y=track.y + 7e-4 * np.cos(2 * np.pi * 4.1 * track.t))


def wobbling(synthetic: ModuleType) -> Track:
    """The amplitude wobbles by a millimetre, too slowly for a mode of its own."""
    track = record(synthetic)
    wobble = 1e-3 * np.cos(2 * np.pi * track.t / 20.0) * np.cos(8.3 * track.t + 0.7)
    return replace(track, y=track.y + wobble)


def growing(synthetic: ModuleType) -> Track:
    """The amplitude grows, which no damping does."""
    return record(synthetic, amplitude=0.01, gamma=-0.02)


MAKERS: dict[str, tuple[str, str, str, Maker]] = {
    "clipped": ("clipped", "warning", "plateau at 255.0 mm", clipped),
    "some echoes": (
        "false_echoes",
        "info",
        "of 6000 samples",
        lambda s: edited(record(s), slice(500, 510), 0.01, add=True),
    ),
    "many echoes": ("false_echoes", "warning", "of 6000 samples", echoes_everywhere),
    "missing": ("missing_samples", "info", "7 of 6000", lambda s: edited(record(s), slice(100, 107), np.nan)),
    "lost periods": ("missing_samples", "warning", "periods", lambda s: edited(record(s), slice(1000, 1300), np.nan)),
    "duplicate": ("duplicate_time", "warning", "1 samples repeat", times_changed(50, 49)),
    "backward": ("non_monotonic_time", "warning", "1 samples run backward", times_changed(50, 45)),
    "nominal clock": ("nominal_clock", "info", "50 ppm", lambda s: replace(record(s), clock="nominal")),
    "stated error": (
        "stated_error_is_not_noise",
        "info",
        "2.39 mm",
        lambda s: replace(record(s), stated_error_m=0.00239),
    ),
    "quantised": (
        "quantised",
        "warning",
        "steps of 10 mm",
        lambda s: replace(record(s), quantum_m=0.01),
    ),
    "law rejected": ("law_rejected", "info", "hyperbola", record),
    "every law rejected": ("no_law_fits", "warning", "no damping law describes", growing),
    "mixed": (
        "mixed_drag",
        "info",
        "linear and quadratic drag together: gamma = 0.007",
        lambda s: record(s, 120.0, gamma=0.0073, beta=0.235),
    ),
    "not separable": ("laws_not_separable", "info", "linear", lambda s: record(s, 10.0, gamma=0.003)),
    "short": ("short_record", "warning", "ten and more", lambda s: record(s, 2.0)),
    "bent": (
        "amplitude_dependent_frequency",
        "warning",
        "lower at 50 mm",
        lambda s: record(s, 120.0, kappa=-4.3),
    ),
    "drift": ("rest_drift", "warning", "by 1 mm", drifting),
    "steps": ("rest_drift", "warning", "jumps 2 times: +1.5 mm at ", stepping),
    "wobble": ("correlated_residuals", "warning", "widened", wobbling),
    "beats": (
        "sideways_mode",
        "warning",
        "a second mode of 1 mm at 0.8 Hz beats with the oscillation every 1.9 s; a pendulum 0.39 m long swings like "
        "that; it was fitted along",
        beating,
    ),
    "faint beats": ("sideways_mode", "info", "too small to disturb the amplitude", faintly_beating),
    "clusters": ("false_echoes", "warning", "clusters", echoes_everywhere),
    "still": ("no_oscillation", "error", "", lambda s: edited(record(s), slice(None), 0.2)),
    "noise": ("no_oscillation", "error", "no line", lambda s: record(s, 10.0, 1e-3, amplitude=1e-9)),
}


@pytest.mark.parametrize("name", MAKERS)
def test_record_made_to_show_it_shows_it(synthetic: ModuleType, name: str) -> None:
    """Each code comes with its severity and says how much, where a record is made to show it."""
    code, severity, words, make = MAKERS[name]
    result: Analysis = analyse(make(synthetic))
    matching = [f for f in result.findings if (f.code, f.severity) == (code, severity)]
    assert matching, result.findings
    assert any(words in f.message for f in matching), matching
    assert all("\n" not in f.message for f in result.findings)


def test_clean_record_has_no_complaint(synthetic: ModuleType) -> None:
    """A clean record of device time, 120 s of linear drag, only says which laws it rejects."""
    result = analyse(record(synthetic, 120.0, 3e-4))
    assert {f.code for f in result.findings} <= {"law_rejected", "laws_not_separable", "false_echoes"}
    assert {f.severity for f in result.findings} <= {"info"}


def test_gravest_come_first(synthetic: ModuleType) -> None:
    """Warnings stand before remarks."""
    track = growing(synthetic)
    result = analyse(edited(replace(track, clock="nominal"), slice(300, 500), np.nan))
    ranks = [RANK[f.severity] for f in result.findings]
    assert ranks == sorted(ranks)
    assert {1, 2} <= set(ranks)


def test_still_record_keeps_the_findings_on_its_samples(synthetic: ModuleType) -> None:
    """A record that does not oscillate still says what its samples show."""
    track = edited(edited(record(synthetic), slice(None), 0.2), slice(5, 8), np.nan)
    codes = [f.code for f in analyse(replace(track, clock="nominal")).findings]
    assert codes[0] == "no_oscillation"
    assert {"missing_samples", "nominal_clock"} <= set(codes)


def test_plateau_flagged_by_the_recording_is_told_without_a_level(synthetic: ModuleType) -> None:
    """Samples that the recording flagged as clipped are reported though no plateau is to be seen."""
    track = record(synthetic)
    flags = np.zeros(len(track), np.uint8)
    flags[10] = Quality.CLIPPED
    (finding, *_) = judge_samples(condition(track), flags, 1e-4)
    assert finding.code == "clipped"
    assert "flagged in the record" in finding.message


def test_stated_error_that_is_the_noise_is_no_finding(synthetic: ModuleType) -> None:
    """Where samples scatter as the file says there is nothing to remark."""
    track = replace(record(synthetic, sigma_m=2e-3), stated_error_m=0.00239)
    assert "stated_error_is_not_noise" not in {f.code for f in analyse(track).findings}


def test_counts_of_quality() -> None:
    """Every flag is counted, one sample under each of its bits, and what is used is free of them."""
    flags = np.array([0, 1, 2, 2 | 4, 8, 16, 32, 64], np.uint8)
    assert count_quality(flags) == {
        "missing": 1,
        "false_echo": 2,
        "clipped": 1,
        "duplicate_time": 1,
        "non_monotonic_time": 1,
        "outside": 0,
        "used": 2,
    }


def test_finding_is_a_value() -> None:
    """Two findings of the same words are equal."""
    assert Finding("clipped", "warning", "x") == Finding("clipped", "warning", "x")
