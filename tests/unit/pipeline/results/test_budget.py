"""Uncertainty budgets of analysed runs against closed forms written out by hand, and against Monte Carlo (JCGM 101)."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.air import U_DENSITY, U_SOUND, U_VISCOSITY, air_density, air_viscosity, speed_of_sound
from pipeline.bench.clock_rate import U_CRYSTAL
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.results.budget import Budget, Inputs, joint_of
from pipeline.results.derive import Derived
from pipeline.track import Track
from tests.synthetic import Truth, noisy, times

TRUTH = Truth(omega=8.0, gamma=0.007, beta=0.2, phase=0.3)
MASS, SPRING, DISC, CELSIUS = (0.2176, 5e-5), (0.0100, 5e-4), (0.102, 5e-4), (20.0, 1.5)
PASCAL, HUMIDITY = (100500.0, 800.0), (0.45, 0.1)
SCENE: dict[str, Any] = {
    "bob": {"mass_kg": {"value": MASS[0], "u": MASS[1]}},
    "spring": {"mass_kg": {"value": SPRING[0], "u": SPRING[1]}},
    "disc": {"diameter_m": {"value": DISC[0], "u": DISC[1]}},
    "air": {
        "temperature_c": {"value": CELSIUS[0], "u": CELSIUS[1]},
        "pressure_pa": {"value": PASCAL[0], "u": PASCAL[1]},
        "relative_humidity": {"value": HUMIDITY[0], "u": HUMIDITY[1]},
    },
    "sensor": {"position": "below"},
}


def motion(tables: dict[str, Any] = SCENE, seconds: float = 117.0, **track: Any) -> Derived:
    """Return the results of a run of mixed drag in a scene."""
    t = times(seconds)
    recorded = replace(Track.from_arrays(t, noisy(TRUTH, t, 1e-4, 3)), **track)
    return analyse(recorded, Scene.from_mapping(tables)).derived


@cache
def whole() -> Derived:
    """Return the results of two minutes on a bench of which everything is known."""
    return motion()


def part(budget: Budget, name: str) -> float:
    """Return what an input contributes to u; 0 where it is not in the budget."""
    return next((c.u for c in budget.contributions if c.name == name), 0.0)


def test_shares_add_up_and_parts_give_the_total() -> None:
    """In every budget shares sum to one, contributions in quadrature to u, and the largest comes first."""
    result = whole()
    assert set(result.budgets) == set(result.estimates) | set(result.coefficients)
    for budget in result.budgets.values():
        shares = [c.share for c in budget.contributions]
        assert sum(shares) == pytest.approx(1.0, abs=1e-9)
        assert shares == sorted(shares, reverse=True)
        assert math.hypot(*(c.u for c in budget.contributions)) == pytest.approx(budget.estimate.u, rel=1e-9)
        assert math.hypot(budget.u_of("A"), budget.u_of("B")) == pytest.approx(budget.estimate.u, rel=1e-9)


def test_spring_constant_by_hand() -> None:
    """u(k): 2k u(T)/T, 2k u_c, omega^2 times u(m), (1/3 + 2 m_s/45 m) u(m_s), 8 rho a^2 u(a); the scale has none."""
    result = whole()
    budget, omega = result.budgets["spring_constant"], result.estimates["angular_frequency"].value
    k = budget.estimate.value
    scatter = result.statistical["angular_frequency"].u
    assert part(budget, "angular_frequency") == pytest.approx(2 * k * scatter / omega, rel=1e-5)
    assert part(budget, "clock_rate") == pytest.approx(2 * k * 50e-6 / math.sqrt(3), rel=1e-6)
    assert part(budget, "bob_mass") == pytest.approx(omega**2 * (1 - (0.01 / 0.2176) ** 2 / 45) * 5e-5, rel=1e-5)
    assert part(budget, "spring_mass") == pytest.approx(omega**2 * (1 / 3 + 2 / 45 * 0.01 / 0.218) * 5e-4, rel=1e-4)
    density = 100500 * 0.028965 / (8.314463 * 293.15)  # dry; humidity takes 0.4 %
    assert part(budget, "disc_diameter") == pytest.approx(omega**2 * 8 * density * 0.051**2 * 2.5e-4, rel=0.01)
    # What changes the scale by 0.26 % changes k through the added mass alone: by 0.5 % of its 0.2 %.
    assert part(budget, "air_temperature") < 1.2e-5 * k


def test_distances_carry_the_scale_and_times_the_clock() -> None:
    """u(T)/2T = 0.26 % of amplitude and offset at 20 +- 1.5 degC; beta carries both, and in Q the clock cancels."""
    result = whole()
    relative = 1.5 / (2 * 293.15)
    for name, source in (("amplitude", result.estimates), ("offset", result.estimates), ("beta", result.coefficients)):
        budget = result.budgets[name]
        # Water vapour, which a warmer air of one relative humidity holds more of, adds a tenth.
        assert part(budget, "air_temperature") / source[name].value == pytest.approx(relative, rel=0.12)
        assert part(budget, "speed_of_sound_formula") / source[name].value == pytest.approx(U_SOUND, rel=1e-6)
    assert part(result.budgets["beta"], "clock_rate") / result.coefficients["beta"].value == pytest.approx(U_CRYSTAL)
    assert part(result.budgets["amplitude"], "clock_rate") == 0.0
    assert part(result.budgets["damping_rate"], "air_temperature") == 0.0
    assert part(result.budgets["damping_rate"], "clock_rate") > 0.0
    assert part(result.budgets["quality_factor"], "clock_rate") == 0.0


def test_the_scale_is_that_of_the_air_of_the_recording_or_of_a_calibration() -> None:
    """Distances made with 340 m/s in air of 343.9 err by the difference; a calibration replaces the air's part."""
    old = motion(sonic=True, speed_of_sound_m_per_s=340.0, seconds=20.0).budgets["amplitude"]
    relative = part(old, "recorded_speed_of_sound") / old.estimate.value
    assert relative == pytest.approx((343.93 / 340 - 1) / math.sqrt(3), rel=0.01)
    calibrated = motion(u_scale=2e-3, u_offset_m=5e-4, seconds=20.0).budgets
    assert part(calibrated["amplitude"], "calibrated_scale") == pytest.approx(
        2e-3 * calibrated["amplitude"].estimate.value
    )
    assert part(calibrated["amplitude"], "air_temperature") == 0.0
    assert part(calibrated["offset"], "sensor_zero") == pytest.approx(5e-4)
    assert part(motion({}, 20.0).budgets["amplitude"], "air_temperature") == 0.0


