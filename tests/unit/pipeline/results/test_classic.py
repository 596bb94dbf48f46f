"""The report's method is reproduced to the digit, bias and all, against plain numpy and scipy."""

import math

import numpy as np
import pytest
from scipy.optimize import curve_fit

from pipeline.errors import AnalysisError
from pipeline.results.classic import classic
from pipeline.track import F8, Track
from tests import synthetic


def naive_period(t: F8, y: F8) -> float:
    """Time from the first sampled maximum to the seventh after it, over seven, one swing above the middle a maximum."""
    above = np.flatnonzero(y > (y.max() + y.min()) / 2)
    swings = np.split(above, np.flatnonzero(np.diff(above) > 1) + 1)
    crests: list[float] = []
    for swing in swings:
        crest = t[swing[np.argmax(y[swing])]]
        if swing[0] > 0 and (not crests or crest - crests[-1] > 0.2):
            crests.append(crest)
    return (crests[7] - crests[0]) / 7


def record(seconds: float, sigma_m: float, seed: int, **truth: float) -> Track:
    """Return a synthetic track."""
    t = synthetic.times(seconds)
    return Track.from_arrays(t, synthetic.noisy(synthetic.Truth(**truth), t, sigma_m, seed))


@pytest.mark.parametrize(("sigma_m", "seed"), [(0.0, 1), (3e-4, 2), (2.39e-3, 3)])
def test_period_and_amplitude_are_the_naive_ones(sigma_m: float, seed: int) -> None:
    """Period, amplitude and sliding amplitude equal what plain numpy gives."""
    track = record(10.0, sigma_m, seed, gamma=0.005)
    found = classic(track)
    t, y = track.t, track.y
    assert found.estimates["period"].value == pytest.approx(naive_period(t, y), abs=1e-12)
    assert found.estimates["amplitude"].value == pytest.approx((max(y) - min(y)) / 2, abs=1e-15)
    # Half the range of the samples in 1.5 s, from every sample with so many behind it.
    starts = t[t + 1.5 <= t[-1] + 1e-9]
    amplitudes = [np.ptp(y[(t >= start) & (t <= start + 1.5 + 1e-9)]) / 2 for start in starts]
    np.testing.assert_allclose(found.window_t, starts, atol=1e-12)
    np.testing.assert_allclose(found.window_amplitude, amplitudes, atol=1e-15)


def test_exponential_is_scipys_with_the_start_fixed() -> None:
    """Gamma and its formal uncertainty are curve_fit's for A0 e^(-gamma t), A0 held at the first amplitude."""
    found = classic(record(60.0, 2.39e-3, 5, gamma=0.01463))
    t, amplitude = found.window_t - found.window_t[0], found.window_amplitude
    start = amplitude[0]
    (gamma,), covariance = curve_fit(
        lambda x, g: start * np.exp(-g * x), t, amplitude, p0=[0.01], xtol=1e-14, ftol=1e-14
    )
    assert found.estimates["damping_rate"].value == pytest.approx(gamma, rel=1e-7)
    assert found.estimates["damping_rate"].u == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-5)
    residual = (amplitude - start * np.exp(-gamma * t)) / 0.00239
    assert found.chi2 == pytest.approx(float(residual @ residual), rel=1e-6)


@pytest.mark.parametrize(("sigma_m", "bias_m"), [(3e-4, 0.56e-3), (2.39e-3, 5.4e-3)])
def test_amplitude_is_biased_outward(sigma_m: float, bias_m: float) -> None:
    """Extremes of noisy samples lie outside the motion, by as much as the docstring says."""
    bias = [classic(record(10.0, sigma_m, s)).estimates["amplitude"].value - 0.05 for s in range(40)]
    assert np.mean(bias) == pytest.approx(bias_m, rel=0.1)


@pytest.mark.parametrize(("seconds", "words"), [(3.0, "8 maxima"), (1.0, "maxima")])
def test_short_record_is_refused_with_what_it_needs(seconds: float, words: str) -> None:
    """Fewer than eight maxima are refused in one line that says how many there were."""
    with pytest.raises(AnalysisError, match=words):
        classic(record(seconds, 3e-4, 9))
