"""Derived quantities of analysed runs by values calculated by hand, and their uncertainties by propagation."""

from __future__ import annotations

import math
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from uncertainties import ufloat, umath

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.bench.air import air_density, air_viscosity
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.results.derive import Derived
from pipeline.track import Track
from tests.synthetic import Truth, noisy, times

TRUTH = Truth(omega=8.0, gamma=0.007, beta=0.2, phase=0.3)
BENCH: dict[str, Any] = {
    "bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}},
    "spring": {"mass_kg": {"value": 0.0100, "u": 0.0005}},
    "disc": {"diameter_m": {"value": 0.102, "u": 0.0005}},
    "air": {"temperature_c": {"value": 20.0, "u": 0.3}, "pressure_pa": 101325.0, "relative_humidity": 0.0},
    "sensor": {"position": "below"},
}


def analysed(tables: dict[str, Any]) -> Analysis:
    """Return the analysis of two minutes of mixed drag in a scene."""
    t = times(117.0)
    return analyse(Track.from_arrays(t, noisy(TRUTH, t, 1e-4, 3)), Scene.from_mapping(tables))


@cache
def derived() -> Derived:
    """Return what is derived on the whole bench."""
    found = analysed(BENCH).motion
    assert isinstance(found, Oscillation)
    return found.derived


def test_frequency_period_and_angular_frequency_are_one_number() -> None:
    """f = omega / 2 pi and T = 1 / f, with one relative uncertainty."""
    found = derived().estimates
    omega = found["angular_frequency"]
    for name, value in (("frequency", omega.value / (2 * math.pi)), ("period", 2 * math.pi / omega.value)):
        assert found[name].value == pytest.approx(value, rel=1e-12)
        assert found[name].u / value == pytest.approx(omega.u / omega.value, rel=1e-6)
    assert found["period"].value == pytest.approx(0.785398, rel=1e-4)


def test_effective_mass_and_spring_constant_by_hand() -> None:
    """0.2176 + 0.0100/3 + 0.01^2/45/0.2176 + (8/3) 1.2046 0.051^3 = 0.22137 kg, and k = omega^2 m = 14.17 N/m."""
    mass, omega = derived().effective_mass_kg, derived().estimates["angular_frequency"]
    assert mass is not None
    assert mass.value == pytest.approx(
        0.2176 + 0.0100 / 3 + 0.01**2 / 45 / 0.2176 + 8 / 3 * 1.2046 * 0.051**3, abs=3e-7
    )
    added = 8 / 3 * 1.2041 * 0.051**3
    expected = math.sqrt(0.00005**2 + (0.0005 * (1 / 3 + 0.02 / 45 / 0.2176)) ** 2 + (3 * added * 0.0005 / 0.102) ** 2)
    assert mass.u == pytest.approx(expected, rel=1e-3)
    k = derived().estimates["spring_constant"]
    assert k.value == pytest.approx(14.167, abs=5e-3)
    assert k.u == pytest.approx(k.value * math.hypot(2 * omega.u / omega.value, mass.u / mass.value), rel=1e-3)
    assert k.unit == "N/m"


def test_the_truth_lies_within_the_uncertainties() -> None:
    """Amplitude, offset, phase, gamma + beta A0, omega / 2 lambda and the rms velocity over the record, to 4 u."""
    amplitude = TRUTH.amplitude_at(np.linspace(0.0, 117.0, 20_001))
    rate = 0.007 + 0.2 * 0.05
    for name, truth, unit in (
        ("amplitude", 0.05, "m"),
        ("offset", TRUTH.offset, "m"),
        ("phase", 0.3, "rad"),
        ("damping_rate", rate, "1/s"),
        ("quality_factor", 8.0 / (2 * rate), ""),
        ("velocity_rms", 8.0 * math.sqrt(np.mean(amplitude**2) / 2.0), "m/s"),
    ):
        found = derived().estimates[name]
        assert abs(found.value - truth) < 4 * found.u, name
        assert found.u < 0.02 * abs(found.value), name
        assert found.unit == unit


