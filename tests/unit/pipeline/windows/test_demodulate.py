"""Windows give amplitude, phase and rest with the covariance they have, whatever lies among the samples."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.errors import AnalysisError
from pipeline.samples.condition import condition
from pipeline.track import Quality, Track
from pipeline.windows.cycles import Cycles, find_cycles
from pipeline.windows.demodulate import Demodulated, demodulate


def demodulated(t: np.ndarray, y: np.ndarray, *, rate_hz: float | None = None) -> Demodulated:
    """Return the windows of a record that oscillates."""
    conditioned = condition(Track.from_arrays(t, y, rate_hz=rate_hz))
    cycles = find_cycles(conditioned)
    assert isinstance(cycles, Cycles)
    return demodulate(conditioned, cycles)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Return angles in (-pi, pi]."""
    return np.angle(np.exp(1j * angle))


def pulls(found: Demodulated, truth: object) -> np.ndarray:
    """Return (w, 3): errors of amplitude, phase and offset over their standard uncertainties."""
    u = np.sqrt(np.einsum("wii->wi", found.covariance))
    errors = np.stack(
        [
            found.amplitude - truth.amplitude_at(found.t),  # type: ignore[attr-defined]
            wrapped(found.phase - truth.phase_at(found.t)),  # type: ignore[attr-defined]
            found.offset - truth.offset,  # type: ignore[attr-defined]
        ],
        axis=1,
    )
    return np.asarray(errors / u)


def echoes(found: Demodulated) -> np.ndarray:
    """Return which samples ended as false echoes."""
    return np.asarray((found.flags & np.uint8(Quality.FALSE_ECHO)) > 0)


def test_clean_motion_comes_back(synthetic: ModuleType) -> None:
    """Without noise amplitude, phase and rest of a drag-damped run are right to a part in ten thousand."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2)
    t = synthetic.times(60)
    found = demodulated(t, truth.position(t))
    assert found.lost == 0
    np.testing.assert_allclose(found.amplitude, truth.amplitude_at(found.t), rtol=1e-4)
    np.testing.assert_allclose(wrapped(found.phase - truth.phase_at(found.t)), 0.0, atol=1e-4)
    np.testing.assert_allclose(found.offset, truth.offset, atol=5e-6)
    assert found.angular_frequency == pytest.approx(truth.omega, rel=1e-5)


@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 2.4])
def test_frequency_that_bends_biases_nothing(synthetic: ModuleType, phase: float) -> None:
    """Where the frequency rises by 0.13 % as the amplitude falls, the first windows stay right to a part in 1e4."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3, phase=phase)
    t = synthetic.times(120)
    errors = []
    for seed in range(12):
        found = demodulated(t, synthetic.noisy(truth, t, 1e-4, seed))
        relative = found.amplitude / truth.amplitude_at(found.t) - 1.0
        errors.append([np.mean(relative[:10]), np.mean(wrapped(found.phase - truth.phase_at(found.t))[:10])])
    # The mean of 120 windows scatters by 3e-5 of the amplitude and 3e-5 rad.
    np.testing.assert_allclose(np.mean(errors, axis=0), 0.0, atol=1e-4)


@pytest.mark.parametrize("sigma_m", [3e-4, 2.39e-3])
def test_covariance_is_what_two_hundred_runs_scatter(synthetic: ModuleType, sigma_m: float) -> None:
    """Over 200 seeds variances, correlations and pulls agree with the stated covariance."""
    truth = synthetic.Truth(gamma=0.01463)
    t = synthetic.times(8)
    found = [demodulated(t, synthetic.noisy(truth, t, sigma_m, seed)) for seed in range(200)]
    all_pulls = np.concatenate([pulls(f, truth) for f in found])
    assert len(all_pulls) >= 200 * 9
    np.testing.assert_allclose(np.std(all_pulls, axis=0), 1.0, atol=0.06)
    np.testing.assert_allclose(np.mean(all_pulls, axis=0), 0.0, atol=0.08)
    np.testing.assert_allclose(np.mean(np.abs(all_pulls) <= 1.0, axis=0), 0.683, atol=0.04)
    np.testing.assert_allclose(np.mean(np.abs(all_pulls) <= 1.96, axis=0), 0.95, atol=0.02)
    # In every window alike; windows differ in their samples by one, so pulls are compared.
    scaled = all_pulls - all_pulls.mean(axis=0)
    stated = np.mean([f.covariance / _outer_root(f.covariance) for f in found], axis=(0, 1))
    measured = np.corrcoef(scaled.T)
    np.testing.assert_allclose(measured, stated, atol=0.08)


def _outer_root(covariance: np.ndarray) -> np.ndarray:
    """Return (w, 3, 3): products of standard uncertainties."""
    u = np.sqrt(np.einsum("wii->wi", covariance))
    return u[:, :, None] * u[:, None, :]


def test_windows_are_independent(synthetic: ModuleType) -> None:
    """Errors of neighbouring windows are not correlated."""
    truth = synthetic.Truth()
    t = synthetic.times(12)
    together = [pulls(demodulated(t, synthetic.noisy(truth, t, 3e-4, s)), truth) for s in range(60)]
    for k in range(3):
        left = np.concatenate([p[:-1, k] for p in together])
        right = np.concatenate([p[1:, k] for p in together])
        assert abs(np.corrcoef(left, right)[0, 1]) < 0.12


