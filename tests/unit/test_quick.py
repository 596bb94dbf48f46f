"""The quick way of the fast tier gives what the standard stages give, and leaves to them what it cannot do."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from pipeline.condition import Params as ConditionParams
from pipeline.condition import condition
from pipeline.cycles import Cycles, find_cycles
from pipeline.cycles import Params as CyclesParams
from pipeline.damping import Params as DampingParams
from pipeline.damping import fit_damping
from pipeline.phase import fit_phase
from pipeline.quick import Quick, demodulate_quickly
from pipeline.quick_models import fit_damping_quickly, fit_phase_quickly, fit_rest_quickly
from pipeline.quick_start import condition_quickly, find_cycles_quickly
from pipeline.rest import fit_rest
from pipeline.track import Quality, Track


def quick(t: np.ndarray, y: np.ndarray) -> Quick | None:
    """Return the windows of a record by one basis, if it can be had."""
    conditioned = condition(Track.from_arrays(t, y))
    cycles = find_cycles(conditioned)
    assert isinstance(cycles, Cycles)
    return demodulate_quickly(conditioned, cycles)


def test_windows_hold_what_their_covariance_says(synthetic: ModuleType) -> None:
    """Over 40 runs with mixed drag and a bending phase pulls of amplitude, phase and offset are standard normal."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3)
    t = synthetic.times(60.0)
    pulls = []
    for seed in range(40):
        found = quick(t, synthetic.noisy(truth, t, 3e-4, seed))
        assert found is not None
        d = found.demodulated
        u = np.sqrt(np.einsum("wii->wi", d.covariance))
        turned = np.angle(np.exp(1j * (d.phase - truth.phase_at(d.t))))
        away = [d.amplitude - truth.amplitude_at(d.t), turned, d.offset - truth.offset]
        pulls.append(np.stack(away, axis=1) / u)
    together = np.concatenate(pulls)
    np.testing.assert_allclose(together.mean(axis=0), 0.0, atol=0.06)
    np.testing.assert_allclose(together.std(axis=0), 1.0, atol=0.04)


