"""The frequency with an interval that holds, and its dependence on amplitude where there is one and only there."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.damping.select import fit_damping
from pipeline.motion.phase import PhaseFit, amplitude_integral, fit_phase, lag_of
from pipeline.track import Track
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
T = 0.4 + 0.757 * np.arange(158)
DRAG = {"gamma": 0.0065, "beta": 0.2}


def fitted(windows: Windows, t: np.ndarray, amplitude: np.ndarray, phase: np.ndarray, u_rad: float) -> PhaseFit:
    """Return the phase fit of windows made by hand."""
    points = windows(t, amplitude, phase=phase, u=(1e-5, u_rad, 1e-5))
    return fit_phase(points, fit_damping(points, 0.0))


def motion_of(synthetic: ModuleType, truth: object, sigma_m: float, seed: int, seconds: float = 120.0) -> Oscillation:
    """Return the motion found in a whole synthetic record."""
    t = synthetic.times(seconds)
    result: Analysis = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, sigma_m, seed)))
    assert isinstance(result.motion, Oscillation)
    return result.motion


@pytest.mark.parametrize("power", [2.0, 1.0, 0.5])
def test_the_integral_of_the_amplitude_is_the_closed_form(windows: Windows, power: float) -> None:
    """Where a power of the amplitude falls by e^10, its integral from the middle errs by less than 1e-5 anywhere."""
    t = np.linspace(0.0, 100.0, 200)
    gamma = 0.1 / power
    fit = fit_damping(windows(t, 0.05 * np.exp(-gamma * t), u=(1e-9, 1e-6, 1e-6)), 0.0).fits["linear"]
    at, area = amplitude_integral(fit, 0.0, 50.0, 0.0, 100.0, power)
    since = np.linspace(0.0, 100.0, 30_011)
    true = 0.05**power * (np.exp(-5.0) - np.exp(-0.1 * since)) / 0.1
    np.testing.assert_allclose(np.interp(since - 50.0, at, area), true, atol=1e-5 * np.ptp(true))


@pytest.mark.parametrize(("law", "power", "factor"), [("friction", 0, 1.5), ("quadratic", 2, 5.0 / 6.0)])
def test_a_sinusoid_is_late_by_what_drag_does_within_a_period(
    windows: Windows, law: str, power: int, factor: float
) -> None:
    """Of drag whose rate is c A^n the lag is (n + 3)/(2 (n + 1)) of c A^n over omega A; of linear drag none is seen."""
    t = np.linspace(0.5, 60.0, 100)
    start, coefficient = 0.05, 0.4 * 0.05 ** (1 - power) / 60.0
    amplitude = start - coefficient * t if power == 0 else start / (1.0 + coefficient * start * t)
    points = windows(t, amplitude, u=(1e-7, 1e-5, 1e-7))
    found = lag_of(fit_damping(points, 0.0).fits[law], 0.0, points)
    assert found is not None
    expected = factor * coefficient * amplitude ** (power - 1) / points.angular_frequency
    np.testing.assert_allclose(np.interp(t, *found), expected, rtol=1e-3)
    points = windows(t, start * np.exp(-0.01 * t), u=(1e-7, 1e-5, 1e-7))
    assert lag_of(fit_damping(points, 0.0).fits["linear"], 0.0, points) is None


@pytest.mark.parametrize("sigma_m", [1e-4, 1e-3])
@pytest.mark.parametrize("kappa", [-4.3, 3.0])
def test_injected_backbone_is_found(synthetic: ModuleType, sigma_m: float, kappa: float) -> None:
    """Where the frequency depends on amplitude, kappa comes back within three of its standard uncertainties."""
    truth = synthetic.Truth(kappa=kappa, **DRAG)
    pulls = []
    for seed in range(8):
        backbone = motion_of(synthetic, truth, sigma_m, seed).phase.backbone
        assert backbone is not None
        assert backbone.unit == "rad/(s m^2)"
        pulls.append((backbone.value - kappa) / backbone.u)
    assert np.max(np.abs(pulls)) <= 3.5  # the synthetic sinusoid lacks the lag that drag gives a real one


@pytest.mark.parametrize(
    ("power", "kappa", "unit"),
    [(2.0, -4.3, "rad/(s m^2)"), (1.0, -0.25, "rad/(s m)"), (0.5, -0.23, "rad/(s m^0.5)")],
)
def test_the_power_of_the_amplitude_is_found(windows: Windows, power: float, kappa: float, unit: str) -> None:
    """Phases that bend with a power of the amplitude give that power, and its coefficient within its interval."""
    gamma, pulls = 0.015, []
    amplitude = 0.05 * np.exp(-gamma * T)
    area = 0.05**power * (1.0 - np.exp(-power * gamma * T)) / (power * gamma)
    for seed in range(12):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal(T.size)
        fit = fitted(windows, T, amplitude, 8.3 * T + kappa * area + noise, 1e-3)
        assert fit.exponent == power
        assert fit.backbone is not None
        assert fit.backbone.unit == unit
        np.testing.assert_allclose(fit.rate(amplitude) - 8.3, kappa * amplitude**power, atol=4e-4)
        np.testing.assert_allclose(np.diff(fit.total(T)), np.diff(8.3 * T + kappa * area), atol=4e-4)
        pulls.append((fit.backbone.value - kappa) / fit.backbone.u)
    assert np.max(np.abs(pulls)) <= 3.5


@pytest.mark.parametrize(("seconds", "sigma_m"), [(120.0, 3e-4), (120.0, 2.39e-3), (20.0, 3e-4)])
def test_no_backbone_where_none_is(synthetic: ModuleType, seconds: float, sigma_m: float) -> None:
    """At a constant frequency at least 38 of 40 records show no dependence on amplitude."""
    truth = synthetic.Truth(**DRAG)
    found = [motion_of(synthetic, truth, sigma_m, seed, seconds).phase.backbone for seed in range(40)]
    assert sum(backbone is None for backbone in found) >= 38


def test_bend_widens_the_interval_to_hold_every_frequency(synthetic: ModuleType) -> None:
    """The mean frequency of a bending phase lies between the ends, and its u is far above a constant one's."""
    bent = motion_of(synthetic, synthetic.Truth(kappa=-4.3, **DRAG), 1e-4, 1).phase
    straight = motion_of(synthetic, synthetic.Truth(**DRAG), 1e-4, 1).phase
    assert 8.3 - 4.3 * 0.05**2 < bent.angular_frequency.value < 8.3
    assert bent.angular_frequency.u > 10.0 * straight.angular_frequency.u
    slow, fast = bent.rate(bent.damping.best.amplitude(np.array([0.0, 120.0])))
    assert slow == pytest.approx(8.3 - 4.3 * 0.05**2, abs=5e-4)
    assert fast == pytest.approx(8.3, abs=1e-3)


