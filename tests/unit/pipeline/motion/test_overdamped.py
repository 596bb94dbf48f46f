"""Overdamped motions give their rates; what only looks like one is not taken for one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from pipeline.analyse import Oscillation, analyse
from pipeline.bench.scene import Scene
from pipeline.motion.overdamped import Overdamped, find_overdamped
from pipeline.samples.condition import condition
from pipeline.track import Track
from pipeline.windows.cycles import NoOscillation

OMEGA = 8.3  # undamped, rad/s
T = np.arange(1000) / 100.0
SPRING = Scene.from_mapping({"bob": {"mass_kg": {"value": 0.2, "u": 5e-5}}})


def released(ratio: float, t: np.ndarray = T, start_m: float = 0.05, speed: float = 0.0) -> np.ndarray:
    """Return the displacement of a linearly damped bob by the exponential of its matrix, step by step, m."""
    matrix = np.array([[0.0, 1.0], [-(OMEGA**2), -2.0 * ratio * OMEGA]])
    step, state = expm(matrix * (t[1] - t[0])), np.array([start_m, speed])
    found = np.empty(t.size)
    for k in range(t.size):
        found[k] = state[0]
        state = step @ state
    return found


def track(y: np.ndarray, sigma_m: float, seed: int, t: np.ndarray = T) -> Track:
    """Return a record with white noise about a rest position of 220 mm."""
    return Track.from_arrays(t, 0.22 + y + sigma_m * np.random.default_rng(seed).standard_normal(t.size))


def relaxed(y: np.ndarray, sigma_m: float, seed: int) -> Overdamped:
    """Return what is found in a record that is a relaxation."""
    found = find_overdamped(condition(track(y, sigma_m, seed)))
    assert isinstance(found, Overdamped)
    return found


@pytest.mark.trials
@pytest.mark.parametrize("ratio", [1.1, 1.5, 2.0])
def test_overdamped_records_give_both_rates(ratio: float) -> None:
    """Over 25 runs both rates lie within their intervals as often as these say, and so does the spring constant."""
    root = math.sqrt(ratio**2 - 1.0)
    true = np.array([(ratio - root) * OMEGA, (ratio + root) * OMEGA, OMEGA**2])
    clean, pulls = released(ratio), []
    for seed in range(25):
        found = relaxed(clean, 3e-4, seed)
        assert found.kind == "overdamped"
        each = [found.estimates[f"relaxation_rate_{n}"] for n in ("slow", "fast")] + [found.squared_frequency]
        pulls.append([(e.value - x) / e.u for e, x in zip(each, true, strict=True)])
        assert [e.unit for e in each[:2]] == ["1/s", "1/s"]
    inside = np.mean(np.abs(pulls) <= 1.0, axis=0)
    assert np.all(np.abs(inside - 0.683) < 3.3 * math.sqrt(0.683 * 0.317 / 25))
    assert np.all(np.mean(np.abs(pulls) <= 1.96, axis=0) > 0.85)


@pytest.mark.parametrize("sigma_m", [3e-4, 2.39e-3])
def test_critical_records_give_one_rate(sigma_m: float) -> None:
    """At critical damping the one rate is that of the undamped oscillation, in most of 15 runs within its interval."""
    clean, pulls, kinds = released(1.0), [], []
    for seed in range(15):
        found = relaxed(clean, sigma_m, seed)
        kinds.append(found.kind)
        if found.kind == "critical":
            rate = found.estimates["relaxation_rate"]
            pulls.append((rate.value - OMEGA) / rate.u)
            assert "relaxation_rate_slow" not in found.estimates
    assert kinds.count("critical") >= 13
    assert np.std(pulls) < 1.6
    assert abs(np.mean(pulls)) < 1.0


@pytest.mark.parametrize("ratio", [0.06, 0.1, 0.3, 0.5, 0.7])
def test_strongly_damped_oscillations_give_frequency_and_rate(ratio: float) -> None:
    """Few cycles are enough: damping rate, damped and undamped frequency and amplitude lie within 4 u, in 8 runs."""
    damped = OMEGA * math.sqrt(1.0 - ratio**2)
    true = {"damping_rate": ratio * OMEGA, "angular_frequency": damped, "period": 2 * math.pi / damped}
    true |= {
        "amplitude": 0.05 * OMEGA / damped,
        "phase": -math.asin(ratio),
        "quality_factor": 0.5 / ratio,
    }
    clean, pulls = released(ratio), []
    for seed in range(8):
        found = relaxed(clean, 1e-3, seed)
        assert found.kind == "strong"
        each = [(found.estimates[name], x) for name, x in true.items()]
        each += [(found.squared_frequency, OMEGA**2), (found.damping_ratio, ratio)]
        pulls.append([(e.value - x) / e.u for e, x in each])
    assert np.max(np.abs(pulls)) < 4.0
    assert 0.5 < np.std(pulls) < 1.5


def test_a_push_and_a_hold_do_not_disturb() -> None:
    """A bob that is pushed, and one that is held for a second before it is let go, give the same rates."""
    pushed = relaxed(released(1.5, speed=-0.3), 3e-4, 1)
    held = np.concatenate([np.full(100, 0.05), released(1.5)[:900]])
    waited = relaxed(held, 3e-4, 1)
    for found in (pushed, waited):
        slow = found.estimates["relaxation_rate_slow"]
        assert slow.value == pytest.approx((1.5 - math.sqrt(1.25)) * OMEGA, abs=4.0 * slow.u + 0.03)
    assert waited.start_s == pytest.approx(1.0, abs=0.05)


SHAPES = {
    "noise": np.zeros(1000),
    "step": np.where(T > 4.0, 0.02, 0.0),
    "early step": np.where(T > 0.3, 0.02, 0.0),
    "line": 0.002 * T,
    "parabola": 2e-4 * T**2,
    "ramp": 0.02 * np.clip(T - 3.0, 0.0, 1.0),
    "two steps": np.where(T > 3.0, 0.02, 0.0) - np.where(T > 6.0, 0.02, 0.0),
    "smooth move": 0.01 * np.tanh(2.0 * (T - 5.0)),
    "wandering": 1e-3 * np.cumsum(np.random.default_rng(3).standard_normal(1000)) / 10.0,
    "weakly damped": released(0.02),
}


@pytest.mark.trials
@pytest.mark.parametrize("sigma_m", [3e-4, 2.39e-3])
@pytest.mark.parametrize("name", SHAPES)
def test_other_motions_are_no_relaxation(name: str, sigma_m: float) -> None:
    """Noise, steps, drifts, ramps and moves are never called overdamped, and give no rate."""
    for seed in range(2):
        assert not isinstance(find_overdamped(condition(track(SHAPES[name], sigma_m, seed))), Overdamped)
    if name != "weakly damped":
        result = analyse(track(SHAPES[name], sigma_m, 5))
        assert not any(name.startswith("relaxation") for name in result.estimates)
        assert "overdamped" not in {finding.code for finding in result.findings}


def test_a_lone_exponential_is_named_but_not_believed() -> None:
    """One exponential may be the end of an overdamped motion or a drift: its rate is given in words, no estimate."""
    found = find_overdamped(condition(track(0.02 * np.exp(-0.8 * T), 3e-4, 1)))
    assert isinstance(found, NoOscillation)
    assert not isinstance(found, Overdamped)
    assert "one exponential, at 0.8" in found.why


@pytest.mark.parametrize(("name", "sigma_m", "seed"), [("step", 2.39e-3, 1), ("early step", 2.39e-3, 0)])
def test_a_fall_between_two_samples_has_no_rate(name: str, sigma_m: float, seed: int) -> None:
    """A step gives no rate above half the sampling rate, in words or as an estimate."""
    assert find_overdamped(condition(track(SHAPES[name], sigma_m, seed))) is None
    assert find_overdamped(condition(track(SHAPES["early step"], 3e-4, 2))) is None


def test_an_analysis_says_what_it_found() -> None:
    """Overdamped records carry a finding with both rates, estimates and a spring constant, and no error."""
    result = analyse(track(released(1.5), 3e-4, 1), SPRING)
    assert isinstance(result.motion, Overdamped)
    assert [f.severity for f in result.findings if f.code == "overdamped"] == ["warning"]
    assert {"relaxation_rate_slow", "relaxation_rate_fast"} <= set(result.estimates)
    assert not any(f.severity == "error" for f in result.findings)
    k = result.estimates["spring_constant"]
    assert k.value == pytest.approx(0.2 * OMEGA**2, abs=4.0 * k.u)


@pytest.mark.parametrize("ratio", [0.01, 0.03, 0.1, 0.4])
def test_the_spring_constant_is_that_of_the_undamped_motion(ratio: float) -> None:
    """However strong the damping, k belongs to the undamped frequency and not to the damped one."""
    result = analyse(track(released(ratio), 1e-4, 2), SPRING)
    k = result.estimates["spring_constant"]
    assert k.value == pytest.approx(0.2 * OMEGA**2, abs=4.0 * k.u)
    assert ("strongly_damped" in {f.code for f in result.findings}) == (ratio > 0.05)
    assert isinstance(result.motion, Oscillation) == (ratio < 0.05)


def test_clean_and_short_records_do_no_harm() -> None:
    """Without noise the rates are exact; a dozen samples, equal ones, or none that move give nothing."""
    found = find_overdamped(condition(Track.from_arrays(T, released(1.5))))
    assert isinstance(found, Overdamped)
    assert found.estimates["relaxation_rate_fast"].value == pytest.approx((1.5 + math.sqrt(1.25)) * OMEGA, rel=1e-6)
    assert find_overdamped(condition(Track.from_arrays(T[:12], released(1.5)[:12]))) is None
    assert find_overdamped(condition(Track.from_arrays(T, np.full(T.size, 0.2)))) is None
