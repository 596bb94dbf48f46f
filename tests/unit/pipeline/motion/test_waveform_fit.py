"""The full fit reaches the bound, models what it is told to, and says so where it cannot."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from pipeline.accuracy import params_for
from pipeline.analyse import Oscillation, Params, analyse
from pipeline.damping.laws import LAWS
from pipeline.findings.motion import fit_findings
from pipeline.motion.waveform_fit import FullFit, fit_record
from pipeline.motion.waveform_fit import Params as FullParams
from pipeline.motion.waveform_model import Chooser, Record, State
from pipeline.track import Quality, Track


def best(t: np.ndarray, y: np.ndarray) -> tuple[Oscillation, FullFit]:
    """Return the motion and the full fit of a record."""
    result = analyse(Track.from_arrays(t, y), params=params_for("best"))
    assert isinstance(result.motion, Oscillation)
    assert result.motion.full is not None
    return result.motion, result.motion.full


def refit(t: np.ndarray, y: np.ndarray, extra: np.ndarray | None) -> FullFit:
    """Return the full fit from the stages' results, with extra columns."""
    result = analyse(Track.from_arrays(t, y))
    m = result.motion
    assert isinstance(m, Oscillation)
    return fit_record(result.conditioned, m.demodulated, m.damping, m.phase, m.rest, m.waveform, extra=extra)


def test_mixed_drag_and_a_bending_phase_leave_noise_alone(synthetic: ModuleType) -> None:
    """A frequency that falls by 0.13 % with amplitude, and mixed drag, are followed to the last tenth of noise."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3)
    t = synthetic.times(120.0)
    motion, full = best(t, synthetic.noisy(truth, t, 1e-4, 1))
    assert full.converged
    assert motion.waveform.rms_m == pytest.approx(1e-4, rel=0.02)
    assert motion.phase.backbone is not None
    assert abs(motion.phase.backbone.value + 4.3) < 4.0 * motion.phase.backbone.u
    drag = motion.damping.fits["linear+quadratic"].joint
    for name, true in (("A0", 0.05), ("gamma", 0.0065), ("beta", 0.2)):
        assert abs(drag[name].value - true) < 4.0 * drag[name].u, name


def test_a_frequency_that_shifts_with_the_root_of_the_amplitude() -> None:
    """The full fit keeps the power that the windows showed: noise alone is left, velocity and coefficient are right."""
    t = np.arange(12_000) / 100.0
    gamma, kappa, omega = 0.015, -0.23, 8.3
    amplitude = 0.05 * np.exp(-gamma * t)
    angle = omega * t + kappa * np.sqrt(0.05) * 2.0 * (1.0 - np.exp(-0.5 * gamma * t)) / gamma
    y = 0.2 + amplitude * np.cos(angle) + 1e-4 * np.random.default_rng(4).standard_normal(t.size)
    motion, full = best(t, y)
    assert full.converged
    assert full.noise_m == pytest.approx(1e-4, rel=0.03)
    assert motion.phase.exponent == 0.5
    assert motion.phase.backbone is not None
    assert motion.phase.backbone.unit == "rad/(s m^0.5)"
    assert abs(motion.phase.backbone.value - kappa) < 4.0 * motion.phase.backbone.u
    turning = omega + kappa * np.sqrt(amplitude)
    true = -gamma * amplitude * np.cos(angle) - amplitude * turning * np.sin(angle)
    np.testing.assert_allclose(motion.waveform.velocity, true, atol=1e-4)


def test_velocity_is_the_derivative(synthetic: ModuleType) -> None:
    """The waveform's velocity is that of the true motion."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3)
    t = synthetic.times(60.0)
    motion, _ = best(t, synthetic.noisy(truth, t, 1e-4, 2))
    step = 1e-4
    true = (truth.position(t + step) - truth.position(t - step)) / (2.0 * step)
    assert np.max(np.abs(motion.waveform.velocity - true)) < 1e-3 * np.max(np.abs(true))


def test_a_second_mode_is_fitted_along_where_its_columns_are_given(synthetic: ModuleType) -> None:
    """Left out it widens intervals; given as two columns it leaves noise alone and the amplitude at its bound."""
    truth = synthetic.Truth(gamma=0.01)
    t = synthetic.times(60.0)
    beside = 1e-3 * np.cos(7.9 * t + 1.0)
    y = synthetic.noisy(truth, t, 3e-4, 3) + beside
    without = refit(t, y, None)
    within = refit(t, y, np.stack([np.cos(7.9 * t), np.sin(7.9 * t)], axis=1))
    assert without.converged
    assert within.converged
    assert without.waveform.rms_m > 1.5 * within.waveform.rms_m
    assert within.waveform.rms_m == pytest.approx(3e-4, rel=0.03)
    assert without.widening["A0"] > 2.0
    assert within.widening["A0"] < 1.4
    bound = synthetic.fisher_bounds(truth, t, 3e-4)["amplitude"]
    found = within.damping.fits["linear"].joint["A0"]
    assert abs(found.value - truth.amplitude) < 4.0 * bound
    assert found.u < 1.6 * bound


