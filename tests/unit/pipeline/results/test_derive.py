"""Derived quantities by hand-computed values, and their uncertainties by propagation written out again."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest
from uncertainties import ufloat, umath

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.bench.air import air_density, air_viscosity
from pipeline.bench.instrument import U_CRYSTAL, Instrument
from pipeline.bench.scene import Scene
from pipeline.damping.select import Damping, fit_damping
from pipeline.motion.phase import fit_phase
from pipeline.motion.waveform import fit_rest
from pipeline.numerics.estimate import Estimate
from pipeline.results.derive import Derived, derive
from pipeline.results.effects import Effect, tabulate
from pipeline.track import Track
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
OMEGA, START, GAMMA, BETA = 8.0, 0.05, 0.007, 0.2
BENCH = {
    "bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}},
    "spring": {"mass_kg": {"value": 0.0100, "u": 0.0005}},
    "disc": {"diameter_m": {"value": 0.102, "u": 0.0005}},
    "air": {"temperature_c": {"value": 20.0, "u": 0.3}, "pressure_pa": 101325.0, "relative_humidity": 0.0},
}


EXACT = Instrument("device", Estimate(1.0, 0.0), "exact")
CRYSTAL = Instrument("nominal", Estimate(1.0, U_CRYSTAL), "a crystal's")


class Bench:
    """The stages of one run made by hand, and what is derived of it."""

    def __init__(
        self, windows: Windows, tables: dict[str, object], *, instrument: Instrument = EXACT, gamma: float = GAMMA
    ) -> None:
        t = 0.4 + 0.785 * np.arange(150)
        decay = np.exp(-gamma * t)
        amplitude = START * decay / (1.0 + BETA * START * (1.0 - decay) / gamma)
        rng = np.random.default_rng(3)
        amplitude = amplitude + rng.normal(0.0, 2e-5, t.size)
        phase = 0.3 + OMEGA * t + rng.normal(0.0, 4e-4, t.size)
        offset = 0.22 + rng.normal(0.0, 2e-5, t.size)
        self.points = windows(t, amplitude, omega=OMEGA, phase=phase, offset=offset, u=(2e-5, 4e-4, 2e-5))
        self.scene = Scene.from_mapping(tables)
        self.damping: Damping = fit_damping(self.points, 0.0)
        self.phase = fit_phase(self.points, self.damping)
        self.rest = fit_rest(self.points)
        self.effects: tuple[Effect, ...] = tabulate(
            self.scene,
            self.damping,
            self.phase,
            self.rest,
            noise_m=3e-4,
            instrument=instrument,
        )
        self.derived: Derived = derive(
            self.points, self.damping, self.phase, self.rest, self.scene, self.effects, instrument=instrument
        )
        self.estimates = self.derived.estimates


@pytest.fixture
def bench(windows: Windows) -> Bench:
    """Return the whole bench, its clock exact."""
    return Bench(windows, BENCH)


def test_frequency_period_and_angular_frequency_are_one_number(bench: Bench) -> None:
    """f = omega / 2 pi and T = 1 / f, with one relative uncertainty."""
    omega = bench.phase.angular_frequency
    for name, value in (
        ("angular_frequency", omega.value),
        ("frequency", omega.value / (2 * math.pi)),
        ("period", 2 * math.pi / omega.value),
    ):
        assert bench.estimates[name].value == pytest.approx(value, rel=1e-12)
        assert bench.estimates[name].u / value == pytest.approx(omega.u / omega.value, rel=1e-6)
        assert bench.derived.statistical[name].u / value == pytest.approx(omega.u / omega.value, rel=1e-6)
    assert bench.estimates["period"].value == pytest.approx(0.785398, rel=1e-5)


def test_nominal_clock_enters_everything_with_time(windows: Windows, bench: Bench) -> None:
    """A crystal of 50 ppm, half-width of a rectangle, adds to frequency's u but not to its statistical part."""
    nominal = Bench(windows, BENCH, instrument=CRYSTAL)
    relative = bench.estimates["frequency"].u / bench.estimates["frequency"].value
    expected = math.hypot(relative, 50e-6 / math.sqrt(3))
    for name in ("frequency", "period", "angular_frequency"):
        assert nominal.estimates[name].u / nominal.estimates[name].value == pytest.approx(expected, rel=1e-6)
        assert nominal.derived.statistical[name].u == pytest.approx(bench.derived.statistical[name].u, rel=1e-9)
    k, k_nominal = bench.estimates["spring_constant"], nominal.estimates["spring_constant"]
    assert k_nominal.u == pytest.approx(math.hypot(k.u, k.value * 2 * 50e-6 / math.sqrt(3)), rel=1e-4)


