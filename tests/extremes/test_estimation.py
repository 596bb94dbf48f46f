"""Bad and extreme records: a finding or a one-line error, never a confident wrong number."""

import math

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.options import TIERS, options_for
from pipeline.track import Track
from tests.sampling import sampled

F8 = np.ndarray
T = np.arange(2000) / 100
PERIOD = 2 * math.pi / 8.3
AMPLITUDE = 0.05


def swing(seed: int = 3, sigma_m: float = 3e-4) -> F8:
    """Return 20 s of a sound record."""
    noise = sigma_m * np.random.default_rng(seed).standard_normal(T.size)
    return 0.22 + AMPLITUDE * np.exp(-0.01 * T) * np.cos(8.3 * T) + noise


def every(step: int, value: float) -> F8:
    """Return the record with every so manieth distance replaced."""
    y = swing()
    y[::step] = value
    return y


def noise(size: int = 2000, sigma_m: float = 3e-4) -> F8:
    """Return white noise, m."""
    return sigma_m * np.random.default_rng(5).standard_normal(size)


def outcome(t: F8, y: F8, tier: str, scene: Scene | None = None) -> Analysis | str:
    """Return the analysis, or the one line that refuses the record."""
    try:
        return analyse(Track.from_arrays(t, y, kind="simulated"), scene, options_for(tier))
    except PipelineError as error:
        line = str(error)
        assert line
        assert "\n" not in line
        return line


def is_right(found: Analysis) -> bool:
    """Whether period and amplitude agree with the truth within five of the stated uncertainties."""
    period, amplitude = found.estimates["period"], found.estimates["amplitude"]
    return abs(period.value - PERIOD) <= 5 * period.u and abs(amplitude.value - AMPLITUDE) <= 5 * amplitude.u


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize(
    "y",
    [
        pytest.param(every(7, math.nan), id="NaN"),
        pytest.param(every(7, math.inf), id="infinite"),
        pytest.param(every(9, -math.inf), id="minus infinite"),
        pytest.param(every(50, 0.0), id="zeros"),
        pytest.param(every(50, 10.0), id="ten metres"),
        pytest.param(np.where((T > 3) & (T < 8), math.nan, swing()), id="five seconds missing"),
        pytest.param(np.clip(swing(), 0.19, None), id="clipped below"),
        pytest.param(np.clip(swing(), None, 0.25), id="clipped above"),
    ],
)
def test_damaged_distances_cost_precision_not_truth(tier: str, y: F8) -> None:
    """What cannot be a distance is flagged and counted, and the rest gives the truth within its uncertainty."""
    found = outcome(T, y, tier)
    assert isinstance(found, Analysis), found
    assert is_right(found)
    assert found.quality["used"] < T.size
    assert sum(found.quality.values()) >= T.size


@pytest.mark.parametrize("tier", TIERS)
def test_unsorted_times_are_refused(tier: str) -> None:
    """Rows in random order, backwards, all at one time."""
    order = np.random.default_rng(1).permutation(T.size)
    y = swing()
    for t_s, y_m in ((T[order], y[order]), (T[::-1], y[::-1]), (np.zeros(T.size), y)):
        found = outcome(t_s, y_m, tier)
        assert isinstance(found, str), found.estimates


@pytest.mark.parametrize("tier", sampled(sorted(TIERS, reverse=True), 1))
@pytest.mark.parametrize(
    "y",
    [
        pytest.param(np.where(T < 10, 0.2, 0.3) + noise(), id="step"),
        pytest.param(np.where(T < 10, 0.2, 0.3), id="step without noise"),
        pytest.param(0.22 + noise(), id="white noise"),
        pytest.param(0.22 + np.cumsum(noise()), id="random walk"),
        pytest.param(np.full(T.size, 0.22), id="one value"),
        pytest.param(0.2 + 0.01 * T, id="ramp"),
        pytest.param(0.2 + 0.001 * T**2 + noise(), id="parabola"),
        pytest.param(np.where(np.arange(T.size) == 7, 1.0, 0.22) + noise(), id="one spike"),
        pytest.param(0.2 + 0.05 * np.exp(-T / 3) + noise(), id="creep"),
        pytest.param(0.22 + 0.05 * np.cos(3 * T + 0.4 * T**2) + noise(), id="chirp"),
        pytest.param(np.full(T.size, math.nan), id="nothing"),
    ],
)
def test_what_does_not_oscillate_has_no_period(tier: str, y: F8) -> None:
    """No period is given; the reason stands in a finding of severity error, or in the line that refuses."""
    found = outcome(T, y, tier)
    if isinstance(found, Analysis):
        assert "period" not in found.estimates
        assert found.findings[0].code in {"no_oscillation", "overdamped"}
        assert found.findings[0].severity == "error" or found.findings[0].code == "overdamped"
