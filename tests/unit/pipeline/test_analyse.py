"""The whole line: against another fitter, on what does not oscillate, and on whatever arrays there are."""

import contextlib
import math
from dataclasses import replace

import lmfit
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.analyse import Analysis, analyse
from pipeline.errors import PipelineError
from pipeline.numerics.estimate import Estimate
from pipeline.options import options_for
from pipeline.track import Track
from tests import synthetic
from tests.sampling import sampled


def pull(found: Estimate, truth: float) -> float:
    """Return the error over the standard uncertainty."""
    return (found.value - truth) / found.u


@pytest.mark.parametrize(
    ("accuracy", "near", "alike"), [("fast", 0.5, 0.1), ("standard", 0.5, 0.1), ("best", 0.03, 0.04)]
)
@pytest.mark.parametrize(
    ("seconds", "sigma_m"), sampled([(60.0, 3e-4), (10.0, 2.39e-3), (10.0, 3e-4), (60.0, 2.39e-3)])
)
def test_agrees_with_a_waveform_fit_by_lmfit(
    seconds: float, sigma_m: float, accuracy: str, near: float, alike: float
) -> None:
    """A damped sine fitted by lmfit has the same values within half a u, 0.03 u of the best tier, and the same u."""
    truth = synthetic.Truth(gamma=0.01463)
    t = synthetic.times(seconds)
    y = synthetic.noisy(truth, t, sigma_m, 12)
    model = lmfit.Model(lambda x, c, a, g, w, p: c + a * np.exp(-g * x) * np.cos(w * x + p), independent_vars=["x"])
    other = model.fit(y, x=t, c=truth.offset, a=truth.amplitude, g=truth.gamma, w=truth.omega, p=truth.phase)
    options = replace(options_for(accuracy), laws=("linear",))
    result = analyse(Track.from_arrays(t, y), options=options)
    params = other.params
    omega, u_omega = params["w"].value, params["w"].stderr
    pairs = {
        name: (result.estimates[name], params[x]) for name, x in (("amplitude", "a"), ("phase", "p"), ("offset", "c"))
    }
    pairs["gamma"] = result.damping.fits["linear"].joint["gamma"], params["g"]
    held = {name: (found, x.value, x.stderr) for name, (found, x) in pairs.items()}
    held["period"] = result.derived.statistical["period"], 2 * math.pi / omega, 2 * math.pi / omega**2 * u_omega
    for name, (found, value, u) in held.items():
        assert abs(found.value - value) <= near * u, name
        assert found.u == pytest.approx(u, rel=alike), name


def test_the_rest_position_of_a_step_is_not_stated_too_finely() -> None:
    """Where the distance steps by 50 mm, the mean's uncertainty is of its size; in white noise it is that of a mean."""
    t = np.arange(3000) / 100
    noise = 3e-4 * np.random.default_rng(2).standard_normal(t.size)
    step = analyse(Track.from_arrays(t, 0.3 + 0.05 * (t > 15) + noise)).estimates["offset"]
    white = analyse(Track.from_arrays(t, 0.3 + noise)).estimates["offset"]
    assert 0.01 < step.u < 0.05
    assert white.u == pytest.approx(3e-4 / np.sqrt(t.size), rel=0.1)


def sane(result: Analysis) -> None:
    """Check what holds for every outcome."""
    assert result.flags.shape == result.track.t.shape
    assert result.quality["used"] == np.count_nonzero((result.flags & 0b10111111) == 0)
    for estimate in result.estimates.values():
        assert not estimate.u < 0
    for finding in result.findings:
        assert "\n" not in finding.message
        assert len(finding.message) <= 110, finding.message


SIZES = st.integers(2, 120)
METRES = st.floats(-1e3, 1e3, width=32)
WITH_HOLES = st.one_of(METRES, st.sampled_from([math.nan, math.inf, -math.inf, 0.0]))


@given(st.data())
def test_any_distances_are_analysed_or_refused(data: st.DataObject) -> None:
    """Whatever the distances, the outcome is an analysis or a PipelineError, never a warning or another exception."""
    n = data.draw(SIZES)
    y = data.draw(hnp.arrays(np.float64, n, elements=WITH_HOLES))
    with contextlib.suppress(PipelineError):
        sane(analyse(Track.from_arrays(np.arange(n) / 100, y)))


@given(st.data())
def test_any_times_are_analysed_or_refused(data: st.DataObject) -> None:
    """Whatever the times, sorted or not, repeated or missing, the outcome is an analysis or a PipelineError."""
    n = data.draw(SIZES)
    t = data.draw(hnp.arrays(np.float64, n, elements=st.one_of(st.floats(0, 10, width=32), WITH_HOLES)))
    y = 0.2 + 0.05 * np.cos(0.08 * np.arange(n)) + 1e-4 * np.random.default_rng(n).standard_normal(n)
    with contextlib.suppress(PipelineError):
        sane(analyse(Track.from_arrays(t, y, rate_hz=100.0)))


