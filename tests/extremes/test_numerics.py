"""What breaks a trajectory, and how: each case with the figure that it must show, and none of them quiet."""

import math

import numpy as np
import pytest

from pipeline.errors import DynamicsError
from pipeline.simulation import INTEGRATORS, Equation, Problem, get_integrator, halving, methods
from pipeline.simulation.halving import auto

OMEGA = 8.66
FREE = Equation(angular_frequency_per_s=OMEGA)
MIXED = Equation.from_laws(OMEGA, gamma_per_s=0.0073, beta_per_m_s=0.235)


def test_times_do_not_accumulate() -> None:
    """A sum of 1e7 hundredths is off by 1.4e-5 s; the times of a run are not off at all."""
    count = 10_000_000
    run = get_integrator("exact").run(Problem(FREE, 0.05), 0.01, count, every=1000)
    assert run.t[-1] == 1e5
    np.testing.assert_array_equal(run.t, 10.0 * np.arange(count // 1000 + 1))


@pytest.mark.parametrize("size", [1e4, 1e8, 1e30])
def test_drag_beyond_all_steps(size: float) -> None:
    """With beta |v| h >> 1 Strang is bounded; an explicit method says that it ran away."""
    problem = Problem(MIXED, size)
    assert np.all(np.abs(get_integrator("strang").run(problem, 0.01, 1000).y) <= size)
    for name in ("forward-euler", "symplectic-euler", "rk4"):
        with pytest.raises(DynamicsError, match=f"{name} .*beyond the range of numbers.*take .*auto"):
            get_integrator(name).run(problem, 0.01, 1000)


@pytest.mark.parametrize("ratio", [0.0, 1e-8, 0.5, 1.0 - 2.0**-53, 1.0, 1.0 + 2.0**-52, 2.0, 1e3, 1e6])
@pytest.mark.parametrize("x", [1e-8, 1e-3, 1.0, 10.0])
@pytest.mark.parametrize("name", ["exact", "strang"])
def test_no_damping_and_no_step_is_too_much(name: str, ratio: float, x: float) -> None:
    """gamma / omega from 0 through exactly 1 to 1e6, omega h from 1e-8 to 10: finite, bounded, without a warning.

    Over a time in which gamma t passes 710 too, where an exponential alone overflows.
    """
    equation = Equation(angular_frequency_per_s=OMEGA, gamma_per_s=ratio * OMEGA)
    run = get_integrator(name).run(Problem(equation, 0.05), x / OMEGA, 2000, every=10)
    assert np.all(np.isfinite(run.y))
    assert np.all(np.abs(run.y) <= 0.05 * (1.0 + 1e-11))
    assert np.all(np.diff(run.relative_energy()) <= 1e-11)
    assert ratio or run.relative_energy() == pytest.approx(1.0, abs=1e-11)


def test_friction_stops_the_bob_where_it_must() -> None:
    """With f = 0.5 m/s^2 it rests at -3.336 mm and does not creep: located turning points, and the latch."""
    problem = Problem(Equation(angular_frequency_per_s=OMEGA, friction_m_per_s2=0.5), 0.05)
    run = get_integrator("strang").run(problem, 0.01, 1000)
    assert run.y[-1] == pytest.approx(-3.336e-3, abs=1e-6)
    assert np.ptp(run.y[-500:]) == 0.0
    assert not run.v[-500:].any()
    with pytest.raises(DynamicsError, match=r"dop853 .*turning points.*take strang or auto"):
        get_integrator("dop853").run(problem, 0.01, 10)


@pytest.mark.parametrize("friction", [1e-12, 1.0, 1e6, 1e12])
def test_any_friction_ends_at_rest(friction: float) -> None:
    """From next to none to overwhelming, from speed as well: finite, and held where the spring cannot pull."""
    problem = Problem(Equation(angular_frequency_per_s=OMEGA, friction_m_per_s2=friction), 0.05, 0.2)
    run = get_integrator("strang").run(problem, 0.01, 500)
    assert np.all(np.isfinite(run.y))
    if friction >= 1.0:
        assert run.v[-1] == 0.0
        assert abs(OMEGA**2 * run.y[-1]) <= friction


@pytest.mark.parametrize("size", [1e31, 1e300, math.nan, math.inf, -math.inf])
def test_sizes_beyond_every_bench_and_what_is_no_number_are_refused(size: float) -> None:
    """One line names the quantity, in a start and in each coefficient, before anything runs."""
    for make in (
        lambda: Problem(FREE, size),
        lambda: Problem(FREE, 0.05, size),
        lambda: Equation(angular_frequency_per_s=size),
        lambda: Equation(angular_frequency_per_s=OMEGA, drag_per_m=size),
        lambda: Equation(angular_frequency_per_s=OMEGA, cubic_per_m2_s2=-size),
    ):
        with pytest.raises(DynamicsError, match=r"_.* must be ") as caught:
            make()
        assert "\n" not in str(caught.value)


def test_a_softening_spring_lets_nothing_escape() -> None:
    """A start beyond the point where the spring would pull is refused; just inside it stays bounded."""
    equation = Equation(angular_frequency_per_s=OMEGA, cubic_per_m2_s2=-(OMEGA**2) / 0.1**2)
    for start in ((0.1, 0.0), (0.2, 0.0), (0.0, OMEGA * 0.0708)):
        with pytest.raises(DynamicsError, match="softening"):
            Problem(equation, *start)
    run = get_integrator("dop853").run(Problem(equation, 0.099), 0.01, 1000)
    assert np.all(np.abs(run.y) <= 0.099 * (1.0 + 1e-10))


EXTREMES = (
    *(0.0, -0.0, 1e-12, 1.0, 1e12, 1e100, 1e155, 1e300, 1.7e308),
    *(math.inf, -math.inf, math.nan, -1.0, -1e300),
)
TERMS = {"gamma_per_s": 0.7, "drag_per_m": 0.6, "friction_m_per_s2": 0.4, "cubic_per_m2_s2": 0.3}


def value(rng: np.random.Generator, tame: float) -> float:
    """Return a number near 1 with some probability, else of many powers of ten, else an extreme."""
    draw = rng.random()
    if draw < tame:
        return float(10.0 ** rng.uniform(-3.0, 2.0))
    if draw < 0.9:
        return float(10.0 ** rng.uniform(-12.0, 12.0)) * (1.0 if rng.random() < 0.9 else -1.0)
    return EXTREMES[rng.integers(len(EXTREMES))]


@pytest.mark.trials
@pytest.mark.parametrize("seed", range(4))
def test_every_number_is_answered_by_numbers_or_one_line(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 1e-12 to 1e12, and extremes to refuse: warnings are errors, so are overflows and NaN."""
    # What would take minutes gives up after moments, by the same way.
    monkeypatch.setattr(halving, "MOST_STEPS", 50_000)
    monkeypatch.setattr(methods, "MOST_CALLS", 5_000)
    rng = np.random.default_rng((61, seed))
    refusals, solved = [], 0
    for _ in range(150):
        terms = {name: value(rng, 0.5) for name, share in TERMS.items() if rng.random() < share}
        omega, start, step = value(rng, 0.7), (value(rng, 0.5), value(rng, 0.5)), value(rng, 0.8)
        method, tolerance = get_integrator(str(rng.choice(list(INTEGRATORS)))), float(10.0 ** rng.uniform(-13.0, 0.0))
        for solve in (
            lambda problem, step=step, method=method: method.run(problem, step, 40, every=4),
            lambda problem, step=step, most=tolerance: auto(problem, step, 40, most).trajectory,
        ):
            try:
                run = solve(Problem(Equation(angular_frequency_per_s=omega, **terms), *start))
            except DynamicsError as error:
                refusals.append(str(error))
                continue
            solved += 1
            for each in (run.t, run.y, run.v, run.at(np.array([0.0, step, 40.0 * step]))):
                assert np.isfinite(each).all()
            assert not np.isnan(run.relative_energy()).any()
    assert solved > 50
    assert refusals
    assert not [line for line in refusals if "\n" in line]


def test_a_run_that_would_not_end_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number of calls is the end of an adaptive method, and its line says what to take instead."""
    monkeypatch.setattr(methods, "MOST_CALLS", 5_000)
    problem = Problem(Equation.from_laws(8.66, beta_per_m_s=0.235), 0.05)
    with pytest.raises(DynamicsError, match=r"dop853 .*take .*strang or auto"):
        get_integrator("dop853").run(problem, 1.0, 10_000)
