"""Velocity and acceleration come without differences, with uncertainties that hold, larger at the ends."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from scipy.signal import savgol_filter

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.errors import AnalysisError
from pipeline.motion.smoother import Params, smooth
from pipeline.track import Quality, Track

F8 = np.ndarray


def velocity_of(truth: object, t: F8) -> F8:
    """Return the truth's velocity by a difference in noise-free arithmetic, good to 1e-9 of itself."""
    h = 1e-5
    return (truth.position(t + h) - truth.position(t - h)) / (2 * h)  # type: ignore[attr-defined, no-any-return]


def acceleration_of(truth: object, t: F8) -> F8:
    """Return the truth's acceleration by a second difference, good to 1e-5 of its greatest value."""
    h = 1e-3
    before, here, after = (truth.position(at) for at in (t - h, t, t + h))  # type: ignore[attr-defined]
    return (before - 2.0 * here + after) / h**2  # type: ignore[no-any-return]


def analysed(synthetic: ModuleType, seconds: float, sigma_m: float, seed: int = 1, **truth: float) -> Analysis:
    """Return the analysis of a run of linear drag."""
    t = synthetic.times(seconds)
    y = synthetic.noisy(synthetic.Truth(**({"gamma": 0.01463} | truth)), t, sigma_m, seed)
    return analyse(Track.from_arrays(t, y))


def rms(values: F8) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(("seconds", "sigma_m", "share"), [(10.0, 3e-4, 0.0012), (120.0, 2.39e-3, 0.005)])
def test_velocity_beats_differences_and_polynomials(
    synthetic: ModuleType, seconds: float, sigma_m: float, share: float
) -> None:
    """The error is 0.12 to 0.5 % of the velocity where the gradient errs by 8 to 110 % and Savitzky-Golay by 1 to 5."""
    truth, t = synthetic.Truth(gamma=0.01463), synthetic.times(seconds)
    result = analysed(synthetic, seconds, sigma_m)
    true = velocity_of(truth, t)
    error = rms(result.smoothed().velocity - true) / rms(true)
    assert error <= share
    assert error <= rms(savgol_filter(result.track.y, 61, 5, deriv=1, delta=0.01) - true) / rms(true) / 8
    assert error <= rms(np.gradient(result.track.y, 0.01) - true) / rms(true) / 50


def test_intervals_of_velocity_and_acceleration_hold_the_truth(synthetic: ModuleType) -> None:
    """Over 60 runs of three laws 68 and 95 % intervals of all three hold, at the ends as often as they state."""
    t, inside = synthetic.times(10.0), []
    for seed in range(60):
        phase = float(np.random.default_rng((seed, 1)).uniform(-3.0, 3.0))
        # Ten seconds do not tell these laws apart: of one record in three another one is selected.
        law = ({"gamma": 0.01463}, {"beta": 0.01463 / 0.05}, {"mu": 0.01463 * 0.05})[seed % 3]
        truth = synthetic.Truth(phase=phase, **law)
        found = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 3e-4, seed))).smoothed()
        x, v, a = truth.position(t), velocity_of(truth, t), acceleration_of(truth, t)
        pulls = np.abs(
            [
                (found.position - x) / found.u_position,
                (found.velocity - v) / found.u_velocity,
                (found.acceleration - a) / found.u_acceleration,
            ]
        )
        ends = pulls[:, [*range(40), *range(-40, 0)]]
        inside.append([np.mean(part <= bound) for part in (*pulls, ends) for bound in (1.0, 1.96)])
    # Samples of one run err together, so shares scatter from run to run.
    shares, scatter = np.mean(inside, axis=0), np.std(inside, axis=0) / np.sqrt(len(inside))
    # Inside the record, too, what laws differ by counts, and makes intervals wide there.
    low, high = np.array([0.66, 0.94] * 4), np.array([0.80, 0.985] * 3 + [0.74, 0.96])
    assert np.all(shares >= low - 3.0 * scatter), shares
    assert np.all(shares <= high + 3.0 * scatter), shares


def test_ends_carry_the_larger_uncertainty(synthetic: ModuleType) -> None:
    """The velocity's variance at either end is two to six times that of the middle."""
    u = analysed(synthetic, 20.0, 3e-4).smoothed().u_velocity ** 2
    middle = float(np.mean(u[950:1050]))
    for end in (u[:76], u[-76:]):
        assert 2.0 < float(np.mean(end)) / middle < 6.0


def test_flagged_samples_are_predicted(synthetic: ModuleType) -> None:
    """Where a second of samples is missing, or a cluster is false, the velocity goes on within its wider interval."""
    truth, t = synthetic.Truth(gamma=0.01463), synthetic.times(20.0)
    y = synthetic.noisy(truth, t, 3e-4, 3)
    y[500:600] = np.nan
    y[1200:1215] += 0.02
    found = analyse(Track.from_arrays(t, y)).smoothed()
    error = found.velocity - velocity_of(truth, t)
    assert np.all(np.isfinite(found.velocity))
    assert np.max(np.abs(error[500:600]) / found.u_velocity[500:600]) < 4.0
    assert np.max(np.abs(error[1200:1215]) / found.u_velocity[1200:1215]) < 4.0


