"""Each tier keeps its promises: findings on dirty records, the same answer at any origin and scale, deep noise."""

import math

import numpy as np
import pytest
from scipy.optimize import curve_fit

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.options import TIERS, Options, options_for
from pipeline.track import F8, Track
from tests import synthetic

every_tier = pytest.mark.parametrize("accuracy", TIERS)


@every_tier
def test_the_origin_of_time_does_not_matter(accuracy: str) -> None:
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
    assert result.damping.by_statement
    assert result.estimates["damping_rate"].value == pytest.approx(0.4, abs=0.05)


def test_a_stated_noise_counts_where_the_record_agrees() -> None:
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
