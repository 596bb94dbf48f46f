"""The effects table lists every effect, in or out, with sizes by hand and a reason in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.added_mass import added_mass_kg
from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.damping.select import fit_damping
from pipeline.motion.phase import fit_phase
from pipeline.motion.waveform import fit_rest
from pipeline.numerics.estimate import Estimate
from pipeline.results.effects import Effect, tabulate
from pipeline.track import Track
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
NAMES = (
    "spring_mass",
    "added_mass",
    "viscous_drag",
    "quadratic_drag",
    "friction",
    "amplitude_dependent_frequency",
    "rest_drift",
    "sideways_mode",
    "harmonics",
    "buoyancy",
    "speed_of_sound",
    "clock_rate",
)
BENCH = {
    "bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}},
    "spring": {"mass_kg": 0.0100},
    "disc": {"diameter_m": 0.102},
    "air": {"temperature_c": 20.0, "pressure_pa": 101325.0, "relative_humidity": 0.0},
}


NOMINAL = Instrument("nominal", Estimate(1.0, 3e-5), "as its crystal has it, nobody compared")


def table(
    windows: Windows, tables: dict[str, object], *, instrument: Instrument = NOMINAL, offset_drift_m: float = 0.0
) -> dict[str, Effect]:
    """Return the effects of a run of 8 rad/s with mixed drag, by name."""
    t = 0.4 + 0.785 * np.arange(150)
    decay = np.exp(-0.007 * t)
    amplitude = 0.05 * decay / (1.0 + 0.2 * 0.05 * (1.0 - decay) / 0.007)
    rng = np.random.default_rng(3)
    points = windows(
        t,
        amplitude + rng.normal(0.0, 2e-5, t.size),
        omega=8.0,
        phase=8.0 * t + rng.normal(0.0, 4e-4, t.size),
        offset=0.22 + offset_drift_m * t / t[-1] + rng.normal(0.0, 2e-5, t.size),
        u=(2e-5, 4e-4, 2e-5),
    )
    damping = fit_damping(points, 0.0)
    effects = tabulate(
        Scene.from_mapping(tables),
        damping,
        fit_phase(points, damping),
        fit_rest(points),
        noise_m=3e-4,
        instrument=instrument,
    )
    return {effect.name: effect for effect in effects}


@pytest.mark.parametrize("tables", [{}, BENCH, {"bob": BENCH["bob"]}, {"disc": BENCH["disc"]}])
def test_every_effect_is_listed_with_a_reason(windows: Windows, tables: dict[str, object]) -> None:
    """Whatever the scene knows, all effects are in the table, each once and with a sentence."""
    found = table(windows, tables)
    assert tuple(found) == NAMES
    for effect in found.values():
        assert len(effect.why.split()) >= 4
        for size in (effect.predicted, effect.measured):
            assert size is None or math.isfinite(size)


def test_empty_scene_predicts_no_mass(windows: Windows) -> None:
    """Without a bob no mass effect is predicted or included."""
    found = table(windows, {})
    for name in ("spring_mass", "added_mass"):
        assert (found[name].predicted, found[name].included) == (None, False)


def test_masses_by_hand(windows: Windows) -> None:
    """A third of 10 g and a little is 1.54 % of the bob, 0.43 g of air 0.196 %; both exceed a tenth of u(k)/k."""
    found = table(windows, BENCH)
    assert found["spring_mass"].predicted == pytest.approx(0.01 / 3 / 0.2176 + (0.01 / 0.2176) ** 2 / 45, rel=1e-4)
    assert found["added_mass"].predicted == pytest.approx(8 / 3 * 1.2041 * 0.051**3 / 0.2176, rel=1e-3)
    assert found["spring_mass"].included
    assert found["added_mass"].included


def test_small_mass_stays_out(windows: Windows) -> None:
    """A spring of a milligram on a bob known to 1 % is out, and the reason says less."""
    found = table(windows, BENCH | {"bob": {"mass_kg": {"value": 0.2, "u": 0.002}}, "spring": {"mass_kg": 1e-6}})
    assert not found["spring_mass"].included
    assert "less" in found["spring_mass"].why


def test_added_mass_of_the_reports_disc() -> None:
    """(8/3) rho a^3 of a disc of 102 mm in dry air at 20 degC is 0.426 g; without a disc it is nothing."""
    assert added_mass_kg(Scene.from_mapping(BENCH)) == pytest.approx(8 / 3 * 1.2041 * 0.051**3, rel=5e-4)
    assert added_mass_kg(Scene()) == 0.0


def test_drags_by_hand(windows: Windows) -> None:
    """Predicted are 8 eta a / m and 4 b omega / (3 pi m) with b = C rho S / 2; measured what the selected law has."""
    found = table(windows, BENCH)
    assert found["viscous_drag"].predicted == pytest.approx(8 * 1.8206e-5 * 0.051 / 0.2176, rel=2e-3)
    b = 0.5 * 1.17 * 1.2041 * math.pi * 0.051**2
    assert found["quadratic_drag"].predicted == pytest.approx(4 * b * 8.0 / (3 * math.pi * 0.2176), rel=2e-3)
    assert found["viscous_drag"].measured == pytest.approx(0.007, rel=0.1)
    assert found["quadratic_drag"].measured == pytest.approx(0.2, rel=0.1)
    assert found["viscous_drag"].included
    assert found["quadratic_drag"].included
    assert "linear+quadratic" in found["viscous_drag"].why


def test_clock(windows: Windows) -> None:
    """The clock's uncertainty is always in the model; a correction is measured."""
    plain = table(windows, {})["clock_rate"]
    assert (plain.included, plain.predicted, plain.measured) == (True, 3e-5, None)
    corrected = Instrument("device", Estimate(1.002, 3e-5), "the host's clock is the reference here")
    found = table(windows, {}, instrument=corrected)["clock_rate"]
    assert found.measured == pytest.approx(0.002)
    assert found.why == corrected.clock_words


