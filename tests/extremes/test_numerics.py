"""What breaks a trajectory, and how: each case with the figure that it must show, and none of them quiet."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from pipeline.dynamics import INTEGRATORS, Equation, Problem, get_integrator
from pipeline.errors import DynamicsError

STORED = json.loads((Path(__file__).resolve().parents[1] / "reference" / "dynamics.json").read_text())["cases"]
OMEGA = 8.66
FREE = Equation(angular_frequency_per_s=OMEGA)
MIXED = Equation.from_laws(OMEGA, gamma_per_s=0.0073, beta_per_m_s=0.235)
EXPLICIT = ("forward-euler", "symplectic-euler", "verlet", "yoshida4", "rk4")
UNBOUNDED = ("exact", "strang")


def limit(name: str, ratio: float) -> float:
    """Return the largest stable omega h at a damping ratio."""
    equation = Equation(angular_frequency_per_s=OMEGA, gamma_per_s=ratio * OMEGA)
    return OMEGA * get_integrator(name).stable_step(Problem(equation, 0.05))


@pytest.mark.parametrize(
    ("name", "expected"), [("symplectic-euler", 2.0), ("verlet", 2.0), ("rk4", 2.8284), ("yoshida4", 1.5734)]
)
def test_undamped_limits(name: str, expected: float) -> None:
    """Undamped, omega h may be 2.000, 2.000, 2.828 and 1.573: just inside no energy is gained, just outside it is."""
    method, problem = get_integrator(name), Problem(FREE, 0.05)
    inside, outside = (method.run(problem, x * expected / OMEGA, 400, every=200) for x in (0.998, 1.002))
    assert inside.relative_energy()[-1] < 1e4
    assert outside.relative_energy()[-1] > 2.0 * outside.relative_energy()[1] > 2.0


@pytest.mark.parametrize("name", UNBOUNDED)
@pytest.mark.parametrize("x", [0.1, 1.0, 2.0, 5.0, 10.0])
def test_exact_flows_have_no_limit(name: str, x: float) -> None:
    """Strang and the exact propagator keep the energy to 1e-11 up to omega h = 10."""
    run = get_integrator(name).run(Problem(FREE, 0.05), x / OMEGA, 10_000)
    assert math.isinf(limit(name, 0.0))
    np.testing.assert_allclose(run.relative_energy(), 1.0, atol=1e-11)


def test_times_do_not_accumulate() -> None:
    """A sum of 1e7 hundredths is off by 1.4e-5 s (in float32 by 4319 s); the times of a run are not off at all."""
    count = 10_000_000
    assert np.cumsum(np.full(count, 0.01))[-1] - 1e5 == pytest.approx(-1.4e-5, abs=0.2e-5)
    narrow = np.cumsum(np.full(count, 0.01, np.float32), dtype=np.float32)
    assert float(narrow[-1]) - 1e5 == pytest.approx(-4319.0, abs=5.0)
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


@pytest.mark.parametrize("size", [1e-100, 1e-12, 1e12])
@pytest.mark.parametrize("name", [*EXPLICIT[1:], "exact", "strang", "dop853"])
def test_every_amplitude_moves_alike(name: str, size: float) -> None:
    """A linear motion of any amplitude is the one at 1 m, scaled; so is its relative energy."""
    equation = Equation(angular_frequency_per_s=OMEGA, gamma_per_s=0.1)
    method = get_integrator(name)
    one = method.run(Problem(equation, 1.0), 0.01, 300)
    run = method.run(Problem(equation, size), 0.01, 300)
    tolerance = 1e-5 if name == "dop853" else 1e-12
    np.testing.assert_allclose(run.y / size, one.y, rtol=0, atol=tolerance)
    np.testing.assert_allclose(run.relative_energy(), one.relative_energy(), rtol=10 * tolerance)


@pytest.mark.parametrize("size", [1e31, 1e155, 1e300])
def test_sizes_beyond_every_bench_are_refused(size: float) -> None:
    """One line names the quantity, in a start and in each coefficient."""
    for make in (
        lambda: Problem(FREE, size),
        lambda: Problem(FREE, 0.05, size),
        lambda: Equation(angular_frequency_per_s=OMEGA, drag_per_m=size),
        lambda: Equation(angular_frequency_per_s=OMEGA, cubic_per_m2_s2=-size),
    ):
        with pytest.raises(DynamicsError, match=r"_m.* must be a number of at most 1e\+30 in SI units") as caught:
            make()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["critical", "nearly critical", "overdamped", "a thousand times overdamped"])
def test_every_damping_keeps_its_digits(name: str) -> None:
    """At gamma = omega, a hair beside it, and at 1000 omega the exact flow errs by at most 8e-15."""
    case = STORED[name]
    problem = Problem(Equation(**case["equation"]), case["displacement_m"], case["velocity_m_per_s"])
    run = get_integrator("exact").run(problem, 0.01, case["rows"][-1])
    truth = np.array([float(y) for y in case["y"]])
    assert np.max(np.abs(run.y[case["rows"]] - truth)) / 0.05 <= 8e-15


@pytest.mark.parametrize("ratio", [0.0, 1e-8, 0.5, 1.0 - 2.0**-53, 1.0, 1.0 + 2.0**-52, 2.0, 1e3, 1e6])
@pytest.mark.parametrize("x", [1e-8, 1e-3, 1.0, 10.0])
@pytest.mark.parametrize("name", UNBOUNDED)
def test_no_damping_and_no_step_is_too_much(name: str, ratio: float, x: float) -> None:
    """gamma / omega from 0 through exactly 1 to 1e6, omega h from 1e-8 to 10: finite, bounded, without a warning.

    Over a time in which gamma t passes 710 too, where an exponential alone overflows.
    """
    equation = Equation(angular_frequency_per_s=OMEGA, gamma_per_s=ratio * OMEGA)
    run = get_integrator(name).run(Problem(equation, 0.05), x / OMEGA, 2000, every=10)
    assert np.all(np.isfinite(run.y))
    assert np.all(np.abs(run.y) <= 0.05 * (1.0 + 1e-11))
    assert np.all(np.diff(run.relative_energy()) <= 1e-11)


def test_friction_stops_the_bob_where_it_must() -> None:
    """With f = 0.5 m/s^2 it rests at -3.336 mm and does not creep: located turning points, and the latch."""
    problem = Problem(Equation(angular_frequency_per_s=OMEGA, friction_m_per_s2=0.5), 0.05)
    run = get_integrator("strang").run(problem, 0.01, 1000)
    assert run.y[-1] == pytest.approx(-3.336e-3, abs=1e-6)
    assert np.ptp(run.y[-500:]) == 0.0
    assert not run.v[-500:].any()
    with pytest.raises(DynamicsError, match=r"dop853 .*turning points.*take strang or auto"):
        get_integrator("dop853").run(problem, 0.01, 10)


@pytest.mark.parametrize("name", ["strang"])
@pytest.mark.parametrize("friction", [1e-12, 1.0, 1e6, 1e12])
def test_any_friction_ends_at_rest(name: str, friction: float) -> None:
    """From next to none to overwhelming, from speed as well: finite, and held where the spring cannot pull."""
    problem = Problem(Equation(angular_frequency_per_s=OMEGA, friction_m_per_s2=friction), 0.05, 0.2)
    run = get_integrator(name).run(problem, 0.01, 500)
    assert np.all(np.isfinite(run.y))
    if friction >= 1.0:
        assert run.v[-1] == 0.0
        assert abs(OMEGA**2 * run.y[-1]) <= friction


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_state_that_is_no_number_is_refused(name: str, bad: float) -> None:
    """NaN and infinity in a state or a coefficient are one line before anything runs."""
    for make in (
        lambda: Problem(FREE, bad),
        lambda: Problem(FREE, 0.05, bad),
        lambda: Equation(angular_frequency_per_s=bad),
    ):
        with pytest.raises(DynamicsError, match="must be") as caught:
            get_integrator(name).run(make(), 0.01, 10)
        assert "\n" not in str(caught.value)


def test_a_softening_spring_lets_nothing_escape() -> None:
    """A start beyond the point where the spring would pull is refused; just inside it stays bounded."""
    equation = Equation(angular_frequency_per_s=OMEGA, cubic_per_m2_s2=-(OMEGA**2) / 0.1**2)
    for start in ((0.1, 0.0), (0.2, 0.0), (0.0, OMEGA * 0.0708)):
        with pytest.raises(DynamicsError, match="softening"):
            Problem(equation, *start)
    run = get_integrator("dop853").run(Problem(equation, 0.099), 0.01, 1000)
    assert np.all(np.abs(run.y) <= 0.099 * (1.0 + 1e-10))