def test_effective_mass_by_hand(bench: Bench) -> None:
    """0.2176 + 0.0100/3 + 0.01^2/45/0.2176 + (8/3) 1.2046 0.051^3 = 0.22137 kg; the air goes as the radius cubed."""
    mass = bench.derived.effective_mass_kg
    assert mass is not None
    assert mass.value == pytest.approx(
        0.2176 + 0.0100 / 3 + 0.01**2 / 45 / 0.2176 + 8 / 3 * 1.2046 * 0.051**3, abs=3e-7
    )
    added = 8 / 3 * 1.2041 * 0.051**3
    expected = math.sqrt(0.00005**2 + (0.0005 * (1 / 3 + 0.02 / 45 / 0.2176)) ** 2 + (3 * added * 0.0005 / 0.102) ** 2)
    assert mass.u == pytest.approx(expected, rel=1e-3)


def test_spring_constant_by_hand(bench: Bench) -> None:
    """k = omega^2 m = 64 x 0.22137 = 14.168 N/m, its u by the formula written out."""
    mass, omega = bench.derived.effective_mass_kg, bench.phase.angular_frequency
    assert mass is not None
    k = bench.estimates["spring_constant"]
    assert k.value == pytest.approx(14.167, abs=2e-3)
    assert k.u == pytest.approx(k.value * math.hypot(2 * omega.u / omega.value, mass.u / mass.value), rel=1e-6)
    assert k.unit == "N/m"


def test_mass_of_the_bob_alone(windows: Windows) -> None:
    """Without spring mass and disc in the scene k is that of the bob, uncertain by a spring of up to 0.3 of it."""
    bare = Bench(windows, {"bob": {"mass_kg": {"value": 0.2007, "u": 0.00005}}})
    k = ufloat(OMEGA, 1e-9) ** 2 * (ufloat(0.2007, 0.00005) + ufloat(0.0, 0.3 * 0.2007 / math.sqrt(3)) / 3)
    assert bare.estimates["spring_constant"].value == pytest.approx(k.nominal_value, rel=1e-4)
    assert bare.estimates["spring_constant"].u == pytest.approx(k.std_dev, rel=0.01)


def test_amplitude_offset_and_phase(bench: Bench) -> None:
    """Amplitude and phase are those at the first sample, the offset the mean rest position, each within 3 u."""
    for name, truth, unit in (("amplitude", START, "m"), ("offset", 0.22, "m"), ("phase", 0.3, "rad")):
        found = bench.estimates[name]
        assert abs(found.value - truth) < 3 * found.u
        assert found.unit == unit


def test_damping_rate_and_quality_factor(bench: Bench) -> None:
    """lambda = gamma + beta A0 = 0.017 1/s and Q = omega / 2 lambda = 235."""
    rate, quality = bench.estimates["damping_rate"], bench.estimates["quality_factor"]
    assert rate.value == pytest.approx(0.017, abs=4 * rate.u)
    assert quality.value == pytest.approx(OMEGA / (2 * rate.value), rel=1e-4)
    assert quality.u / quality.value == pytest.approx(rate.u / rate.value, rel=1e-2)
    assert (rate.unit, quality.unit) == ("1/s", "")