def test_time_may_be_irregular(synthetic: ModuleType) -> None:
    """Jittered times, a duplicate and one unknown are taken as they are; only the unknown one has no velocity."""
    rng = np.random.default_rng(4)
    truth, t = synthetic.Truth(gamma=0.01463), synthetic.times(20.0) + rng.uniform(-0.004, 0.004, 2000)
    y = truth.position(t) + 3e-4 * rng.standard_normal(t.size)
    t[700], t[900] = t[699], np.nan
    found = analyse(Track.from_arrays(t, y, rate_hz=100.0)).smoothed()
    known = np.isfinite(t)
    error = found.velocity[known] - velocity_of(truth, t[known])
    assert np.isnan(found.velocity[900])
    assert np.isnan(found.u_velocity[900])
    assert rms(error) < 0.0015 * rms(velocity_of(truth, t[known]))


def test_intervals_hold_in_correlated_noise(synthetic: ModuleType) -> None:
    """In noise of a correlation of ten samples intervals of the velocity still hold the truth nearly so often."""
    t, inside = synthetic.times(20.0), []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        white = np.fft.rfft(rng.standard_normal(2 * t.size))
        response = np.sqrt(1.0 - 0.81) / (1.0 - 0.9 * np.exp(-2j * np.pi * np.fft.rfftfreq(2 * t.size)))
        truth = synthetic.Truth(gamma=0.01463, phase=rng.uniform(-3.0, 3.0))
        y = truth.position(t) + 3e-4 * np.fft.irfft(white * response)[: t.size]
        found = analyse(Track.from_arrays(t, y)).smoothed()
        pulls = np.abs(found.velocity - velocity_of(truth, t)) / found.u_velocity
        inside.append([np.mean(pulls <= 1.0), np.mean(pulls <= 1.96)])
    assert np.mean(inside, axis=0)[0] > 0.58
    assert np.mean(inside, axis=0)[1] > 0.88


def driven(synthetic: ModuleType, seconds: float, kick: float, seed: int) -> tuple[F8, F8, F8]:
    """Return times, positions and velocities of an oscillator that white force noise kicks at every sample."""
    truth, t = synthetic.Truth(gamma=0.01463), synthetic.times(seconds)
    turn = np.exp(1j * truth.omega * t)
    walk = np.cumsum(-1j * np.conj(turn) * kick * np.random.default_rng(seed).standard_normal(t.size)) * turn
    return t, truth.position(t) + walk.real, velocity_of(truth, t) - truth.omega * walk.imag


def test_memory_shortens_where_the_motion_wanders(synthetic: ModuleType) -> None:
    """A motion that leaves its law is followed: better than the global fit, with intervals that hold."""
    rng = np.random.default_rng(5)
    inside, ratios = [], []
    for seed in range(10):
        t, x, v = driven(synthetic, 60.0, 5e-6, seed)
        result = analyse(Track.from_arrays(t, x + 3e-4 * rng.standard_normal(t.size)))
        assert isinstance(result.motion, Oscillation)
        found = result.smoothed()
        assert found.memory_s < 10.0
        inside.append(np.mean(np.abs(found.velocity - v) <= found.u_velocity))
        part = np.isfinite(found.velocity)
        assert np.array_equal(part, (result.flags & Quality.OUTSIDE) == 0)
        ratios.append(rms((found.velocity - v)[part]) / rms((result.motion.waveform.velocity - v)[part]))
    assert 0.55 < np.mean(inside) < 0.8
    assert np.mean(ratios) < 0.7


def test_record_that_follows_its_law_remembers_all_of_it(synthetic: ModuleType) -> None:
    """Without any force the likeliest memory mostly exceeds the record, and the velocity is the global fit's."""
    memories = []
    for seed in range(7):
        result = analysed(synthetic, 60.0, 3e-4, seed)
        assert isinstance(result.motion, Oscillation)
        found = result.smoothed()
        memories.append(found.memory_s)
        assert rms(found.velocity - result.motion.waveform.velocity) < 0.0015 * rms(found.velocity)
        assert found.noise_m == pytest.approx(3e-4, rel=0.05)
    assert np.median(memories) > 60.0


def test_long_records_have_nodes_further_apart(synthetic: ModuleType) -> None:
    """Fewer nodes than four a period give nearly the same velocity."""
    result = analysed(synthetic, 60.0, 3e-4)
    motion = result.motion
    assert isinstance(motion, Oscillation)
    few = smooth(result.track, motion.demodulated, motion.phase, motion.rest, params=Params(most_nodes=60))
    many = result.smoothed()
    assert rms(few.velocity - many.velocity) < 0.3 * rms(many.u_velocity)


def test_what_does_not_oscillate_has_no_velocity(synthetic: ModuleType) -> None:
    """A still bob, and a record whose every sample is flagged, are refused in one line."""
    still = analyse(Track.from_arrays(synthetic.times(10.0), np.full(1000, 0.2)))
    with pytest.raises(AnalysisError, match="no oscillation to smooth"):
        still.smoothed()
    result = analysed(synthetic, 10.0, 3e-4)
    motion = result.motion
    assert isinstance(motion, Oscillation)
    spoilt = replace(motion.demodulated, flags=np.full(1000, 2, np.uint8))
    with pytest.raises(AnalysisError, match="eight usable samples"):
        smooth(result.track, spoilt, motion.phase, motion.rest)
