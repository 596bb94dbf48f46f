"""Uncertainty budgets against closed forms written out by hand, and against Monte Carlo as in JCGM 101."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from uncertainties import correlated_values

from pipeline.bench.air import U_DENSITY, U_SOUND, U_VISCOSITY, air_density, air_viscosity, speed_of_sound
from pipeline.bench.instrument import U_CRYSTAL, Instrument
from pipeline.bench.scene import Scene
from pipeline.damping.select import fit_damping
from pipeline.errors import AnalysisError
from pipeline.motion.phase import fit_phase
from pipeline.motion.waveform import fit_rest
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.results.budget import Budget, Inputs, joint_of
from pipeline.results.derive import Derived, derive
from pipeline.results.effects import tabulate
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
OMEGA, START, GAMMA, BETA = 8.0, 0.05, 0.007, 0.2
MASS, SPRING, DISC, CELSIUS = (0.2176, 5e-5), (0.0100, 5e-4), (0.102, 5e-4), (20.0, 1.5)
PASCAL, HUMIDITY = (100500.0, 800.0), (0.45, 0.1)
SCENE = {
    "bob": {"mass_kg": {"value": MASS[0], "u": MASS[1]}},
    "spring": {"mass_kg": {"value": SPRING[0], "u": SPRING[1]}},
    "disc": {"diameter_m": {"value": DISC[0], "u": DISC[1]}},
    "air": {
        "temperature_c": {"value": CELSIUS[0], "u": CELSIUS[1]},
        "pressure_pa": {"value": PASCAL[0], "u": PASCAL[1]},
        "relative_humidity": {"value": HUMIDITY[0], "u": HUMIDITY[1]},
    },
}
NOMINAL = Instrument("nominal", Estimate(1.0, U_CRYSTAL), "a crystal's")


def derived(
    windows: Windows, tables: dict[str, object], instrument: Instrument = NOMINAL, *, periods: int = 150
) -> tuple[Derived, Demodulated]:
    """Return what is derived of windows made by hand, and the windows."""
    t = 0.4 + 0.785 * np.arange(periods)
    decay = np.exp(-GAMMA * t)
    amplitude = START * decay / (1.0 + BETA * START * (1.0 - decay) / GAMMA)
    rng = np.random.default_rng(3)
    points = windows(
        t,
        amplitude + rng.normal(0.0, 2e-5, t.size),
        omega=OMEGA,
        phase=0.3 + OMEGA * t + rng.normal(0.0, 4e-4, t.size),
        offset=0.22 + rng.normal(0.0, 2e-5, t.size),
        u=(2e-5, 4e-4, 2e-5),
    )
    scene = Scene.from_mapping(tables)
    damping = fit_damping(points, 0.0)
    phase, rest = fit_phase(points, damping), fit_rest(points)
    effects = tabulate(scene, damping, phase, rest, noise_m=3e-4, instrument=instrument)
    return derive(points, damping, phase, rest, scene, effects, instrument=instrument), points


def part(budget: Budget, name: str) -> float:
    """Return what an input contributes to u; 0 where it is not in the budget."""
    return next((c.u for c in budget.contributions if c.name == name), 0.0)


def test_shares_add_up_and_parts_give_the_total(windows: Windows) -> None:
    """In every budget shares sum to one, contributions in quadrature to u, and the greatest stands first."""
    result, _ = derived(windows, SCENE)
    assert set(result.budgets) == set(result.estimates) | set(result.coefficients)
    for budget in result.budgets.values():
        shares = [c.share for c in budget.contributions]
        assert sum(shares) == pytest.approx(1.0, abs=1e-9)
        assert shares == sorted(shares, reverse=True)
        assert math.hypot(*(c.u for c in budget.contributions)) == pytest.approx(budget.estimate.u, rel=1e-9)
        assert math.hypot(budget.u_of("A"), budget.u_of("B")) == pytest.approx(budget.estimate.u, rel=1e-9)


def test_single_inputs_are_sensitivity_times_uncertainty(windows: Windows) -> None:
    """A contribution is |c| u of its input; groups of correlated parameters have neither."""
    result, _ = derived(windows, SCENE)
    lines = [c for budget in result.budgets.values() for c in budget.contributions]
    assert {c.name for c in lines if c.input is None} == {"damping_law", "choice_of_law"} & {c.name for c in lines}
    for c in lines:
        if c.input is not None and c.sensitivity is not None:
            assert abs(c.sensitivity) * c.input.u == pytest.approx(c.u, rel=1e-9)


def test_spring_constant_by_hand(windows: Windows) -> None:
    """u(k): 2k u(T)/T, 2k u_c, omega^2 times u(m), (1/3 + 2 m_s/45 m) u(m_s), 8 rho a^2 u(a); the scale has none."""
    result, _ = derived(windows, SCENE)
    budget, omega = result.budgets["spring_constant"], result.estimates["angular_frequency"].value
    k = budget.estimate.value
    scatter = result.statistical["angular_frequency"].u
    assert part(budget, "angular_frequency") == pytest.approx(2 * k * scatter / omega, rel=1e-5)
    assert part(budget, "clock_rate") == pytest.approx(2 * k * 50e-6 / math.sqrt(3), rel=1e-6)
    assert part(budget, "bob_mass") == pytest.approx(omega**2 * (1 - (0.01 / 0.2176) ** 2 / 45) * 5e-5, rel=1e-5)
    assert part(budget, "spring_mass") == pytest.approx(omega**2 * (1 / 3 + 2 / 45 * 0.01 / 0.218) * 5e-4, rel=1e-4)
    density = 100500 * 0.028965 / (8.314463 * 293.15)  # dry; humidity takes 0.4 %
    assert part(budget, "disc_diameter") == pytest.approx(omega**2 * 8 * density * 0.051**2 * 2.5e-4, rel=0.01)
    assert {c.name for c in budget.contributions} <= {
        *("angular_frequency", "clock_rate", "bob_mass", "spring_mass", "disc_diameter", "density_formula"),
        *("air_temperature", "air_pressure", "relative_humidity"),
    }
    # What moves the scale by 0.26 % moves k through the added mass alone: by 0.5 % of its 0.2 %.
    assert part(budget, "air_temperature") < 1.2e-5 * k


def test_distances_carry_the_scale_and_times_the_clock(windows: Windows) -> None:
    """u(T)/2T = 0.26 % of amplitude and offset at 20 +- 1.5 degC; beta carries both, inversely and directly."""
    result, _ = derived(windows, SCENE)
    relative = 1.5 / (2 * 293.15)
    for name, source in (("amplitude", result.estimates), ("offset", result.estimates), ("beta", result.coefficients)):
        budget = result.budgets[name]
        # Water vapour, which a warmer air of one relative humidity holds more of, adds a tenth.
        assert part(budget, "air_temperature") / source[name].value == pytest.approx(relative, rel=0.12)
        assert part(budget, "speed_of_sound_formula") / source[name].value == pytest.approx(U_SOUND, rel=1e-6)
    assert part(result.budgets["beta"], "clock_rate") / result.coefficients["beta"].value == pytest.approx(U_CRYSTAL)
    assert part(result.budgets["amplitude"], "clock_rate") == 0.0
    assert part(result.budgets["damping_rate"], "air_temperature") == 0.0


def test_quality_factor_does_not_know_the_clock(windows: Windows) -> None:
    """Q = omega/2 lambda is a ratio of two rates: the clock cancels exactly."""
    result, _ = derived(windows, SCENE)
    assert part(result.budgets["quality_factor"], "clock_rate") == 0.0
    assert part(result.budgets["damping_rate"], "clock_rate") > 0.0


def test_type_b_does_not_average_away(windows: Windows) -> None:
    """From 40 to 150 periods the scatter's part shrinks; clock and scale stay where they are, to a part in 300."""
    (short, _), (long, _) = derived(windows, SCENE, periods=40), derived(windows, SCENE, periods=150)
    assert long.statistical["period"].u < 0.3 * short.statistical["period"].u
    for name, source in (("period", "clock_rate"), ("amplitude", "air_temperature")):
        assert part(long.budgets[name], source) == pytest.approx(part(short.budgets[name], source), rel=3e-3)