def test_noise_of_each_window(synthetic: ModuleType) -> None:
    """Noise is measured window by window and in the whole."""
    t = synthetic.times(60)
    found = demodulated(t, synthetic.noisy(synthetic.Truth(), t, 1e-3, 7))
    assert found.noise_m == pytest.approx(1e-3, rel=0.03)
    np.testing.assert_allclose(found.noise, 1e-3, rtol=0.4)
    used = ~echoes(found)
    assert np.nanstd(found.residual[used]) == pytest.approx(1e-3, rel=0.04)
    assert np.isfinite(found.residual).all()


@pytest.mark.parametrize("shift_m", [0.005, 0.0075, 0.02, -0.03, 0.5])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.6])
def test_cluster_that_holds_most_of_a_window_is_let_go(synthetic: ModuleType, shift_m: float, share: float) -> None:
    """False echoes on up to 60 % of one window, moving with the bob, are flagged and do not pull its amplitude."""
    truth = synthetic.Truth(gamma=0.005)
    t = synthetic.times(30)
    let_go = []
    for window in range(2, 37, 3):
        y = synthetic.noisy(truth, t, 1e-4, window)
        first = round(window * truth.period * 100) + 6
        cluster = np.arange(first, first + round(share * truth.period * 100))
        y[cluster] += shift_m
        found = demodulated(t, y)
        flagged = echoes(found)
        let_go.append(np.mean(flagged[cluster]) >= 0.95)
        if let_go[-1]:
            assert np.count_nonzero(flagged) - np.count_nonzero(flagged[cluster]) <= 25
            assert np.max(np.abs(pulls(found, truth))) < 6.0
    assert np.mean(let_go) >= 0.9


@pytest.mark.parametrize("sigma_m", [1e-4, 2e-4, 1e-3])
def test_cluster_that_is_not_let_go_does_not_reach_the_result(synthetic: ModuleType, sigma_m: float) -> None:
    """Where noise hides that 60 % of a window are shifted by 4 mm, amplitude and period still hold their intervals."""
    truth = synthetic.Truth(gamma=0.005)
    t = synthetic.times(30)
    for window in range(2, 37, 5):
        y = synthetic.noisy(truth, t, sigma_m, window)
        first = round(window * truth.period * 100) + 6
        y[first : first + 45] += 0.004
        result = analyse(Track.from_arrays(t, y))
        assert abs(result.estimates["amplitude"].value - truth.amplitude) < 3.5 * result.estimates["amplitude"].u
        assert abs(result.estimates["period"].value - truth.period) < 3.5 * result.estimates["period"].u


def test_clusters_all_over_the_record_are_let_go(synthetic: ModuleType) -> None:
    """Clusters of 15 samples about the near turning point in every third period are flagged and bias nothing."""
    truth = synthetic.Truth(gamma=0.005, phase=0.0)
    t = synthetic.times(60)
    y = synthetic.noisy(truth, t, 2e-4, 9)
    shifted = np.zeros(t.size, bool)
    for k in range(1, 78, 3):
        middle = round((k + 0.5) * truth.period * 100)
        shifted[middle - 7 : middle + 8] = True
    y[shifted] += 0.005
    found = demodulated(t, y)
    assert np.mean(echoes(found)[shifted]) >= 0.99
    assert np.mean(echoes(found)[~shifted]) <= 0.01
    assert abs(np.mean(found.amplitude - truth.amplitude_at(found.t))) < 1e-5
    assert np.mean(np.abs(pulls(found, truth)) <= 1.96) > 0.9


@pytest.mark.parametrize("shift_m", [0.003, 0.01, 0.05])
@pytest.mark.parametrize("count", [6, 9, 12, 15])
@pytest.mark.parametrize("locked", [True, False])
def test_cluster_in_every_period_is_let_go(synthetic: ModuleType, count: int, shift_m: float, locked: bool) -> None:
    """False echoes on up to a fifth of every window, at one phase or wandering, are flagged and bias nothing."""
    truth = synthetic.Truth(gamma=0.01463)
    t = synthetic.times(60)
    turn = ((truth.phase_at(t) + 0.3) / (2 * np.pi)) % 1.0 if locked else (np.arange(t.size) % 76) / 76
    false = turn < count / 76
    found = demodulated(t, synthetic.noisy(truth, t, 1e-4, 1) + shift_m * false)
    assert np.mean(echoes(found)[false]) >= 0.98
    assert np.mean(np.abs(pulls(found, truth)) <= 3.0) > 0.97


def test_clipped_crest_leaves_the_rest_of_the_cycle(synthetic: ModuleType) -> None:
    """With a quarter of each cycle cut off the amplitude is still the whole motion's."""
    truth = synthetic.Truth(gamma=0.003)
    t = synthetic.times(20)
    y = np.minimum(truth.position(t), truth.offset + 0.7 * truth.amplitude)
    y += 1e-4 * np.random.default_rng(10).standard_normal(t.size)
    found = demodulated(t, y)
    assert abs(np.mean(found.amplitude / truth.amplitude_at(found.t)) - 1.0) < 5e-4
    assert np.mean(np.abs(pulls(found, truth)) <= 3.0) > 0.97