def test_velocity_rms(bench: Bench) -> None:
    """v = omega sqrt(mean A^2 / 2) over the record, from its first sample to its last."""
    t = np.linspace(0.4 - 0.3925, 0.4 + 0.785 * 149 + 0.3925, 20_001)
    decay = np.exp(-GAMMA * t)
    amplitude = START * decay / (1.0 + BETA * START * (1.0 - decay) / GAMMA)
    expected = OMEGA * math.sqrt(np.mean(amplitude**2) / 2.0)
    found = bench.estimates["velocity_rms"]
    assert abs(found.value - expected) < 3 * found.u
    assert found.u < 1e-3 * found.value


def test_root_mean_square_of_a_constant_amplitude(windows: Windows) -> None:
    """For A = 50 mm at 8 rad/s it is 0.282843 m/s."""
    t = 0.4 + 0.785 * np.arange(50)
    points = windows(t, START, omega=OMEGA, phase=OMEGA * t, offset=0.2, u=(2e-5, 4e-4, 2e-5))
    damping = fit_damping(points, 0.0)
    phase, rest = fit_phase(points, damping), fit_rest(points)
    derived = derive(points, damping, phase, rest, Scene(), (), instrument=EXACT)
    assert derived.estimates["velocity_rms"].value == pytest.approx(8.0 * 0.05 / math.sqrt(2), rel=1e-6)
    assert derived.effective_mass_kg is None
    assert not {"spring_constant", "reynolds_number", "keulegan_carpenter_number", "drag_coefficient"} & set(
        derived.estimates
    )


def test_reynolds_number_with_its_formula(bench: Bench) -> None:
    """Re = rho v D / eta; density, viscosity and the distances' scale move together with the temperature."""
    v = bench.derived.statistical["velocity_rms"]
    celsius = ufloat(20.0, 0.3)
    kelvin = celsius + 273.15
    scale = umath.sqrt(kelvin / 293.15) * ufloat(1.0, 3e-4)
    density = air_density(20.0) * 293.15 / kelvin
    viscosity = air_viscosity(20.0) * (kelvin / 293.15) ** 0.77
    expected = density * ufloat(v.value, v.u) * scale * ufloat(0.102, 0.0005) / viscosity
    expected = expected * ufloat(1.0, 2e-4) * ufloat(1.0, 5e-3)
    found = bench.estimates["reynolds_number"]
    assert found.value == pytest.approx(expected.nominal_value, rel=1e-9)
    assert found.u == pytest.approx(expected.std_dev, rel=1e-3)


def test_keulegan_carpenter_number_with_its_formula(bench: Bench) -> None:
    """KC = 2 pi A0 / D = 3.08."""
    a = bench.estimates["amplitude"]
    expected = 2 * math.pi * ufloat(a.value, a.u) / ufloat(0.102, 0.0005)
    found = bench.estimates["keulegan_carpenter_number"]
    assert found.value == pytest.approx(3.08, abs=0.01)
    assert found.u == pytest.approx(expected.std_dev, rel=1e-6)


def test_drag_coefficient_with_its_formula(bench: Bench) -> None:
    """C = 3 pi m beta / (2 omega rho S) = 2.65 for beta = 0.2; the diameter enters area and mass alike."""
    beta = bench.damping.best.joint["beta"]
    u_beta = beta.u * math.sqrt(max(bench.damping.best.reduced_chi2, 1.0))  # its scale factor
    omega = bench.phase.angular_frequency
    diameter, celsius = ufloat(0.102, 0.0005), ufloat(20.0, 0.3)
    density = air_density(20.0) * 293.15 / (celsius + 273.15)
    added = 8 / 3 * air_density(20.0) * (diameter / 2) ** 3
    spring = ufloat(0.0100, 0.0005)
    mass = ufloat(0.2176, 0.00005) + added
    mass = mass + spring / 3 + spring**2 / mass / 45
    scale = umath.sqrt((celsius + 273.15) / 293.15) * ufloat(1.0, 3e-4)
    expected = (
        3
        * math.pi
        * mass
        * ufloat(beta.value, u_beta)
        / (2 * ufloat(omega.value, omega.u) * density * ufloat(1.0, 2e-4) * math.pi * diameter**2 / 4)
        / scale
    )
    found = bench.estimates["drag_coefficient"]
    assert found.value == pytest.approx(expected.nominal_value, rel=1e-6)
    assert found.u == pytest.approx(expected.std_dev, rel=1e-3)
    assert found.value == pytest.approx(3 * math.pi * 0.22136 * 0.2 / (2 * 8.0 * 1.2041 * math.pi * 0.051**2), rel=0.03)