def test_record_made_with_another_speed_of_sound(windows: Windows) -> None:
    """Distances made with 340 m/s in air of 343.9: the difference, uncorrected, is a rectangle's half-width."""
    instrument = Instrument("nominal", Estimate(1.0, U_CRYSTAL), "a crystal's", speed_of_sound_m_per_s=340.0)
    result, _ = derived(windows, SCENE, instrument)
    relative = part(result.budgets["amplitude"], "recorded_speed_of_sound") / result.estimates["amplitude"].value
    assert relative == pytest.approx((343.93 / 340 - 1) / math.sqrt(3), rel=0.01)


def test_calibrated_scale_and_zero(windows: Windows) -> None:
    """A calibration's own uncertainties stand in place of the air's."""
    instrument = Instrument("device", Estimate(1.0, U_CRYSTAL), "a crystal's", u_scale=2e-3, u_offset_m=5e-4)
    result, _ = derived(windows, SCENE, instrument)
    amplitude, offset = result.budgets["amplitude"], result.budgets["offset"]
    assert part(amplitude, "calibrated_scale") == pytest.approx(2e-3 * amplitude.estimate.value)
    assert part(amplitude, "air_temperature") == 0.0
    assert part(offset, "sensor_zero") == pytest.approx(5e-4)
    assert part(amplitude, "sensor_zero") == 0.0