@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 2.4])
def test_a_rest_position_that_creeps_moves_no_amplitude(synthetic: ModuleType, phase: float) -> None:
    """Of 20 mm within seconds, by which windows of a constant rest had amplitudes wrong by 0.6 mm, none is left."""
    truth = synthetic.Truth(gamma=0.0065, phase=phase)
    t = synthetic.times(60)
    y = synthetic.noisy(truth, t, 2e-4, 14)
    still, creeping = demodulated(t, y), demodulated(t, y + 0.02 * (1.0 - np.exp(-t / 8.0)))
    u = np.sqrt(still.covariance[:, 0, 0])
    assert np.max(np.abs(creeping.amplitude - still.amplitude) / u) < 2.0
    assert abs(np.mean((creeping.amplitude - still.amplitude)[:10] / u[:10])) < 0.3
    np.testing.assert_allclose(wrapped(creeping.phase - still.phase), 0.0, atol=2.0 * np.max(u) / truth.amplitude)
    np.testing.assert_allclose(creeping.offset - still.offset, 0.02 * (1.0 - np.exp(-still.t / 8.0)), atol=2e-4)


def test_a_rest_position_that_stays_changes_nothing(synthetic: ModuleType) -> None:
    """A drift that moves amplitudes by less than a tenth of their uncertainty is left to the windows' constants."""
    truth = synthetic.Truth(gamma=0.0065)
    t = synthetic.times(60)
    y = synthetic.noisy(truth, t, 2e-4, 15)
    still, drifting = demodulated(t, y), demodulated(t, y + 1e-4 * t / 60.0)
    np.testing.assert_allclose(drifting.amplitude, still.amplitude, atol=1e-6)


def test_missing_blocks_cost_their_windows_only(synthetic: ModuleType) -> None:
    """Windows without samples carry no point and are counted; the others are right and in phase."""
    truth = synthetic.Truth(gamma=0.003)
    t = synthetic.times(40)
    y = synthetic.noisy(truth, t, 2e-4, 11)
    y[500:900] = np.nan
    y[2000:2020] = np.nan
    found = demodulated(t, y)
    assert 4 <= found.lost <= 6
    assert found.t.size + found.lost == int(40 / truth.period)
    assert np.max(np.abs(pulls(found, truth))) < 4.5
    assert np.isnan(found.residual[500:900]).all()
    total = found.phase - found.phase[0]
    np.testing.assert_allclose(total, truth.omega * (found.t - found.t[0]), atol=0.02)


def test_jittered_times_are_taken_as_they_are(synthetic: ModuleType) -> None:
    """Sample times that jitter by a third of the step, and are known, do no harm."""
    truth = synthetic.Truth(gamma=0.003)
    rng = np.random.default_rng(12)
    t = synthetic.times(20) + rng.uniform(-3e-3, 3e-3, 2000)
    found = demodulated(t, synthetic.noisy(truth, t, 2e-4, 13), rate_hz=100.0)
    assert np.max(np.abs(pulls(found, truth))) < 4.5
    assert np.count_nonzero(found.flags) <= 4


def test_flags_only_grow(synthetic: ModuleType) -> None:
    """What was flagged before stays flagged, and nothing but false echoes is added."""
    t = synthetic.times(20)
    y = synthetic.noisy(synthetic.Truth(), t, 2e-4, 14)
    y[[100, 900]] = np.nan
    y[400:410] += 0.01
    conditioned = condition(Track.from_arrays(t, y))
    cycles = find_cycles(conditioned)
    assert isinstance(cycles, Cycles)
    found = demodulate(conditioned, cycles)
    added = found.flags & ~conditioned.flags
    assert np.array_equal(found.flags & conditioned.flags, conditioned.flags)
    assert set(np.unique(added)) <= {0, Quality.FALSE_ECHO}
    assert found.flags[400:410].all()


def test_hardly_any_good_sample_is_flagged(synthetic: ModuleType) -> None:
    """Of normal noise fewer than one sample in a thousand is taken for a false echo."""
    t = synthetic.times(60)
    share = [np.mean(echoes(demodulated(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, s)))) for s in range(5)]
    assert float(np.mean(share)) < 1e-3


def test_no_usable_window_is_refused(synthetic: ModuleType) -> None:
    """Where every window lost all but a few samples, that is said."""
    t = synthetic.times(10)
    y = synthetic.noisy(synthetic.Truth(), t, 1e-4, 15)
    conditioned = condition(Track.from_arrays(t, y))
    cycles = find_cycles(conditioned)
    assert isinstance(cycles, Cycles)
    sparse = y.copy()
    sparse[np.arange(t.size) % 25 > 0] = np.nan
    with pytest.raises(AnalysisError, match="no period of the record holds enough usable samples"):
        demodulate(condition(Track.from_arrays(t, sparse)), cycles)
