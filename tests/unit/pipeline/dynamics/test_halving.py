"""Step halving: the stated error covers the true one, and what cannot be solved or stated is refused with a reason."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.dynamics import Equation, Problem, get_integrator
from pipeline.dynamics.halving import auto, halved, solved_once
from pipeline.dynamics.rounding import least_tolerance
from pipeline.dynamics.terms import required
from pipeline.errors import DynamicsError

STORED = json.loads((Path(__file__).resolve().parents[3] / "reference" / "dynamics.json").read_text())
STEP = STORED["step_s"]
MIXED = Problem(Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235), 0.05)


def problem_of(case: dict[str, Any]) -> Problem:
    """Return the problem of a stored case."""
    return Problem(Equation(**case["equation"]), case["displacement_m"], case["velocity_m_per_s"])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("name", STORED["cases"])
def test_the_stated_error_covers_the_true_one(name: str, tolerance: float) -> None:
    """Against 40 digits ``auto`` errs by no more than it states, in displacement and velocity."""
    case = STORED["cases"][name]
    problem, rows = problem_of(case), [row for row in case["rows"] if row <= 3000]
    solution = auto(problem, STEP, rows[-1], tolerance)
    size = problem.amplitude_m()
    y, v = (np.array([float(each) for each in case[key]][: len(rows)]) for key in ("y", "v"))
    assert solution.error is not None
    assert solution.velocity_error is not None
    assert np.max(np.abs(solution.trajectory.y[rows] - y)) / size <= solution.error <= tolerance
    speed = size * problem.equation.angular_frequency_per_s
    assert np.max(np.abs(solution.trajectory.v[rows] - v)) / speed <= solution.velocity_error


@pytest.mark.parametrize(
    "name", ["symplectic-euler", "verlet", "yoshida4", "rk4", "strang", "exact", "lsoda", "dop853"]
)
def test_a_method_by_name_is_halved_until_it_keeps_the_tolerance(name: str) -> None:
    """Its true error is at most the stated one, which is within the tolerance."""
    case = STORED["cases"]["linear" if name == "exact" else "mixed"]
    rows = [row for row in case["rows"] if row <= 1000]
    tolerance = 1e-2 if name == "symplectic-euler" else 1e-5
    solution = halved(problem_of(case), get_integrator(name), STEP, rows[-1], tolerance)
    truth = np.array([float(each) for each in case["y"]][: len(rows)])
    assert solution.error is not None
    assert np.max(np.abs(solution.trajectory.y[rows] - truth)) / 0.05 <= solution.error <= tolerance


@pytest.mark.parametrize("name", ["forward-euler", "symplectic-euler", "verlet", "yoshida4", "rk4"])
def test_friction_leaves_no_estimate_where_turning_points_are_not_located(name: str) -> None:
    """A run in a given step has no error and a reason; a tolerance is refused."""
    problem = Problem(Equation.from_laws(8.66, mu_m_per_s=1e-3), 0.05)
    integrator = get_integrator(name)
    solution = solved_once(problem, integrator, 0.001, 100)
    assert solution.error is solution.velocity_error is None
    assert "friction" in solution.no_estimate
    with pytest.raises(DynamicsError, match="friction"):
        halved(problem, integrator, 0.001, 100, 1e-3)


def test_the_error_of_a_given_step_is_that_of_the_longer_run() -> None:
    """Half the step shows three quarters of the error of a method of order two; the rest is added."""
    verlet, truth = get_integrator("verlet"), get_integrator("strang").run(MIXED, 0.001, 4000, every=10).y
    solution = solved_once(MIXED, verlet, 0.01, 400)
    assert solution.parts == 1
    assert solution.error == pytest.approx(np.max(np.abs(solution.trajectory.y - truth)) / 0.05, rel=0.05)


def test_halving_ends_where_rounding_is_all_that_is_left() -> None:
    """Without drag Strang splitting is exact but for rounding, which no shorter step reduces."""
    problem = Problem(Equation(angular_frequency_per_s=8.66), 0.05)
    with pytest.raises(DynamicsError, match="rounding"):
        halved(problem, get_integrator("strang"), 0.01, 12_000, 1e-15)


def test_a_run_of_too_many_steps_is_refused_before_it_is_made() -> None:
    """Forward Euler at 1e-9 needs more steps than anybody waits for."""
    with pytest.raises(DynamicsError, match="too many steps"):
        halved(MIXED, get_integrator("forward-euler"), 0.01, 1000, 1e-9)


def test_auto_takes_the_exact_flow_of_a_linear_scene_then_strang_then_dop853() -> None:
    """Each where the one before cannot keep the tolerance."""
    linear = Problem(Equation(angular_frequency_per_s=8.66, gamma_per_s=0.01), 0.05)
    assert auto(linear, 0.01, 1000, 1e-12).integrator.name == "exact"
    assert auto(MIXED, 0.01, 1000, 1e-8).integrator.name == "strang"
    cubic = Problem(Equation(angular_frequency_per_s=1.0, cubic_per_m2_s2=1.0), 1.0)
    assert auto(cubic, 0.1, 200, 1e-8).integrator.name == "strang"
    assert auto(cubic, 0.1, 200, 1e-11).integrator.name == "dop853"


def test_what_is_left_out_counts_in_the_stated_error() -> None:
    """The terms are those that the tolerance requires, and the sizes of the others are added."""
    problem = Problem(Equation(angular_frequency_per_s=1.0, gamma_per_s=1e-7, drag_per_m=0.02), 1.0)
    solution = auto(problem, 0.1, 300, 1e-4)
    solved, terms = required(problem, 30.0, 1e-4)
    assert solution.terms == terms
    assert solution.problem.equation.gamma_per_s == solved.equation.gamma_per_s == 0.0
    left_out = sum(term.size for term in terms if not term.included)
    alone = halved(solved, solution.integrator, 0.1, 300, 1e-4 - left_out)
    assert solution.error == alone.error + left_out > left_out > 0.0


def test_a_tolerance_out_of_reach_is_refused() -> None:
    """Below twice the rounding of the phase, and for what is no tolerance; at it the exact flow is taken."""
    problem = Problem(Equation(angular_frequency_per_s=8.66), 0.05)
    least = least_tolerance(problem, 120.0)
    assert 1e-13 <= least < 1e-12
    for tolerance in (0.5 * least, 0.0, -1.0, math.nan, math.inf):
        with pytest.raises(DynamicsError, match="tolerance must be finite and at least"):
            auto(problem, 0.01, 12_000, tolerance)
    assert auto(problem, 0.01, 12_000, least).integrator.name == "exact"


def test_only_the_returned_run_is_timed() -> None:
    """A clock that ticks once a call gives one tick to the run."""
    ticks = iter(range(100))
    assert auto(MIXED, 0.01, 100, 1e-6, lambda: float(next(ticks))).running_s == 1.0