def test_a_clipped_crest_biases_nothing(synthetic: ModuleType) -> None:
    """A sensor that saturates at 0.7 of the amplitude leaves amplitude and offset right on average of 40 runs."""
    t = synthetic.times(20.0)
    pulls = []
    for seed in range(40):
        truth = synthetic.Truth(phase=0.15 * seed)
        y = np.minimum(synthetic.noisy(truth, t, 2.39e-3, seed), truth.offset + 0.7 * truth.amplitude)
        result = analyse(Track.from_arrays(t, y), params=params_for("best"))
        assert np.count_nonzero(result.flags & np.uint8(Quality.CLIPPED)) > 0.2 * t.size
        amplitude, offset = result.estimates["amplitude"], result.estimates["offset"]
        pulls.append([(amplitude.value - truth.amplitude) / amplitude.u, (offset.value - truth.offset) / offset.u])
    # The mean of 40 pulls scatters by 0.16; a plain fit through the plateau is off by a hundred.
    np.testing.assert_allclose(np.mean(pulls, axis=0), 0.0, atol=0.55)
    np.testing.assert_allclose(np.std(pulls, axis=0), 1.0, atol=0.4)


def test_a_drifting_rest_position_is_followed(synthetic: ModuleType) -> None:
    """A rest position that sinks by 5 mm leaves noise alone, and the curve is the drift."""
    truth = synthetic.Truth(gamma=0.005)
    t = synthetic.times(60.0)
    drift = 5e-3 * (t / 60.0) ** 2
    motion, _ = best(t, synthetic.noisy(truth, t, 3e-4, 4) + drift)
    assert motion.rest.drifts
    assert motion.waveform.rms_m == pytest.approx(3e-4, rel=0.03)
    np.testing.assert_allclose(motion.rest.curve, truth.offset + np.interp(motion.rest.t, t, drift), atol=2e-4)


def test_a_fit_that_does_not_converge_is_said_so(synthetic: ModuleType) -> None:
    """From a frequency off by ten line widths, in one step, nothing converges: the windows' values stand."""
    t = synthetic.times(20.0)
    result = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(gamma=0.01), t, 3e-4, 5)))
    m = result.motion
    assert isinstance(m, Oscillation)
    off = replace(m.phase, coefficients=m.phase.coefficients + np.array([0.0, 3.0]))
    found = fit_record(
        result.conditioned, m.demodulated, m.damping, off, m.rest, m.waveform, params=FullParams(steps=1)
    )
    assert not found.converged
    assert found.phase is off
    assert found.waveform is m.waveform
    (finding,) = fit_findings(found, None)
    assert (finding.code, finding.severity) == ("not_converged", "warning")
    assert found.tried in finding.details


def test_too_few_samples_on_the_model_are_no_fit(synthetic: ModuleType) -> None:
    """With a limit that no sample keeps the windows' values stand, and a finding says why."""
    t = synthetic.times(20.0)
    track = Track.from_arrays(t, synthetic.noisy(synthetic.Truth(gamma=0.01), t, 3e-4, 5))
    narrow = analyse(track, params=Params(full=FullParams(clip_sigmas=0.0)))
    standard = analyse(track, params=params_for("standard"))
    assert [f.severity for f in narrow.findings if f.code == "not_converged"] == ["warning"]
    assert narrow.estimates["period"] == standard.estimates["period"]


def test_samples_put_out_by_a_narrow_window_come_back(synthetic: ModuleType) -> None:
    """Single samples that the stages flagged but the whole record sees within noise are used again."""
    t = synthetic.times(40.0)
    result = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(gamma=0.01), t, 3e-4, 7)))
    m = result.motion
    assert isinstance(m, Oscillation)
    flags = m.demodulated.flags.copy()
    flags[100:3900:50] |= np.uint8(Quality.FALSE_ECHO)
    found = fit_record(result.conditioned, replace(m.demodulated, flags=flags), m.damping, m.phase, m.rest, m.waveform)
    assert np.count_nonzero(found.flags) <= 5


def test_a_law_with_a_pole_in_the_record_ends_no_fit(synthetic: ModuleType) -> None:
    """Samples are not chosen on the tangent of a law that runs to infinity: it has none."""
    t = synthetic.times(20.0)
    result = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(gamma=0.02), t, 3e-4, 1)))
    m = result.motion
    assert isinstance(m, Oscillation)
    record = Record.of(result.conditioned, m.demodulated, m.phase, m.rest, None)
    turning = [m.phase.phase.value, m.phase.angular_frequency.value, 0.0]
    state = State(LAWS["power"], np.array([0.05, -4.0, 2.0, *turning]), constant=True)
    chooser = Chooser(result.conditioned, m.demodulated, record, 5.0)
    rows, kept = chooser.settled(state, chooser.by_windows)
    assert kept is state
    assert np.array_equal(rows, chooser.by_windows)