def humid_air(celsius: np.ndarray, pascal: np.ndarray, humidity: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return density, viscosity and speed of sound of every draw."""
    density, sound = (np.vectorize(formula)(celsius, pascal, humidity) for formula in (air_density, speed_of_sound))
    return density, np.vectorize(air_viscosity)(celsius, pascal), sound


def test_propagation_against_monte_carlo() -> None:
    """50,000 draws of all inputs through the model give the same u of every result, to 1.5 %, and the same value."""
    result, n = whole(), 50_000
    (stated,) = result.laws  # one admissible law: nothing but a normal distribution is drawn
    joint, rng = stated.fit.joint, np.random.default_rng(20240401)
    assert joint.names == ("A0", "gamma", "beta")
    start, gamma, beta = rng.multivariate_normal(joint.values, joint.covariance, n).T
    omega = result.statistical["angular_frequency"]
    clock = rng.normal(1.0, U_CRYSTAL, n)
    mass, spring, disc, celsius, pascal, humidity = (
        rng.normal(*given, n) for given in (MASS, SPRING, DISC, CELSIUS, PASCAL, HUMIDITY)
    )
    density, viscosity, sound = humid_air(celsius, pascal, humidity)
    _, _, nominal = humid_air(*(np.array(given[0]) for given in (CELSIUS, PASCAL, HUMIDITY)))
    scale = sound / nominal * rng.normal(1.0, U_SOUND, n)
    density, viscosity = density * rng.normal(1.0, U_DENSITY, n), viscosity * rng.normal(1.0, U_VISCOSITY, n)
    rate = rng.normal(omega.value, omega.u, n) * clock
    load = mass + 8 / 3 * density * (disc / 2) ** 3
    oscillating = load + spring / 3 + spring**2 / load / 45
    at = 117.0 * (np.arange(100) + 0.5) / 100
    fall = np.exp(-np.outer(at, gamma))
    amplitude = start * fall / (1 + beta * start * (1 - fall) / gamma)
    velocity = rate * scale * np.sqrt(np.mean(amplitude**2, axis=0) / 2)
    damping = gamma + beta * start
    drawn = {
        "period": 2 * np.pi / rate,
        "spring_constant": rate**2 * oscillating,
        "amplitude": start * scale,
        "damping_rate": damping * clock,
        "quality_factor": rate / clock / (2 * damping),
        "velocity_rms": velocity,
        "reynolds_number": density * velocity * disc / viscosity,
        "keulegan_carpenter_number": 2 * np.pi * start * scale / disc,
        "drag_coefficient": 3 * np.pi * oscillating * beta / scale * clock / (2 * rate * density * np.pi * disc**2 / 4),
    }
    assert set(drawn) <= set(result.estimates)
    for name, sample in drawn.items():
        found = result.estimates[name]
        assert found.u == pytest.approx(float(np.std(sample)), rel=0.015), name
        assert abs(found.value - float(np.mean(sample))) < 0.05 * found.u, name


def test_estimates_carry_their_correlations() -> None:
    """Period times frequency is exactly 1, and a product of estimates has the variance that their covariance gives."""
    found = whole()
    period, frequency = found.estimates["period"], found.estimates["frequency"]
    assert (period * frequency).std_dev < 1e-12
    a, b = found.estimates["amplitude"], found.coefficients["beta"]
    joint = joint_of({"a": a, "b": b})
    expected = b.value**2 * joint.covariance[0, 0] + a.value**2 * joint.covariance[1, 1]
    expected += 2.0 * a.value * b.value * joint.covariance[0, 1]
    assert (a * b).std_dev == pytest.approx(math.sqrt(expected))
    assert abs(joint.correlation[0, 1]) > 0.1


def test_degrees_of_freedom_of_the_guides_example() -> None:
    """JCGM 100, G.4.1: a product of three means of 10, 5 and 15 observations, 0.25, 0.57 and 0.82 %, has 19.0."""
    inputs = Inputs()
    share = {"bob_mass": (0.0025, 9), "disc_diameter": (0.0057, 4), "noise": (0.0082, 14)}
    product = math.prod(inputs.add(name, Estimate(1.0, u), "A", dof) for name, (u, dof) in share.items())
    budget = inputs.budget("product", product, "")
    assert budget.estimate.u == pytest.approx(0.0103, rel=2e-3)
    assert budget.dof == pytest.approx(19.0, abs=0.05)
    assert budget.expanded == budget.coverage_factor * budget.estimate.u


@pytest.mark.parametrize(("dof", "factor"), [(1, 13.97), (5, 2.65), (20, 2.13), (math.inf, 2.0)])
def test_coverage_factors_are_those_of_ea_4_02(dof: float, factor: float) -> None:
    """Student's t for 95.45 %, table E.1 there."""
    inputs = Inputs()
    x = inputs.add("noise", Estimate(1.0, 0.1), "A", dof)
    assert inputs.budget("x", x, "").coverage_factor == pytest.approx(factor, abs=0.005)
