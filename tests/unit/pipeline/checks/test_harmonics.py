"""Waves locked to the oscillation are reported and covered by the uncertainties."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.findings.finding import Finding
from pipeline.track import F8, Track

OMEGA, AMPLITUDE, REST = 8.3, 0.05, 0.3
T: F8 = np.arange(2000) / 100.0


def displaced() -> F8:
    """Return a bob's displacement, weakly damped."""
    return AMPLITUDE * np.exp(-0.01 * T) * np.cos(OMEGA * T + 0.4)


def analysed(y: F8, seed: int, sigma_m: float = 3e-4) -> Analysis:
    """Return the analysis of distances with white noise."""
    return analyse(Track.from_arrays(T, y + sigma_m * np.random.default_rng(seed).standard_normal(T.size)))


def warned(result: Analysis) -> dict[str, Finding]:
    """Return the warnings by code."""
    return {finding.code: finding for finding in result.findings if finding.severity != "info"}


@pytest.mark.parametrize(
    "bend", [lambda x: x + 0.05 * x**2 / AMPLITUDE, lambda x: AMPLITUDE * np.tanh(x / AMPLITUDE)], ids=["bent", "level"]
)
def test_a_scale_that_bends_the_motion_is_covered(bend: Callable[[F8], F8]) -> None:
    """A bent scale and one that levels off give a warning with their size, and cover amplitude and rest position."""
    result = analysed(REST + bend(displaced()), 1)
    values = warned(result)["not_sinusoidal"].values
    assert 0.01 < values["share"] < 0.1
    assert values["peak_m"] == pytest.approx(values["share"] * AMPLITUDE, rel=0.3)
    amplitude, offset = result.estimates["amplitude"], result.estimates["offset"]
    assert abs(amplitude.value - AMPLITUDE) < 4.0 * amplitude.u + 0.2 * AMPLITUDE
    assert abs(offset.value - REST) < 4.0 * offset.u


def test_bouncing_is_an_oscillation_that_is_no_sinusoid() -> None:
    """Parabolas one after another leave a seventh of the amplitude, the same in every period."""
    share_of_period = (OMEGA * T / (2.0 * math.pi)) % 1.0
    result = analysed(REST + AMPLITUDE * (8.0 * share_of_period * (1.0 - share_of_period) - 1.0), 7)
    assert warned(result)["not_sinusoidal"].values["share"] > 0.1
    assert result.estimates["period"].value == pytest.approx(2.0 * math.pi / OMEGA, rel=1e-3)


@pytest.mark.parametrize("end", [1.0, -1.0])
def test_an_echo_that_moves_slower_near_one_end_is_covered(end: float) -> None:
    """Half the bob's speed beyond half the swing is no sinusoid; the uncertainties cover the bob's own motion."""
    slower = np.where(end * displaced() > 0.5 * AMPLITUDE, end * 0.25 * AMPLITUDE + 0.5 * displaced(), displaced())
    result = analysed(REST + slower, 1)
    assert "not_sinusoidal" in warned(result)
    for name, true in (("amplitude", AMPLITUDE), ("offset", REST)):
        assert abs(result.estimates[name].value - true) < 4.0 * result.estimates[name].u


def test_a_small_wave_enters_the_uncertainty_without_a_warning() -> None:
    """A second harmonic of 0.15 % of the amplitude is no warning, but a part of the budget."""
    harmonic = 0.0015 * AMPLITUDE * np.cos(2.0 * (OMEGA * T + 0.4))
    result = analysed(REST + displaced() + harmonic, 2, 1e-4)
    assert "not_sinusoidal" not in warned(result)
    assert result.estimates["offset"].u == pytest.approx(0.0015 * AMPLITUDE, rel=0.4)


@pytest.mark.parametrize("sigma_m", [0.0, 1e-4, 2e-3])
def test_a_sinusoid_has_no_warning(sigma_m: float) -> None:
    """A damped sinusoid in white noise, or in none, has no warning."""
    result = analysed(REST + displaced(), 8, sigma_m)
    assert not warned(result)
