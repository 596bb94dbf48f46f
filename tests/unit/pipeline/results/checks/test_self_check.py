"""What a record says against its own model is found, named, and enters the uncertainties."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.oscillation.condition import condition
from pipeline.results.checks.self_check import holding
from pipeline.track import F8, Track

OMEGA, AMPLITUDE, REST = 8.3, 0.05, 0.3
T: F8 = np.arange(2000) / 100.0


def displaced(t: F8 = T) -> F8:
    """Return a bob's displacement, weakly damped."""
    return AMPLITUDE * np.exp(-0.01 * t) * np.cos(OMEGA * t + 0.4)


def noise(seed: int, size: int = T.size, sigma_m: float = 3e-4) -> F8:
    """Return white noise."""
    return sigma_m * np.random.default_rng(seed).standard_normal(size)


def analysed(y: F8, t: F8 = T) -> Analysis:
    """Return the analysis of distances."""
    return analyse(Track.from_arrays(t, y))


def told(result: Analysis) -> dict[str, str]:
    """Return the messages of all warnings by code."""
    return {finding.code: finding.message for finding in result.findings if finding.severity != "info"}


def share(result: Analysis, quantity: str, name: str) -> float:
    """Return what an input contributes to the variance of an estimate."""
    assert isinstance(result.motion, Oscillation)
    lines = result.motion.derived.budgets[quantity].contributions
    return sum(line.share for line in lines if line.name == name)


@pytest.mark.parametrize(
    ("bend", "words"),
    [
        (lambda x: x + 0.05 * x**2 / AMPLITUDE, "a scale that is bent"),
        (lambda x: AMPLITUDE * np.tanh(x / AMPLITUDE), "odd harmonics"),
    ],
)
def test_waves_locked_to_the_oscillation_are_named(bend: object, words: str) -> None:
    """A bent scale and one that levels off are named, and amplitude and rest covered."""
    assert callable(bend)
    result = analysed(REST + bend(displaced()) + noise(1))
    assert words in told(result)["not_sinusoidal"]
    assert share(result, "amplitude", "model_misfit") > 0.5
    assert (
        abs(result.estimates["amplitude"].value - AMPLITUDE) < 4.0 * result.estimates["amplitude"].u + 0.2 * AMPLITUDE
    )
    assert abs(result.estimates["offset"].value - REST) < 4.0 * result.estimates["offset"].u


def test_bouncing_is_an_oscillation_that_is_no_sinusoid() -> None:
    """Parabolas one after another leave a seventh of the amplitude, the same in every period: that is said."""
    share_of_period = (OMEGA * T / (2.0 * math.pi)) % 1.0
    result = analysed(REST + AMPLITUDE * (8.0 * share_of_period * (1.0 - share_of_period) - 1.0) + noise(7))
    assert "not_sinusoidal" in told(result)
    assert result.estimates["period"].value == pytest.approx(2.0 * math.pi / OMEGA, rel=1e-3)


@pytest.mark.parametrize("end", [1.0, -1.0])
def test_an_echo_that_moves_slower_near_one_end_is_left_out(end: float) -> None:
    """Half the bob's speed beyond half the swing is no motion: it is named, and amplitude and rest are the bob's."""
    slower = np.where(end * displaced() > 0.5 * AMPLITUDE, end * 0.25 * AMPLITUDE + 0.5 * displaced(), displaced())
    result = analysed(REST + slower + noise(1))
    assert "locked_echoes" in told(result)
    for name, true in (("amplitude", AMPLITUDE), ("offset", REST)):
        assert abs(result.estimates[name].value - true) < 4.0 * result.estimates[name].u


def test_wave_too_small_to_tell_enters_the_uncertainty_without_a_word() -> None:
    """A second harmonic of 0.15 % of the amplitude is no warning, but a part of the budget."""
    harmonic = 0.0015 * AMPLITUDE * np.cos(2.0 * (OMEGA * T + 0.4))
    result = analysed(REST + displaced() + harmonic + noise(2, sigma_m=1e-4))
    assert "not_sinusoidal" not in told(result)
    assert result.estimates["offset"].u == pytest.approx(0.0015 * AMPLITUDE, rel=0.4)
    assert share(result, "offset", "model_misfit") > 0.9


@pytest.mark.parametrize("size", [5, 15, 31])
def test_running_mean_is_found_with_its_length(size: int) -> None:
    """Behind a running mean the length is found to a quarter, and the amplitude is covered."""
    t = np.arange(2200) / 100.0
    whole = REST + displaced(t) + noise(size, t.size)
    y = np.convolve(whole, np.full(size, 1.0 / size), "valid")
    result = analysed(y, t[size - 1 :])
    assert "smoothed_sensor" in told(result)
    found = result.estimates["amplitude"]
    true = AMPLITUDE * math.exp(-0.01 * t[size - 1])
    assert abs(found.value - true) < 3.0 * found.u
    assert share(result, "amplitude", "sensor_smoothing") > 0.5


def test_first_order_lag_is_found() -> None:
    """Behind a lag of 0.03 s the message has the lag, and the amplitude is covered."""
    t = np.arange(2300) / 100.0
    whole, y = REST + displaced(t) + noise(4, t.size), np.empty(t.size)
    held, each = whole[0], 1.0 - math.exp(-1.0 / 3.0)
    for k, value in enumerate(whole):
        held += each * (value - held)
        y[k] = held
    result = analysed(y[300:], t[300:])
    assert "first-order lag of 0.0" in told(result)["smoothed_sensor"]
    found = result.estimates["amplitude"]
    assert abs(found.value - AMPLITUDE * math.exp(-0.03)) < 4.0 * found.u


@pytest.mark.parametrize("step_m", [0.0, 0.001])
def test_held_distances_are_found_with_their_number(step_m: float) -> None:
    """Distances of a sensor of 25 Hz at 100 Hz stand four times in a row, in steps or not."""
    y = REST + displaced() + noise(5)
    y = np.round(y / step_m) * step_m if step_m else y
    result = analysed(y[np.arange(T.size) // 4 * 4])
    assert "stands 4 times" in told(result)["held_samples"]
    assert abs(result.estimates["amplitude"].value - AMPLITUDE) < 4.0 * result.estimates["amplitude"].u


def test_coarse_steps_alone_are_not_held() -> None:
    """Distances in steps of 3 mm repeat, but change at any row."""
    y = np.round((REST + displaced() + noise(6)) / 0.003) * 0.003
    assert holding(condition(Track.from_arrays(T, y))) == 1
    assert "quantised" in told(analysed(y))


def test_still_record_in_held_steps_says_so() -> None:
    """A record without motion says that its distances are held."""
    y = (REST + noise(7))[np.arange(T.size) // 5 * 5]
    found = told(analysed(y))
    assert {"no_oscillation", "held_samples"} <= set(found)


def test_rest_between_two_steps_is_known_to_the_step() -> None:
    """Where every distance is the same but for a few flips, the mean is known to the rounding and no better."""
    y = np.full(T.size, 0.3)
    y[::400] += 0.001
    assert analysed(y).estimates["offset"].u >= 0.001 / math.sqrt(12.0)


@pytest.mark.parametrize("sigma_m", [0.0, 1e-4, 2e-3])
def test_sinusoid_is_not_complained_of(sigma_m: float) -> None:
    """A damped sinusoid in white noise, or in none, has nothing of this, and no such input in its budgets."""
    result = analysed(REST + displaced() + noise(8, sigma_m=sigma_m))
    assert not told(result)
    assert share(result, "amplitude", "model_misfit") == share(result, "amplitude", "sensor_smoothing") == 0.0