def test_scene_without_air_has_no_reynolds_number(windows: Windows) -> None:
    """What the scene does not say leaves out what depends on it, and nothing else."""
    some = Bench(windows, {k: v for k, v in BENCH.items() if k != "air"})
    assert "keulegan_carpenter_number" in some.estimates
    assert not {"reynolds_number", "drag_coefficient"} & set(some.estimates)


def test_temperature_without_uncertainty_is_not_exact(windows: Windows) -> None:
    """A temperature stated as a plain number counts as known to half a kelvin."""
    plain = Bench(windows, BENCH | {"air": {"temperature_c": 20.0, "pressure_pa": 101325.0, "relative_humidity": 0.0}})
    stated = Bench(
        windows,
        BENCH
        | {"air": {"temperature_c": {"value": 20.0, "u": 0.5}, "pressure_pa": 101325.0, "relative_humidity": 0.0}},
    )
    assert plain.estimates["reynolds_number"].u == pytest.approx(stated.estimates["reynolds_number"].u)


def test_growing_oscillation_has_no_quality_factor(windows: Windows) -> None:
    """Where the amplitude rises there is no quality factor to give."""
    t = 0.4 + 0.785 * np.arange(80)
    points = windows(t, 0.02 * np.exp(0.005 * t), omega=OMEGA, phase=OMEGA * t, u=(2e-5, 4e-4, 2e-5))
    damping = fit_damping(points, 0.0)
    derived = derive(points, damping, fit_phase(points, damping), fit_rest(points), Scene(), (), instrument=EXACT)
    assert "quality_factor" not in derived.estimates
    assert derived.estimates["damping_rate"].value < 0


def test_noise_of_a_normal_record(synthetic: ModuleType) -> None:
    """Noise is the standard deviation of normal noise, its interval true in about two of three records."""
    inside = []
    t = synthetic.times(10)
    for seed in range(60):
        result: Analysis = analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, 3e-4, seed)))
        assert isinstance(result.motion, Oscillation)
        noise = result.estimates["noise"]
        inside.append(abs(noise.value - 3e-4) <= noise.u)
    assert 0.5 <= np.mean(inside) <= 0.87


def test_independent_formula_of_k_for_a_whole_record(synthetic: ModuleType) -> None:
    """For a record with its scene k and its u follow from the period that is printed beside it."""
    t = synthetic.times(20)
    truth = synthetic.Truth(omega=8.2835)
    scene = Scene.from_mapping({"bob": BENCH["bob"]})
    found = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 3e-4, 5)), scene).estimates
    period = ufloat(found["period"].value, found["period"].u)
    k = 4 * umath.pow(math.pi / period, 2) * (ufloat(0.2176, 0.00005) + ufloat(0.0, 0.3 * 0.2176 / math.sqrt(3)) / 3)
    assert found["spring_constant"].value == pytest.approx(k.nominal_value, rel=1e-9)
    assert found["spring_constant"].u == pytest.approx(k.std_dev, rel=1e-4)
    assert found["spring_constant"] == Estimate(found["spring_constant"].value, found["spring_constant"].u, "N/m")