def test_rest_drift(windows: Windows) -> None:
    """A drift of 1 mm is measured and in, none is out."""
    assert not table(windows, {})["rest_drift"].included
    drifting = table(windows, {}, offset_drift_m=1e-3)["rest_drift"]
    assert drifting.included
    assert drifting.measured == pytest.approx(1e-3, rel=0.1)


def test_speed_of_sound_against_the_old_programs(windows: Windows) -> None:
    """At 20 degC dry sound runs 0.19 % slower than the 344 m/s of old recordings, at 30 degC 1.5 % faster."""
    assert table(windows, BENCH)["speed_of_sound"].predicted == pytest.approx(343.37 / 344.0 - 1.0, abs=1e-4)
    warm = BENCH | {"air": {"temperature_c": 30.0, "relative_humidity": 0.0}}
    assert table(windows, warm)["speed_of_sound"].predicted == pytest.approx(349.2 / 344.0 - 1.0, abs=6e-4)
    assert table(windows, BENCH)["speed_of_sound"].included


def test_speed_of_sound_of_the_record_is_told(windows: Windows) -> None:
    """What the record was made with is what the air is compared to; a calibrated scale needs neither."""
    known = Instrument("device", Estimate(1.0, 3e-5), "a crystal's", speed_of_sound_m_per_s=340.0)
    effect = table(windows, BENCH, instrument=known)["speed_of_sound"]
    assert effect.predicted == pytest.approx(343.37 / 340.0 - 1.0, abs=1e-4)
    assert "340 m/s" in effect.why
    calibrated = Instrument("device", Estimate(1.0, 3e-5), "a crystal's", u_scale=1e-3)
    assert "calibrated" in table(windows, BENCH, instrument=calibrated)["speed_of_sound"].why


def test_air_without_temperature_is_said_to_be_missing(windows: Windows) -> None:
    """Without an air temperature the scale's part stands in no uncertainty, and the table says so."""
    effect = table(windows, {})["speed_of_sound"]
    assert (effect.predicted, effect.included) == (None, False)
    assert "no air temperature" in effect.why
    assert "stand in no uncertainty" in effect.why
    assert "a room's 20 +- 3 degC" in table(windows, {"bob": BENCH["bob"]})["speed_of_sound"].why


def test_buoyancy_by_hand(windows: Windows) -> None:
    """A steel bob is lifted by rho / rho_steel g / omega^2 = 23 um."""
    assert table(windows, BENCH)["buoyancy"].predicted == pytest.approx(1.2041 / 7850 * 9.81 / 64, rel=1e-2)


def test_frequency_that_depends_on_amplitude(synthetic: ModuleType) -> None:
    """The shift between rest and first amplitude, kappa A0^2 / omega, is measured, and the effect is in."""
    truth = synthetic.Truth(gamma=0.0065, beta=0.2, kappa=-4.3)
    t = synthetic.times(120)
    found = {e.name: e for e in analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 1e-3, 1))).effects}
    effect = found["amplitude_dependent_frequency"]
    assert effect.included
    assert effect.measured == pytest.approx(-4.3 * 0.05**2 / 8.3, rel=0.05)


def test_share_of_the_uncertainty_decides(windows: Windows) -> None:
    """The same spring is in where the bob is weighed well and out where it is weighed badly."""
    fine = table(windows, BENCH | {"bob": {"mass_kg": {"value": 0.2, "u": 1e-5}}, "spring": {"mass_kg": 1e-3}})
    coarse = table(windows, BENCH | {"bob": {"mass_kg": {"value": 0.2, "u": 0.01}}, "spring": {"mass_kg": 1e-3}})
    assert fine["spring_mass"].included
    assert not coarse["spring_mass"].included
