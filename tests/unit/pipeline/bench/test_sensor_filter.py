"""What a sensor's filter does to an oscillation, against scipy's filters, and that analyses undo it."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import freqz, lfilter

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.bench.sensor_filter import SensorFilter
from pipeline.track import Track

OMEGA, STEP = 8.3, 0.01
BEFORE = 400  # samples by which a filter's memory is full
SIGNAL = complex(-0.012, OMEGA)


def filter_of(**sensor: Any) -> SensorFilter:
    """Return the filter of a scene."""
    found = SensorFilter.of(Scene.from_mapping({"sensor": sensor}), 1.0 / STEP)
    assert found is not None
    return found


@pytest.mark.parametrize("n", [2, 9])
def test_a_running_mean_has_the_response_of_its_coefficients(n: int) -> None:
    """Size and delay are those that freqz gives for n equal coefficients."""
    _, (response,) = freqz(np.ones(n) / n, 1.0, [OMEGA * STEP])
    found = filter_of(mean_samples=n)
    assert found.gain(OMEGA) == pytest.approx(abs(response), rel=1e-12)
    assert found.delay(OMEGA) == pytest.approx(-np.angle(response), abs=1e-12)


def recorded(kind: str, size: float, seed: int = 1) -> NDArray[np.float64]:
    """Return a minute of a bob of 50 mm behind a sensor that smooths what it measures, noise included."""
    rng = np.random.default_rng(seed)
    t = np.arange(-BEFORE, 6000) * STEP
    noise = 3e-4 * rng.standard_normal(t.size)
    y = 0.3 + np.real(0.05 * np.exp(1j + SIGNAL * t))
    if kind == "mean_samples":
        y = lfilter(np.ones(int(size)) / size, 1.0, y + noise)
    else:  # an exact lag of the motion, and one of the samples' noise
        fall = math.exp(-STEP / size)
        y = 0.3 + np.real(0.05 * np.exp(1j + SIGNAL * t) / (1.0 + SIGNAL * size))
        y = y + lfilter([1.0 - fall], [1.0, -fall], noise)
    return np.asarray(y[BEFORE:])


def analysed(y: NDArray[np.float64], **sensor: Any) -> Analysis:
    """Return the analysis in a scene that states the sensor alone."""
    return analyse(Track.from_arrays(np.arange(y.size) * STEP, y), Scene.from_mapping({"sensor": sensor}))


@pytest.mark.parametrize(("kind", "size"), [("mean_samples", 9), ("lag_s", 0.1)])
def test_a_stated_filter_is_undone(kind: str, size: float) -> None:
    """Amplitude and phase are the bob's within 3 u where the scene states the filter, with its u in their budgets."""
    u = 0.02 * size
    found = analysed(recorded(kind, size), **{kind: {"value": size, "u": u}})
    assert "smoothed_sensor" not in {finding.code for finding in found.findings}
    amplitude, phase = found.estimates["amplitude"], found.estimates["phase"]
    assert abs(amplitude.value - 0.05) < 3.0 * amplitude.u
    assert abs(phase.value - 1.0) < 3.0 * phase.u
    assert amplitude.u < 7e-4
    inputs = {one.name: one.u for one in found.budgets["phase"].contributions}
    name = "sensor_lag" if kind == "lag_s" else f"sensor_{kind}"
    late = filter_of(**{kind: size * 1.001}).delay(OMEGA) - filter_of(**{kind: size * 0.999}).delay(OMEGA)
    assert abs(inputs[name]) == pytest.approx(late / 0.002 / size * u, rel=1e-3)