def test_total_phase_is_the_truths(synthetic: ModuleType) -> None:
    """The model's phase follows a bending truth at every sample within a milliradian or two, whole turns aside."""
    truth = synthetic.Truth(kappa=-4.3, **DRAG)
    t = synthetic.times(120)
    away = motion_of(synthetic, truth, 1e-4, 2).phase.total(t) - truth.phase_at(t)
    away -= 2 * np.pi * np.round(away[0] / (2 * np.pi))
    assert np.max(np.abs(away)) < 3e-3


def test_straight_phase_by_hand(windows: Windows) -> None:
    """For equal errors slope and its uncertainty are those of the textbook, the start's phase too."""
    rng = np.random.default_rng(3)
    u = 1e-3
    phase = 0.7 + 8.3 * T + rng.normal(0.0, u, T.size)
    found = fitted(windows, T, 0.05 * np.exp(-0.01 * T), phase, u)
    slope, intercept = np.polyfit(T, phase, 1)
    sxx = np.sum((T - T.mean()) ** 2)
    assert found.angular_frequency.value == pytest.approx(slope, rel=1e-10)
    assert found.phase.value == pytest.approx(intercept, abs=1e-8)
    if found.correlation == 1.0:
        assert found.angular_frequency.u == pytest.approx(u / math.sqrt(sxx), rel=1e-6)
        assert found.phase.u == pytest.approx(u * math.sqrt(1 / T.size + T.mean() ** 2 / sxx), rel=1e-6)
    assert found.angular_frequency.u >= 0.999 * u / math.sqrt(sxx)
    np.testing.assert_allclose(found.residual, phase - slope * T - intercept, atol=1e-8)


@pytest.mark.trials
def test_intervals_of_frequency_and_phase_hold(windows: Windows) -> None:
    """Over 300 runs 68 and 95 % intervals cover the truth so often."""
    amplitude = 0.05 * np.exp(-0.01 * T)
    pulls = []
    for seed in range(300):
        phase = 0.7 + 8.3 * T + np.random.default_rng(seed).normal(0.0, 1e-3, T.size)
        found = fitted(windows, T, amplitude, phase, 1e-3)
        pulls.append(
            [
                (found.angular_frequency.value - 8.3) / found.angular_frequency.u,
                (found.phase.value - 0.7) / found.phase.u,
            ]
        )
    inside = np.abs(np.array(pulls))
    np.testing.assert_allclose(np.mean(inside <= 1.0, axis=0), 0.683, atol=0.1)
    np.testing.assert_allclose(np.mean(inside <= 1.96, axis=0), 0.95, atol=0.04)


def test_wandering_phase_widens(windows: Windows) -> None:
    """A phase that wanders slowly by ten times its noise widens the frequency's interval at least as much."""
    flat, noise = np.full(T.size, 0.05), np.random.default_rng(5).normal(0.0, 1e-3, T.size)
    found = fitted(windows, T, flat, 0.7 + 8.3 * T + 0.01 * np.sin(2 * np.pi * T / 60.0) + noise, 1e-3)
    still = fitted(windows, T, flat, 0.7 + 8.3 * T + noise, 1e-3)
    assert found.angular_frequency.u > 10.0 * still.angular_frequency.u
    assert abs(found.angular_frequency.value - 8.3) < 3.0 * found.angular_frequency.u


@pytest.mark.parametrize("phase", [-3.1, -1.0, 0.0, 3.1, math.pi, 9.0])
def test_phase_is_wrapped(windows: Windows, phase: float) -> None:
    """The phase at the start lies in (-pi, pi]."""
    found = fitted(windows, T[:20], np.full(20, 0.05), phase + 8.3 * T[:20], 1e-4)
    assert -math.pi < found.phase.value <= math.pi
    assert math.cos(found.phase.value - phase) == pytest.approx(1.0)


def test_single_window_knows_little(windows: Windows) -> None:
    """One window gives a frequency with the width of its line, not less."""
    found = fitted(windows, T[:1], np.full(1, 0.05), 0.7 + 8.3 * T[:1], 1e-4)
    assert found.angular_frequency.value == 8.3
    assert found.angular_frequency.u >= 1.0
    assert found.phase.u >= 1.0
    assert found.backbone is None


def test_undamped_motion_shows_no_backbone(windows: Windows) -> None:
    """Without any fall of amplitude its effect on frequency is unknown, and is not claimed."""
    phase = 0.7 + 8.3 * T + np.random.default_rng(4).normal(0.0, 1e-3, T.size)
    assert fitted(windows, T, np.full(T.size, 0.05), phase, 1e-3).backbone is None
