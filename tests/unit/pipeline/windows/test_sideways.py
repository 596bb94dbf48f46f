"""A mode beside the main oscillation is found, measured and taken out; a record without one shows none."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.samples.condition import Conditioned, condition
from pipeline.track import Track
from pipeline.windows.cycles import Cycles, find_cycles
from pipeline.windows.demodulate import Demodulated, demodulate
from pipeline.windows.disturbances import separate
from pipeline.windows.modes import Sideways
from pipeline.windows.sideways import Params, find_sideways

F8 = np.ndarray


def stages(t: F8, y: F8) -> tuple[Conditioned, Cycles, Demodulated]:
    """Return the stages that the search stands on."""
    conditioned = condition(Track.from_arrays(t, y))
    cycles = find_cycles(conditioned)
    assert isinstance(cycles, Cycles)
    return conditioned, cycles, demodulate(conditioned, cycles)


def search(t: F8, y: F8, **options: float) -> Sideways:
    """Return what is found beside the main oscillation."""
    conditioned, _, demodulated = stages(t, y)
    return find_sideways(conditioned, demodulated, Params(**options))  # type: ignore[arg-type]


@pytest.mark.parametrize("frequency_hz", [0.8, 0.95, 2.1, 3.3])
@pytest.mark.parametrize("seconds", [20.0, 120.0])
def test_mode_is_measured(synthetic: ModuleType, frequency_hz: float, seconds: float) -> None:
    """Frequency and amplitude of a steady mode are those put in, within their uncertainties."""
    t = synthetic.times(seconds)
    y = synthetic.noisy(synthetic.Truth(gamma=0.01463), t, 3e-4, 1)
    found = search(t, y + 5e-4 * np.cos(2 * np.pi * frequency_hz * t + 1.0))
    (mode,) = (mode for mode in found.modes if mode.kind == "mode")
    assert mode.frequency.value == pytest.approx(frequency_hz, abs=4 * mode.frequency.u)
    assert mode.frequency.u < 0.2 / seconds
    assert mode.amplitude.value == pytest.approx(5e-4, abs=4 * mode.amplitude.u)
    assert abs(mode.decay.value) < 4 * mode.decay.u
    assert mode.false_alarm < 0.005


def test_decay_is_measured(synthetic: ModuleType) -> None:
    """A mode that dies has its rate, and its position follows it down."""
    t = synthetic.times(60.0)
    mode_m = 2e-3 * np.exp(-0.05 * t) * np.cos(2 * np.pi * 0.8 * t)
    found = search(t, synthetic.noisy(synthetic.Truth(gamma=0.01463), t, 1e-4, 1) + mode_m)
    (mode,) = (mode for mode in found.modes if mode.kind == "mode")
    assert mode.decay.value == pytest.approx(0.05, rel=0.3)
    np.testing.assert_allclose(found.position(t)[100:-100], mode_m[100:-100], atol=1.2e-4)


def test_columns_are_what_the_position_is_made_of(synthetic: ModuleType) -> None:
    """A linear fit in the columns leaves the noise where without them it leaves the mode too."""
    t = synthetic.times(30.0)
    truth = synthetic.Truth(gamma=0.01463)
    mode_m = 1e-3 * np.cos(2 * np.pi * 0.8 * t + 0.4)
    found = search(t, synthetic.noisy(truth, t, 1e-4, 1) + mode_m)
    columns = found.columns(t)
    assert columns.shape[0] == t.size
    fitted = columns @ np.linalg.lstsq(columns, mode_m, rcond=None)[0]
    np.testing.assert_allclose(fitted, mode_m, atol=3e-5)
    np.testing.assert_allclose(found.position(t), mode_m, atol=6e-5)


def test_harmonics_and_products_are_told_from_modes(synthetic: ModuleType) -> None:
    """Twice the main phase is a harmonic, main and mode together a product, and neither is a separate mode."""
    t = synthetic.times(60.0)
    truth = synthetic.Truth(gamma=0.005)
    main, swing = truth.phase_at(t), 2 * np.pi * 0.8 * t
    fall = truth.amplitude_at(t) / truth.amplitude
    y = synthetic.noisy(truth, t, 1e-4, 1)
    y += 1e-3 * np.cos(swing) + 3e-4 * fall**2 * np.cos(2 * main + 1.0) + 3e-4 * fall * np.cos(main + swing)
    found = {mode.turns: mode for mode in search(t, y).modes}
    assert {turns: mode.kind for turns, mode in found.items()} == {
        (0, 2): "harmonic",
        (1, 0): "mode",
        (1, 1): "product",
    }
    # An amplitude is the root mean square over the record.
    assert found[0, 2].amplitude.value == pytest.approx(3e-4 * np.sqrt(np.mean(fall**4)), rel=0.05)
    assert found[1, 1].amplitude.value == pytest.approx(3e-4 * np.sqrt(np.mean(fall**2)), rel=0.05)


@pytest.mark.parametrize(
    "law", [{}, {"gamma": 0.01463}, {"beta": 0.3}, {"gamma": 0.0073, "beta": 0.235, "kappa": -4.3}]
)
@pytest.mark.parametrize("seconds", [10.0, 120.0])
def test_clean_record_shows_no_mode(synthetic: ModuleType, law: dict[str, float], seconds: float) -> None:
    """Whatever the damping law, and with a bent frequency, five clean records show nothing."""
    t = synthetic.times(seconds)
    for seed in range(5):
        assert not search(t, synthetic.noisy(synthetic.Truth(**law), t, 3e-4, seed))


def test_short_and_endless_records_are_not_searched(synthetic: ModuleType) -> None:
    """Five periods, or more than may be held in memory, give nothing, and say that nothing was sought."""
    t = synthetic.times(4.0)
    assert search(t, synthetic.noisy(synthetic.Truth(), t, 1e-4, 1)).carrier is None
    t = synthetic.times(30.0)
    y = synthetic.noisy(synthetic.Truth(), t, 1e-4, 1) + 1e-3 * np.cos(5.0 * t)
    assert search(t, y)
    assert search(t, y, most_periods=20).carrier is None
    assert search(t, y, most_periods=20).columns(t).shape == (t.size, 0)


def test_record_without_noise_is_searched_in_peace(synthetic: ModuleType) -> None:
    """A perfect sinusoid has no mode and raises nothing."""
    t = synthetic.times(20.0)
    assert [mode.kind for mode in search(t, synthetic.Truth().position(t)).modes if mode.kind == "mode"] == []


def test_without_takes_out_what_was_found(synthetic: ModuleType) -> None:
    """Distances lose the mode; flags, times and the missing stay as they are."""
    t = synthetic.times(30.0)
    y = synthetic.noisy(synthetic.Truth(gamma=0.01463), t, 1e-4, 1) + 1e-3 * np.cos(5.0 * t)
    y[100:110] = np.nan
    conditioned, _, demodulated = stages(t, y)
    found = find_sideways(conditioned, demodulated)
    cleared = conditioned.less(found.position(t))
    np.testing.assert_array_equal(np.isnan(cleared.track.y), np.isnan(y))
    np.testing.assert_array_equal(cleared.flags, conditioned.flags)
    np.testing.assert_allclose((y - cleared.track.y)[200:], 1e-3 * np.cos(5.0 * t[200:]), atol=6e-5)


def test_amplitudes_scatter_less_without_the_mode(synthetic: ModuleType) -> None:
    """A beat of a millimetre swells the windows' scatter; taken out, the period is as sharp as ever."""
    t = synthetic.times(60.0)
    truth = synthetic.Truth(gamma=0.01463)
    clean = synthetic.noisy(truth, t, 1e-4, 1)
    beating = analyse(Track.from_arrays(t, clean + 1e-3 * np.cos(5.0 * t))).motion
    alone = analyse(Track.from_arrays(t, clean)).motion
    assert isinstance(beating, Oscillation)
    assert isinstance(alone, Oscillation)
    assert beating.disturbances.modelled
    assert beating.derived.statistical["period"].u < 1.3 * alone.derived.statistical["period"].u
    assert beating.waveform.rms_m < 1.05 * alone.waveform.rms_m
    # The fitted position is the whole distance: main oscillation, rest and mode.
    np.testing.assert_allclose(beating.waveform.position - alone.waveform.position, 1e-3 * np.cos(5.0 * t), atol=6e-5)
    known = np.isfinite(beating.waveform.residual)
    whole = beating.waveform.position + beating.waveform.residual
    np.testing.assert_allclose(whole[known], (clean + 1e-3 * np.cos(5.0 * t))[known], atol=1e-12)


def test_mode_that_disturbs_nothing_stays(synthetic: ModuleType) -> None:
    """A faint mode far off in a long record is reported and left in: it moves no estimate by a tenth of its error."""
    t = synthetic.times(120.0)
    y = synthetic.noisy(synthetic.Truth(gamma=0.01463), t, 3e-3, 1) + 7e-4 * np.cos(2 * np.pi * 4.1 * t)
    conditioned, cycles, demodulated = stages(t, y)
    after, disturbances = separate(conditioned, cycles, demodulated)
    assert disturbances.sideways
    assert not disturbances.modelled
    assert not disturbances
    assert after is demodulated
    assert disturbances.columns(t).shape == (t.size, 0)
