"""Findings on the motion: each comes from a run made to show it, with its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.checks.harmonics import Harmonics
from pipeline.checks.misfit import Misfit
from pipeline.checks.model import Contradiction, ModelCheck
from pipeline.checks.plausibility import Plausibility
from pipeline.findings.finding import Finding
from pipeline.findings.motion import fit_findings, harmonics_finding, model_finding, plausibility_findings
from pipeline.track import Track

Maker = Callable[[ModuleType], Track]


def record(synthetic: ModuleType, seconds: float = 60.0, sigma_m: float = 1e-4, **truth: float) -> Track:
    """Return a plain run of linear drag, timed by its device."""
    t = synthetic.times(seconds)
    y = synthetic.noisy(synthetic.Truth(**({"gamma": 0.01463} | truth)), t, sigma_m, 1)
    return replace(Track.from_arrays(t, y), clock="device")


def lost(synthetic: ModuleType) -> Track:
    """Nearly four periods without a sample."""
    track = record(synthetic)
    y = track.y.copy()
    y[1000:1300] = np.nan
    return replace(track, y=y)


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
    """The amplitude wobbles by a millimetre, too slowly for a separate mode."""
    track = record(synthetic)
    wobble = 1e-3 * np.cos(2 * np.pi * track.t / 20.0) * np.cos(8.3 * track.t + 0.7)
    return replace(track, y=track.y + wobble)


MAKERS: dict[str, tuple[str, str, dict[str, float], Maker]] = {
    "lost periods": ("missing_samples", "warning", {"periods": 4.0}, lost),
    "short": ("short_record", "warning", {"periods": 2.64}, lambda s: record(s, 2.0)),
    "bent": (
        "amplitude_dependent_frequency",
        "warning",
        {"relative_shift": -4.3 * 0.05**2 / 8.3, "amplitude_m": 0.05, "exponent": 2.0},
        lambda s: record(s, 120.0, kappa=-4.3),
    ),
    "drift": ("rest_drift", "warning", {"drift_m": 1e-3, "jumps": 0.0}, drifting),
    "steps": ("rest_drift", "warning", {"jumps": 2.0}, stepping),
    "wobble": ("model_misfit", "warning", {"noise_m": 1e-4}, wobbling),
    "beats": (
        "sideways_mode",
        "warning",
        {"frequency_hz": 0.8, "amplitude_m": 1e-3, "beat_s": 1.92, "modes": 1.0},
        beating,
    ),
    "faint beats": ("sideways_mode", "info", {"frequency_hz": 4.1, "amplitude_m": 7e-4}, faintly_beating),
}


@pytest.mark.parametrize("name", MAKERS)
def test_a_run_made_to_show_it_shows_it(synthetic: ModuleType, name: str) -> None:
    """Each code comes once, with its severity and its numbers."""
    code, severity, values, make = MAKERS[name]
    found = analyse(make(synthetic)).findings
    (finding,) = (one for one in found if (one.code, one.severity) == (code, severity))
    for key, value in values.items():
        assert finding.values[key] == pytest.approx(value, rel=0.35 if severity == "info" else 0.15), key


def test_a_plain_run_has_no_warning(synthetic: ModuleType) -> None:
    """A plain run of device time, 120 s of linear drag, has only the notes on its laws."""
    findings = analyse(record(synthetic, 120.0, 3e-4)).findings
    assert {f.code for f in findings} <= {"law_rejected", "laws_not_separable", "false_echoes"}
    assert {f.severity for f in findings} <= {"info"}


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


def check(*found: Contradiction, misfits: tuple[Misfit, ...] = ()) -> ModelCheck:
    """Return a check that found these contradictions."""
    return ModelCheck(found, 2e-3, 1e-3, 5e-4, 3.0, 7.0, 0.8, 0.05, misfits)


@pytest.mark.parametrize("found", list(Contradiction), ids=lambda one: one.value)
def test_a_contradiction_is_one_warning_with_all_numbers(found: Contradiction) -> None:
    """Whichever check the run fails, the finding is the same warning with the numbers of all of them."""
    finding = model_finding(check(found), "m")
    assert finding is not None
    assert (finding.code, finding.severity) == ("model_misfit", "warning")
    assert dict(finding.values) == {
        "rms_m": 2e-3,
        "noise_m": 1e-3,
        "phase_chi2": 3.0,
        "halves": 7.0,
        "correlation": 0.8,
        "lag_s": 0.05,
    }


def test_a_model_without_contradiction_is_no_finding() -> None:
    """Scatter alone is in the uncertainties."""
    assert model_finding(check(), "m") is None


def test_the_second_fit_is_in_the_details() -> None:
    """Where the waveform was fitted too, the details give both differences."""
    misfit = Misfit(name="choice_of_fit", amplitude_m=3.25e-4, damping_rate=1.75e-3)
    finding = model_finding(check(Contradiction.HALVES, misfits=(misfit,)), "m")
    assert finding is not None
    assert "0.33 mm" in finding.details or "0.32 mm" in finding.details
    assert "0.0018" in finding.details


def harmonics(share: float) -> Harmonics:
    """Return a second harmonic of this share of 50 mm."""
    misfit = Misfit(name="model_misfit", amplitude_m=share * 0.05)
    return Harmonics(share * 0.05, share, 1.0, 1.0, near_end=True, at_samples=np.zeros(3), misfit=misfit)


def test_small_harmonics_are_no_finding() -> None:
    """Below a five-hundredth of the amplitude they are in the uncertainties only."""
    assert harmonics_finding(harmonics(0.0019), "m") is None
    finding = harmonics_finding(harmonics(0.03), "m")
    assert finding is not None
    assert dict(finding.values) == {"peak_m": pytest.approx(1.5e-3), "share": 0.03}


def plausible(**limits: bool) -> Plausibility:
    """Return a check that exceeds these limits."""
    flags = dict.fromkeys(("undersampled", "too_fast", "too_slow", "out_of_range"), False) | limits
    return Plausibility(
        **flags,
        samples_per_period=3.4,
        frequency_hz=0.05,
        amplitude=0.5,
        gravities=4.2,
        sag_m=99.0,
        low_m=-0.4,
        high_m=12.0,
        misfits=(),
    )


@pytest.mark.parametrize(
    ("limit", "code", "values"),
    [
        ("undersampled", "undersampled", {"samples_per_period": 3.4}),
        ("too_fast", "implausible_motion", {"gravities": 4.2, "frequency_hz": 0.05}),
        ("too_slow", "implausible_sag", {"period_s": 20.0, "sag_m": 99.0}),
        ("out_of_range", "implausible_distance", {"low_m": -0.4, "high_m": 12.0}),
    ],
)
def test_each_limit_has_its_warning(limit: str, code: str, values: dict[str, float]) -> None:
    """A limit that is exceeded gives its own warning, with its numbers, and no other."""
    track = Track.from_arrays(np.arange(10) / 10.0, np.zeros(10))
    (finding,) = plausibility_findings(plausible(**{limit: True}), track)
    assert (finding.code, finding.severity) == (code, "warning")
    assert dict(finding.values) == pytest.approx(values)
    assert list(plausibility_findings(plausible(), track)) == []


def test_a_fit_that_was_not_asked_for_has_no_finding(synthetic: ModuleType) -> None:
    """Neither a waveform nor an equation of motion fitted: nothing to report."""
    assert list(fit_findings(None, None)) == []
    result = analyse(record(synthetic))
    assert isinstance(result.motion, Oscillation)
    assert result.motion.full is None


def test_a_finding_is_a_value() -> None:
    """Two findings of the same words are equal."""
    assert Finding("clipped", "warning", "x") == Finding("clipped", "warning", "x")