def test_motion_at_every_sample(synthetic: ModuleType) -> None:
    """Position and velocity follow the truth from the first sample to the last, past the last whole window too."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3)
    t = synthetic.times(61.3)
    found = quick(t, synthetic.noisy(truth, t, 1e-5, 1))
    assert found is not None
    np.testing.assert_allclose(found.position, truth.position(t), atol=1.5e-4)
    np.testing.assert_allclose(found.position[:5900], truth.position(t)[:5900], atol=2e-5)
    step = 1e-4
    true = (truth.position(t + step) - truth.position(t - step)) / (2.0 * step)
    np.testing.assert_allclose(found.velocity, true, atol=2e-3 * np.max(np.abs(true)))


@pytest.mark.parametrize("shift_m", [0.003, 0.01, 0.03])
def test_clusters_and_flagged_samples_are_let_go(synthetic: ModuleType, shift_m: float) -> None:
    """False echoes on a quarter of every fourth period are flagged; amplitude and rest stay right."""
    truth = synthetic.Truth(gamma=0.005)
    t = synthetic.times(60.0)
    turn = truth.phase_at(t) / (2.0 * np.pi)
    false = (np.floor(turn) % 4 == 0) & (np.abs(turn % 1.0 - 0.5) < 0.12)
    y = synthetic.noisy(truth, t, 2e-4, 2)
    y[false] += shift_m
    y[500:503] = np.nan
    found = quick(t, y)
    assert found is not None
    d = found.demodulated
    flagged = (d.flags & np.uint8(Quality.FALSE_ECHO)) > 0
    assert np.mean(flagged[false]) > 0.98
    before = condition(Track.from_arrays(t, y)).flags != 0
    assert np.count_nonzero(flagged & ~false & ~before) <= 2
    u = np.sqrt(np.einsum("wii->wi", d.covariance))
    assert np.mean(np.abs(d.amplitude - truth.amplitude_at(d.t)) < 3.0 * u[:, 0]) > 0.97
    assert np.mean(np.abs(d.offset - truth.offset) < 3.0 * u[:, 2]) > 0.97


@pytest.mark.parametrize("what", ["jitter", "clipped", "short", "tail", "clusters"])
def test_what_it_cannot_do_it_leaves(synthetic: ModuleType, what: str) -> None:
    """Jittered times, clipped crests, few periods, windows without a signal and clusters in each are not taken."""
    truth = synthetic.Truth(gamma=0.2 if what == "tail" else 0.01)
    t = synthetic.times(3.0 if what == "short" else 60.0)
    if what == "jitter":
        t = t + 1e-3 * np.random.default_rng(3).uniform(-1.0, 1.0, t.size)
    y = synthetic.noisy(truth, t, 3e-4, 3)
    if what == "clipped":
        y = np.minimum(y, truth.offset + 0.5 * truth.amplitude)
    if what == "clusters":
        y[np.abs(truth.phase_at(t) / (2.0 * np.pi) % 1.0 - 0.5) < 0.1] += 0.006
    assert quick(t, y) is None


@pytest.mark.parametrize("dirt", ["none", "spike", "missing", "clipped", "saturated", "repeated"])
def test_conditioning_sees_the_same_dirt(synthetic: ModuleType, dirt: str) -> None:
    """The quick sweep flags what the full one flags; the noise agrees within 5 %."""
    truth = synthetic.Truth(gamma=0.003)
    t = synthetic.times(60.0)
    y = synthetic.noisy(truth, t, 3e-4, 4)
    top = truth.offset + 0.8 * truth.amplitude
    if dirt == "spike":
        y[777] += 0.01
    elif dirt == "missing":
        y[100:110] = np.nan
    elif dirt == "saturated":
        y = np.minimum(y, top)
    elif dirt == "clipped":
        y = np.minimum(truth.position(t), top) + 3e-4 * np.random.default_rng(5).standard_normal(t.size)
    elif dirt == "repeated":
        t[300] = t[299]
    track = Track.from_arrays(t, y, rate_hz=100.0)
    full, found = condition(track), condition_quickly(track, ConditionParams())
    assert np.any(full.flags) == (dirt != "none")
    np.testing.assert_array_equal(found.flags, full.flags)
    assert found.noise_m == pytest.approx(full.noise_m, rel=0.05)


def test_cycles_on_means_are_the_cycles(synthetic: ModuleType) -> None:
    """Means of neighbours give the frequency to a thousandth and windows of the same length."""
    t = synthetic.times(120.0)
    conditioned = condition(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, 6)))
    found, full = find_cycles_quickly(conditioned, CyclesParams()), find_cycles(conditioned)
    assert isinstance(found, Cycles)
    assert isinstance(full, Cycles)
    assert found.frequency_hz == pytest.approx(full.frequency_hz, rel=1e-3)
    assert abs(found.bounds.size - full.bounds.size) <= 1


@pytest.mark.parametrize(("gamma", "beta"), [(0.01463, 0.0), (0.0, 0.3), (0.0065, 0.2)])
def test_models_agree_with_the_stages(synthetic: ModuleType, gamma: float, beta: float) -> None:
    """On clean records law, frequency and rest are those of the full stages, to a twentieth of their uncertainties."""
    truth = synthetic.Truth(gamma=gamma, beta=beta)
    t = synthetic.times(120.0)
    agreed = 0
    for seed in range(5):
        found = quick(t, synthetic.noisy(truth, t, 3e-4, seed))
        assert found is not None
        d = found.demodulated
        laws = DampingParams(laws=("none", "linear", "quadratic", "linear+quadratic"))
        damping, phase, rest = fit_damping_quickly(d, 0.0, laws), None, fit_rest_quickly(d)
        if damping is not None:
            phase = fit_phase_quickly(d, damping)
        if damping is None or phase is None or rest is None:
            continue
        agreed += 1
        full = fit_damping(d, 0.0, laws)
        assert damping.selected == full.selected
        for name in damping.admissible:
            for parameter, theirs in full.fits[name].joint.estimates().items():
                mine = damping.fits[name].joint[parameter]
                assert abs(mine.value - theirs.value) < 0.05 * theirs.u, (name, parameter)
                assert mine.u == pytest.approx(theirs.u, rel=0.15)
        other = fit_phase(d, full)
        assert abs(phase.angular_frequency.value - other.angular_frequency.value) < 0.05 * other.angular_frequency.u
        assert abs(rest.mean.value - fit_rest(d).mean.value) < 0.05 * rest.mean.u
    assert agreed >= 3


def test_what_is_not_smooth_needs_the_stages(synthetic: ModuleType) -> None:
    """A beat, a bending phase and a drifting rest position are left to the full stages."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3)
    t = synthetic.times(120.0)
    y = synthetic.noisy(truth, t, 1e-4, 7) + 5e-4 * np.cos(7.9 * t) + 3e-3 * t / 120.0
    found = quick(t, y)
    assert found is not None
    d = found.demodulated
    laws = DampingParams(laws=("none", "linear", "quadratic", "linear+quadratic"))
    assert fit_damping_quickly(d, 0.0, laws) is None
    assert fit_phase_quickly(d, fit_damping(d, 0.0, laws)) is None
    assert fit_rest_quickly(d) is None
