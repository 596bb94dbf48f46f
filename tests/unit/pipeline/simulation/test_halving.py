"""Step halving: the stated error covers the true one, and what cannot be solved or stated is refused with a reason."""

import math

import numpy as np
import pytest

from pipeline.errors import DynamicsError
from pipeline.simulation import Equation, Problem, get_integrator
from pipeline.simulation.halving import auto, halved, solved_once
from tests.conformance.test_integrators import STEP, STORED, problem_of
from tests.sampling import sampled


@pytest.mark.parametrize("tolerance", sampled([1e-9, 1e-3], 1))
@pytest.mark.parametrize("name", sampled(STORED["cases"], 8))
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


@pytest.mark.parametrize("name", ["symplectic-euler", "verlet", "yoshida4", "rk4", "strang", "exact"])
def test_a_method_by_name_is_halved_until_it_keeps_the_tolerance(name: str) -> None:
    """Its true error is at most the stated one, which is within the tolerance."""
    case = STORED["cases"]["linear" if name == "exact" else "mixed"]
    rows = [row for row in case["rows"] if row <= 1000]
    tolerance = 1e-2 if name == "symplectic-euler" else 1e-5
    solution = halved(problem_of(case), get_integrator(name), STEP, rows[-1], tolerance)
    truth = np.array([float(each) for each in case["y"]][: len(rows)])
    assert solution.error is not None
    assert np.max(np.abs(solution.trajectory.y[rows] - truth)) / 0.05 <= solution.error <= tolerance


@pytest.mark.parametrize("name", ["verlet", "rk4"])
def test_friction_leaves_no_estimate_where_turning_points_are_not_located(name: str) -> None:
    """A run in a given step has no error and a reason; a tolerance is refused."""
    problem = Problem(Equation.from_laws(8.66, mu_m_per_s=1e-3), 0.05)
    integrator = get_integrator(name)
    solution = solved_once(problem, integrator, 0.001, 100)
    assert solution.error is solution.velocity_error is None
    assert solution.no_estimate
    with pytest.raises(DynamicsError):
        halved(problem, integrator, 0.001, 100, 1e-3)


def test_a_tolerance_out_of_reach_is_refused() -> None:
    """Below twice the rounding of the phase, and for what is no tolerance; at it the exact flow is taken."""
    problem = Problem(Equation(angular_frequency_per_s=8.66), 0.05)
    with pytest.raises(DynamicsError, match="at least") as caught:
        auto(problem, 0.01, 12_000, 1e-15)
    least = 1.05 * float(str(caught.value).split("at least ")[1].split(",")[0])
    assert 1e-13 <= least < 1e-12
    for tolerance in (0.5 * least, 0.0, -1.0, math.nan, math.inf):
        with pytest.raises(DynamicsError):
            auto(problem, 0.01, 12_000, tolerance)
    assert auto(problem, 0.01, 12_000, least).integrator.name == "exact"