def test_scene_without_air_leaves_the_scale_out(windows: Windows) -> None:
    """Where nothing is known of the air no scale is in the budget: the effects table says that it is missing."""
    result, _ = derived(windows, {})
    names = {c.name for c in result.budgets["amplitude"].contributions}
    assert names <= {"damping_law", "choice_of_law"}


def humid_air(celsius: np.ndarray, pascal: np.ndarray, humidity: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return density, viscosity and speed of sound of every draw."""
    density, sound = (np.vectorize(formula)(celsius, pascal, humidity) for formula in (air_density, speed_of_sound))
    return density, np.vectorize(air_viscosity)(celsius, pascal), sound


def test_propagation_against_monte_carlo(windows: Windows) -> None:
    """200,000 draws of all inputs through the model give the same u of every result, to 1.5 %, and the same value."""
    result, points = derived(windows, SCENE)
    damping = fit_damping(points, 0.0)
    (stated,) = result.laws  # one admissible law: nothing but a normal distribution is drawn
    joint, rng, n = stated.fit.joint, np.random.default_rng(20240401), 200_000
    assert joint.names == ("A0", "gamma", "beta")
    start, gamma, beta = rng.multivariate_normal(joint.values, joint.covariance, n).T
    omega = fit_phase(points, damping).angular_frequency
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
    whole = load + spring / 3 + spring**2 / load / 45
    squares = np.zeros(n)
    for t in points.t:
        decay = np.exp(-gamma * t)
        squares += (start * decay / (1 + beta * start * (1 - decay) / gamma)) ** 2
    velocity = rate * scale * np.sqrt(squares / points.t.size / 2)
    drawn = {
        "period": 2 * np.pi / rate,
        "spring_constant": (rate**2 + damping.squared_rate(points.t) * clock**2) * whole,
        "amplitude": start * scale,
        "damping_rate": (gamma + beta * start) * clock,
        "quality_factor": rate / clock / (2 * (gamma + beta * start)),
        "velocity_rms": velocity,
        "reynolds_number": density * velocity * disc / viscosity,
        "keulegan_carpenter_number": 2 * np.pi * start * scale / disc,
        "drag_coefficient": 3 * np.pi * whole * beta / scale * clock / (2 * rate * density * np.pi * disc**2 / 4),
    }
    assert set(drawn) <= set(result.estimates)
    for name, sample in drawn.items():
        found = result.estimates[name]
        assert found.u == pytest.approx(float(np.std(sample)), rel=0.015), name
        assert abs(found.value - float(np.mean(sample))) < 0.02 * found.u, name


def test_rate_is_the_average_over_laws(windows: Windows) -> None:
    """x = sum w_i x_i, u^2 = W + 5 B min(B/W, 1)^5: of the stated law one line, of the others another."""
    result, points = derived(windows, {}, periods=40)
    damping = fit_damping(points, 0.0)
    assert len(damping.admissible) > 1
    weights, rates = zip(*((one.weight, one.fit.damping_rate()) for one in result.laws), strict=True)
    mean = sum(w * rate.value for w, rate in zip(weights, rates, strict=True))
    own = sum(w * rate.u**2 for w, rate in zip(weights, rates, strict=True))
    between = sum(w * (rate.value - mean) ** 2 for w, rate in zip(weights, rates, strict=True))
    whole = own + 5.0 * between * min(between / own, 1.0) ** 5
    budget = result.budgets["damping_rate"]
    assert budget.estimate.value == pytest.approx(mean, rel=1e-9)
    assert part(budget, "damping_law") == pytest.approx(math.sqrt(weights[0]) * rates[0].u, rel=1e-4)
    assert math.hypot(part(budget, "damping_law"), part(budget, "choice_of_law")) == pytest.approx(
        math.sqrt(whole), rel=1e-4
    )


def test_coefficients_are_those_of_both_drags_where_one_alone_is_selected(windows: Windows) -> None:
    """Of a lone exponential that is selected the other term stands beside gamma, and gamma's u holds it."""
    t = 0.4 + 0.785 * np.arange(60)
    noise = np.random.default_rng(6).normal(0.0, 2e-5, t.size)
    points = windows(t, START * np.exp(-0.01 * t) + noise, omega=OMEGA, phase=OMEGA * t, u=(2e-5, 4e-4, 2e-5))
    damping = fit_damping(points, 0.0)
    assert damping.selected == "linear"
    phase, rest = fit_phase(points, damping), fit_rest(points)
    result = derive(points, damping, phase, rest, Scene.from_mapping(SCENE), (), instrument=NOMINAL)
    gamma, beta = result.coefficients["gamma"], result.coefficients["beta"]
    assert abs(beta.value) < 3.0 * beta.u
    assert gamma.u > 3.0 * damping.best.joint["gamma"].u
    # What users calculate from them knows how they hang together.
    together = gamma.ufloat + beta.ufloat * result.estimates["amplitude"].ufloat
    assert together.std_dev < 0.5 * gamma.u
    assert "drag_coefficient" not in result.estimates


def test_a_power_law_has_its_budget_too(windows: Windows) -> None:
    """c in m^(1-n)/s carries clock and scale to its power: 1 - 5/3 of the scale's; n carries neither."""
    t = 0.4 + 0.785 * np.arange(150)
    amplitude = (START ** (-2 / 3) + 2 / 3 * 0.08 * t) ** -1.5
    noise = np.random.default_rng(4).normal(0.0, 2e-5, t.size)
    points = windows(t, amplitude + noise, omega=OMEGA, phase=OMEGA * t, offset=0.22, u=(2e-5, 4e-4, 2e-5))
    damping = fit_damping(points, 0.0)
    assert damping.selected == "power"
    scene = Scene.from_mapping(SCENE)
    result = derive(points, damping, fit_phase(points, damping), fit_rest(points), scene, (), instrument=NOMINAL)
    c, n = result.coefficients["c"], result.coefficients["n"]
    assert (c.value, n.value) == (pytest.approx(0.08, abs=4 * c.u), pytest.approx(5 / 3, abs=4 * n.u))
    assert part(result.budgets["c"], "clock_rate") == pytest.approx(c.value * U_CRYSTAL, rel=1e-6)
    assert part(result.budgets["c"], "speed_of_sound_formula") == pytest.approx(c.value * (n.value - 1) * U_SOUND)
    assert {line.name for line in result.budgets["n"].contributions} == {"damping_law"}


def test_correlated_parameters_count_together() -> None:
    """x + y of two parameters with correlation -1/2 has u = 1 where u(x) = u(y) = 1, and one line in the budget."""
    inputs = Inputs()
    joint = Joint(("x", "y"), np.array([1.0, 2.0]), np.array([[1.0, -0.5], [-0.5, 1.0]]), ("m", "m"))
    x, y = inputs.add_joint("damping_law", joint, "A")
    budget = inputs.budget("sum", x + y, "m")
    assert budget.estimate.u == pytest.approx(1.0)
    assert [(c.name, c.kind, c.input, c.sensitivity) for c in budget.contributions] == [
        ("damping_law", "A", None, None)
    ]


def test_exact_inputs_leave_an_empty_budget() -> None:
    """What has no uncertainty is exact, and so is what is made of it."""
    inputs = Inputs()
    x = inputs.add("disc_diameter", Estimate(2.0, 0.0, "m"), "B")
    budget = inputs.budget("area", x**2, "m^2")
    assert (budget.estimate, budget.contributions) == (Estimate(4.0, 0.0, "m^2"), ())
    assert budget.u_of("B") == 0.0


@pytest.mark.parametrize("u", [-1e-3, math.nan, math.inf])
def test_impossible_uncertainties_are_refused(u: float) -> None:
    """A negative or missing uncertainty is one line that names the input, never a number."""
    with pytest.raises(AnalysisError, match="bob_mass: a standard uncertainty must be finite and not negative"):
        Inputs().add("bob_mass", Estimate(0.2, u, "kg"), "B")


def test_one_name_is_one_input() -> None:
    """Two inputs of one name would hide each other in the table."""
    inputs = Inputs()
    inputs.add("bob_mass", Estimate(0.2, 1e-4), "B")
    with pytest.raises(ValueError, match="'bob_mass' is there already"):
        inputs.add("bob_mass", Estimate(0.3, 1e-4), "B")


def test_parameters_fitted_together_are_the_packages_correlated_values() -> None:
    """Their sums and differences have the uncertainties that correlated_values gives, with an exact one among them."""
    covariance = np.array([[4e-10, -3e-9, 0.0], [-3e-9, 9e-8, 0.0], [0.0, 0.0, 0.0]])
    joint = Joint(("A0", "gamma", "mu"), np.array([0.05, 0.01, 0.0]), covariance, ("m", "1/s", "m/s"))
    ours = Inputs().add_joint("damping_law", joint, "A")
    theirs = correlated_values(joint.values, covariance)
    for weights in ([1.0, 0.0, 0.0], [0.0, 1.0, 2.0], [3.0, 0.5, -1.0], [1.0, -1.0, 0.0]):
        mine, other = (sum(w * x for w, x in zip(weights, some, strict=True)) for some in (ours, theirs))
        assert mine.nominal_value == pytest.approx(other.nominal_value, rel=1e-14)
        assert mine.std_dev == pytest.approx(other.std_dev, rel=1e-12)


def test_parameters_that_determine_each_other_count_once() -> None:
    """With a correlation of one the weighted difference is exact, whatever the units and though a pivot is zero."""
    u = np.array([1e-6, 2e3, 0.5])
    sign = np.array([1.0, -1.0, 1.0])
    x, y, z = Inputs().add_joint(
        "damping_law", Joint(("x", "y", "z"), np.ones(3), np.outer(sign * u, sign * u), ("",) * 3), "A"
    )
    for one, expected in ((x, u[0]), (y, u[1]), (z, u[2])):
        assert one.std_dev == pytest.approx(expected, rel=1e-12)
    # The package takes the matrix apart by its eigenvalues, which err by about n eps of its norm, here 3: 9 eps.
    assert (x / u[0] + y / u[1]).std_dev < np.sqrt(9.0 * np.finfo(np.float64).eps)
    assert (x / u[0] + z / u[2]).std_dev == pytest.approx(2.0, rel=1e-12)


def test_degrees_of_freedom_of_the_guides_example() -> None:
    """JCGM 100, G.4.1: a product of three means of 10, 5 and 15 observations, 0.25, 0.57 and 0.82 %, has 19.0."""
    inputs = Inputs()
    share = {"bob_mass": (0.0025, 9), "disc_diameter": (0.0057, 4), "noise": (0.0082, 14)}
    product = math.prod(inputs.add(name, Estimate(1.0, u), "A", dof) for name, (u, dof) in share.items())
    budget = inputs.budget("product", product, "")
    assert budget.estimate.u == pytest.approx(0.0103, rel=2e-3)
    assert budget.dof == pytest.approx(19.0, abs=0.05)
    assert budget.expanded == budget.coverage_factor * budget.estimate.u


@pytest.mark.parametrize(
    ("dof", "factor"), [(1, 13.97), (5, 2.65), (10, 2.28), (20, 2.13), (50, 2.05), (math.inf, 2.0)]
)
def test_coverage_factors_are_those_of_ea_4_02(dof: float, factor: float) -> None:
    """Student's t for 95.45 %, table E.1 there."""
    inputs = Inputs()
    x = inputs.add("noise", Estimate(1.0, 0.1), "A", dof)
    assert inputs.budget("x", x, "").coverage_factor == pytest.approx(factor, abs=0.005)


def test_only_what_scatter_told_has_few_degrees_of_freedom(windows: Windows) -> None:
    """Inputs from the scene count as known; the frequency's windows, less what is correlated, do not."""
    found, points = derived(windows, SCENE)
    budgets = found.budgets
    each = {c.name: c for budget in budgets.values() for c in budget.contributions}
    assert all(c.dof == math.inf for c in each.values() if c.kind == "B")
    assert each["angular_frequency"].dof <= points.t.size - 2
    assert each["damping_law"].dof == pytest.approx(budgets["gamma"].dof, rel=0.2)
    assert budgets["spring_constant"].coverage_factor == pytest.approx(2.0, abs=1e-3)


def test_estimates_carry_their_correlations(windows: Windows) -> None:
    """Period times frequency is exactly 1, and a product of estimates has the variance that their covariance gives."""
    found, _ = derived(windows, SCENE)
    period, frequency = found.estimates["period"], found.estimates["frequency"]
    assert (period * frequency).std_dev < 1e-12
    a, b = found.estimates["amplitude"], found.coefficients["beta"]
    joint = joint_of({"a": a, "b": b})
    expected = b.value**2 * joint.covariance[0, 0] + a.value**2 * joint.covariance[1, 1]
    expected += 2.0 * a.value * b.value * joint.covariance[0, 1]
    assert (a * b).std_dev == pytest.approx(math.sqrt(expected))
    assert abs(joint.correlation[0, 1]) > 0.1
    assert set(found.joint.names) == set(found.estimates) | set(found.coefficients)


def test_the_start_phase_turns_with_the_frequency(windows: Windows) -> None:
    """The phase at the start is extrapolated from the record's middle by the frequency, so both err together."""
    found, points = derived(windows, SCENE, Instrument("device", Estimate(1.0, 0.0), "none"))
    joint = joint_of({name: found.estimates[name] for name in ("angular_frequency", "phase")})
    way = 0.5 * (points.t[0] + points.t[-1])
    u_omega, u_phase = np.sqrt(np.diag(joint.covariance))
    assert joint.correlation[0, 1] == pytest.approx(-way * u_omega / u_phase, rel=0.02)