def test_reynolds_and_keulegan_carpenter_numbers_with_their_formulas() -> None:
    """Re = rho v D / eta, where density, viscosity and scale follow the temperature together; KC = 2 pi A0 / D."""
    v = derived().statistical["velocity_rms"]
    kelvin = ufloat(20.0, 0.3) + 273.15
    scale = umath.sqrt(kelvin / 293.15) * ufloat(1.0, 3e-4)
    diameter = ufloat(0.102, 0.0005)
    viscosity = air_viscosity(20.0) * (kelvin / 293.15) ** 0.77
    expected = air_density(20.0) * 293.15 / kelvin * ufloat(v.value, v.u) * scale * diameter / viscosity
    expected = expected * ufloat(1.0, 2e-4) * ufloat(1.0, 5e-3)
    found = derived().estimates["reynolds_number"]
    assert found.value == pytest.approx(expected.nominal_value, rel=1e-9)
    assert found.u == pytest.approx(expected.std_dev, rel=1e-3)
    amplitude, number = (derived().estimates[name] for name in ("amplitude", "keulegan_carpenter_number"))
    expected = 2 * math.pi * ufloat(amplitude.value, amplitude.u) / diameter
    assert number.value == pytest.approx(3.08, abs=0.01)
    assert number.u == pytest.approx(expected.std_dev, rel=1e-6)


def test_drag_coefficient_with_its_formula() -> None:
    """C = 3 pi m beta / (2 omega rho S), about 2.65 for beta = 0.2."""
    omega, beta = derived().estimates["angular_frequency"].value, derived().coefficients["beta"]
    mass = derived().effective_mass_kg
    assert mass is not None
    expected = 3 * math.pi * mass.value * beta.value / (2 * omega * air_density(20.0) * math.pi * 0.051**2)
    found = derived().estimates["drag_coefficient"]
    assert found.value == pytest.approx(expected, rel=1e-6)
    assert found.value == pytest.approx(2.65, abs=4 * found.u)


def test_drag_falls_with_amplitude_as_mixed_drag_does() -> None:
    """The curve of the drag coefficient is F (gamma/A + beta) within three of its u, with F from the bench by hand."""
    motion = analysed(BENCH).motion
    assert isinstance(motion, Oscillation)
    curve = motion.derived.drag_curve(motion.damping, motion.demodulated)
    assert curve is not None
    factor = 3 * math.pi * 0.22137 / (2 * 8.0 * 1.2041 * math.pi * 0.051**2)
    assert np.all(np.abs(curve.y - factor * (0.007 / curve.x + 0.2)) < 3.0 * curve.u)


def test_a_quantity_needs_what_it_is_made_of() -> None:
    """Without air there is no Reynolds number, without a scene no mass; what is left stays."""
    some = analysed({name: table for name, table in BENCH.items() if name != "air"}).estimates
    assert "keulegan_carpenter_number" in some
    assert not {"reynolds_number", "drag_coefficient"} & set(some)
    none = analysed({}).estimates
    assert not {"spring_constant", "reynolds_number", "keulegan_carpenter_number", "drag_coefficient"} & set(none)


def test_growing_oscillation_has_no_quality_factor(synthetic: ModuleType) -> None:
    """Where the amplitude rises there is no quality factor to give."""
    t = synthetic.times(60.0)
    y = synthetic.noisy(synthetic.Truth(amplitude=0.02, gamma=-0.005), t, 1e-4, 1)
    found = analyse(Track.from_arrays(t, y)).estimates
    assert "quality_factor" not in found
    assert found["damping_rate"].value < 0


@pytest.mark.trials
def test_noise_of_a_normal_record(synthetic: ModuleType) -> None:
    """Noise is the standard deviation of normal noise, its interval true in about two of three records."""
    t = synthetic.times(10)
    inside = []
    for seed in range(60):
        noise = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, seed))).estimates["noise"]
        inside.append(abs(noise.value - 3e-4) <= noise.u)
    assert 0.5 <= np.mean(inside) <= 0.87


def test_independent_formula_of_k_for_a_whole_record(synthetic: ModuleType) -> None:
    """k and its u follow from the period beside it; an unstated spring weighs up to 0.3 of the bob."""
    t = synthetic.times(20)
    truth = synthetic.Truth(omega=8.2835)
    scene = Scene.from_mapping({"bob": BENCH["bob"]})
    found = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 3e-4, 5)), scene).estimates
    period = ufloat(found["period"].value, found["period"].u)
    k = 4 * umath.pow(math.pi / period, 2) * (ufloat(0.2176, 0.00005) + ufloat(0.0, 0.3 * 0.2176 / math.sqrt(3)) / 3)
    assert found["spring_constant"].value == pytest.approx(k.nominal_value, rel=1e-9)
    assert found["spring_constant"].u == pytest.approx(k.std_dev, rel=1e-4)
    assert found["spring_constant"] == Estimate(found["spring_constant"].value, found["spring_constant"].u, "N/m")
