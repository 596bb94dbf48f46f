"""Each tier keeps its promises: findings on dirty records, the same answer at any origin and scale, deep noise."""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np
import pytest
from scipy.optimize import curve_fit

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.options import TIERS, Options, options_for
from pipeline.track import F8, Quality, Track
from tests.sampling import sampled

every_tier = pytest.mark.parametrize("accuracy", TIERS)


def motion_of(result: Analysis) -> Oscillation:
    """Return the motion of a record that oscillates."""
    assert isinstance(result.motion, Oscillation)
    return result.motion


def test_an_unknown_tier_is_refused() -> None:
    """The error names the tiers there are."""
    with pytest.raises(PipelineError, match="quick"):
        options_for("quick")


@every_tier
def test_dirt_is_told(synthetic: ModuleType, accuracy: str) -> None:
    """False echoes, a clipped crest and missing samples are flagged and named at every tier."""
    truth = synthetic.Truth(gamma=0.01)
    t = synthetic.times(30)
    y = np.minimum(synthetic.noisy(truth, t, 3e-4, 3), truth.offset + 0.8 * truth.amplitude)
    echoes = np.arange(57, t.size, 97)
    y[echoes] = 1.3
    y[1000:1010] = np.nan
    result = analyse(Track.from_arrays(t, y), options=options_for(accuracy))
    assert {"clipped", "false_echoes", "missing_samples"} <= {finding.code for finding in result.findings}
    assert np.all((result.flags[echoes] & np.uint8(Quality.FALSE_ECHO)) > 0)
    amplitude = result.estimates["amplitude"]
    assert abs(amplitude.value - truth.amplitude) < 4.0 * amplitude.u


@every_tier
def test_the_origin_of_time_does_not_matter(synthetic: ModuleType, accuracy: str) -> None:
    """Counted from 1970 or from the start, period, amplitude and phase differ by less than 0.05 of their bounds."""
    truth = synthetic.Truth(gamma=0.01463)
    t = synthetic.times(20.0, 128.0)  # steps of 1/128 s are exact beside 1.7e9 s
    y = synthetic.noisy(truth, t, 3e-4, 5)
    near, far = (
        analyse(Track.from_arrays(t + start, y, rate_hz=128.0), options=options_for(accuracy)) for start in (0.0, 1.7e9)
    )
    bounds = synthetic.fisher_bounds(truth, t, 3e-4)
    for name in ("period", "amplitude", "phase"):
        assert abs(near.estimates[name].value - far.estimates[name].value) < 0.05 * bounds[name], name


@every_tier
@pytest.mark.parametrize("per_period", [8.0, 8.37, 1000.0])
def test_few_and_many_samples_a_period(synthetic: ModuleType, accuracy: str, per_period: float) -> None:
    """From 8 to 10,000 samples per period the truth lies within four uncertainties."""
    truth = synthetic.Truth(gamma=0.01)
    t = synthetic.times(7.0 * truth.period, per_period / truth.period)
    result = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 3e-4, 7)), options=options_for(accuracy))
    period = motion_of(result).derived.statistical["period"]
    assert abs(period.value - truth.period) < 4.0 * period.u
    assert abs(result.estimates["amplitude"].value - truth.amplitude) < 4.0 * result.estimates["amplitude"].u


@every_tier
@pytest.mark.parametrize("first", sampled(range(0, 30, 5), 1))
def test_deep_noise_is_no_gross_failure(synthetic: ModuleType, accuracy: str, first: int) -> None:
    """At -10 dB, sigma 2.2 times the amplitude, no period of 30 records is off by more than six bounds."""
    t = synthetic.times(10.0)
    for seed in range(first, first + 5):
        truth = synthetic.Truth(phase=0.2 * seed)
        y = synthetic.noisy(truth, t, math.sqrt(5.0) * truth.amplitude, seed)
        result = analyse(Track.from_arrays(t, y), options=options_for(accuracy))
        bound = synthetic.fisher_bounds(truth, t, math.sqrt(5.0) * truth.amplitude)["period"]
        assert abs(motion_of(result).derived.statistical["period"].value - truth.period) < 6.0 * bound


@every_tier
@pytest.mark.parametrize("seed", sampled(range(4), 1))
@pytest.mark.parametrize("sigma_m", [3e-4, 2.39e-3])
def test_a_record_may_outlast_its_oscillation(synthetic: ModuleType, accuracy: str, sigma_m: float, seed: int) -> None:
    """Where nine tenths of the record are noise alone, period and amplitude still hold their intervals."""
    t = synthetic.times(120.0)
    truth = synthetic.Truth(gamma=0.1, phase=float(seed))
    result = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, sigma_m, seed)), options=options_for(accuracy))
    period, amplitude = motion_of(result).derived.statistical["period"], result.estimates["amplitude"]
    assert abs(period.value - truth.period) < 4.5 * period.u
    assert abs(amplitude.value - truth.amplitude) < 4.5 * amplitude.u


@every_tier
@pytest.mark.parametrize("periods", [1.7, 2.4, 3.4])
def test_a_record_of_few_periods_is_fitted_as_a_damped_sine(accuracy: str, periods: float) -> None:
    """Period, amplitude and damping rate are as certain as by scipy's own fit, and cover the truth."""
    t = np.arange(round(periods * 0.757 * 60)) / 60

    def sine(t: F8, offset: float, amplitude: float, gamma: float, omega: float, phase: float) -> F8:
        return np.asarray(offset + amplitude * np.exp(-gamma * t) * np.cos(omega * t + phase))

    truth = (0.3, 0.05, 0.4, 2.0 * math.pi / 0.757, 0.4)
    for seed in range(4):
        y = sine(t, *truth) + 5e-4 * np.random.default_rng(seed).standard_normal(t.size)
        _, covariance = curve_fit(sine, t, y, truth)
        found = analyse(Track.from_arrays(t, y), options=options_for(accuracy)).estimates
        for name, k in (("amplitude", 1), ("damping_rate", 2), ("angular_frequency", 3)):
            assert found[name].u < 1.5 * math.sqrt(covariance[k, k])
            assert abs(found[name].value - truth[k]) < 4.0 * found[name].u


def test_a_stated_law_is_fitted_to_two_periods() -> None:
    """The windows are too few for any law, but the samples determine it."""
    t = np.arange(100) / 60
    y = 0.3 + 0.05 * np.exp(-0.4 * t) * np.cos(8.3 * t) + 5e-4 * np.random.default_rng(1).standard_normal(t.size)
    result = analyse(Track.from_arrays(t, y), options=Options(stated="linear"))
    assert motion_of(result).damping.by_statement
    assert result.estimates["damping_rate"].value == pytest.approx(0.4, abs=0.05)


def test_a_stated_noise_counts_where_the_record_agrees(synthetic: ModuleType) -> None:
    """It draws the noise of a short record towards itself; one that the record contradicts is not used."""
    t = synthetic.times(2.2)
    track = Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, 2))

    def u_offset(stated_m: float | None) -> float:
        scene = Scene() if stated_m is None else Scene.from_mapping({"sensor": {"sigma_m": stated_m}})
        return analyse(track, scene).estimates["offset"].u

    alone = u_offset(None)
    assert u_offset(3.2e-4) > alone * 1.001
    assert u_offset(2.6e-4) < alone * 0.999
    assert u_offset(3e-3) == alone