@given(
    seed=st.integers(0, 2**32 - 1),
    seconds=st.floats(0.1, 15.0),
    omega=st.floats(0.5, 200.0),
    sigma_m=st.sampled_from([0.0, 1e-6, 3e-4, 2.39e-3, 0.05, 0.5]),
    gamma=st.floats(-0.5, 3.0, allow_subnormal=False),
    step_m=st.sampled_from([0.0, 1e-4, 1e-2]),
    holes=st.floats(0.0, 0.9),
    echoes=st.floats(0.0, 0.5),
)
@example(seed=0, seconds=3.0, omega=10.0, sigma_m=0.0, gamma=1.0, step_m=0.01, holes=0.875, echoes=0.25)
@example(seed=0, seconds=3.0, omega=7.0, sigma_m=0.00239, gamma=3.0, step_m=0.01, holes=0.875, echoes=0.0)
@example(seed=0, seconds=3.0, omega=1.0, sigma_m=0.0, gamma=2.0, step_m=0.01, holes=0.875, echoes=0.25)
@example(seed=0, seconds=3.0, omega=1.0, sigma_m=0.0, gamma=1.0, step_m=0.01, holes=0.875, echoes=0.25)
@example(seed=0, seconds=2.0, omega=1.0, sigma_m=0.0, gamma=0.0, step_m=0.0, holes=0.875, echoes=0.25)
@example(seed=0, seconds=5.0, omega=23.0, sigma_m=0.0, gamma=2.0, step_m=0.01, holes=0.0, echoes=0.0)
@example(seed=0, seconds=5.0, omega=18.0, sigma_m=0.0, gamma=1.0, step_m=0.01, holes=0.0625, echoes=0.0)
@example(seed=0, seconds=8.0, omega=8.5, sigma_m=0.0, gamma=1.0, step_m=0.0, holes=0.0, echoes=0.25)
def test_any_oscillation_is_analysed_or_refused(
    seed: int, seconds: float, omega: float, sigma_m: float, gamma: float, step_m: float, holes: float, echoes: float
) -> None:
    """Short, fast, growing, dying, coarse, thinned and riddled records: an analysis or a PipelineError."""
    rng = np.random.default_rng(seed)
    t = synthetic.times(seconds)
    if t.size < 2:
        return
    y = synthetic.noisy(synthetic.Truth(omega=omega, gamma=gamma), t, sigma_m, seed)
    if step_m:
        y = np.round(y / step_m) * step_m
    y[rng.random(t.size) < echoes] += 0.3
    y[rng.random(t.size) < holes] = np.nan
    with contextlib.suppress(PipelineError):
        sane(analyse(replace(Track.from_arrays(t, y), quantum_m=step_m or None)))


@pytest.mark.parametrize("lost", [1, 5])
def test_amplitude_and_phase_are_of_the_first_row_though_an_echo_stands_there(lost: int) -> None:
    """False echoes at the beginning move neither the moment that numbers are stated for nor what they say of it."""
    truth, t = synthetic.Truth(gamma=0.05), synthetic.times(20.0)
    y = synthetic.noisy(truth, t, 3e-4, 3)
    clean = analyse(Track.from_arrays(t + 7.0, y))
    y[:lost] = 1.3
    found = analyse(Track.from_arrays(t + 7.0, y))
    for name in ("amplitude", "phase"):
        one, other = found.estimates[name], clean.estimates[name]
        assert abs(one.value - other.value) < 0.5 * max(one.u, other.u), name


def test_a_still_start_ends_at_the_recordings_own_trigger() -> None:
    """What hangs still before the trigger is left out at that moment."""
    rng, t, trigger_s = np.random.default_rng(5), np.arange(3000) / 100.0, 2.0
    since = np.maximum(t - trigger_s, 0.0)
    y = 0.3 + np.where(t < trigger_s, 0.0, 0.05 * np.exp(-0.012 * since) * np.cos(8.3 * since))
    track = Track.from_arrays(t, y + 3e-4 * rng.standard_normal(t.size))
    result = analyse(replace(track, trigger_s=trigger_s))
    (still,) = (finding for finding in result.findings if finding.code == "at_rest")
    assert still.values["seconds"] == pytest.approx(trigger_s)
    assert result.quality["outside"] == 200
    assert abs(pull(result.estimates["amplitude"], 0.05)) < 4.0
    assert {finding.severity for finding in result.findings} <= {"info"}


def test_a_trigger_in_a_swing_leaves_nothing_out() -> None:
    """A bob that swung before the recording triggers immediately; nothing of its motion is lost for that."""
    t = synthetic.times(20.0)
    track = Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, 3))
    result = analyse(replace(track, trigger_s=2.0))
    assert result.quality["outside"] == 0
    assert not any(finding.code == "at_rest" for finding in result.findings)


@pytest.mark.parametrize("accuracy", ["fast", "standard", "best"])
def test_a_computed_sine_has_no_warning(accuracy: str) -> None:
    """A sine without noise and damping gives no damping, no warning, and its own amplitude."""
    for period, seconds in ((0.790066, 20), (0.757, 60), (1.3, 30)):
        t = synthetic.times(seconds)
        found = analyse(
            Track.from_arrays(t, 0.219 + 0.052 * np.cos(2.0 * np.pi * t / period)), None, options_for(accuracy)
        )
        assert [one.code for one in found.findings if one.severity != "info"] == []
        assert found.damping.selected == "none"
        assert abs(pull(found.estimates["amplitude"], 0.052)) < 4.0
