"""Every integrator passes ``springmass.testing`` and errs little against forty digits; limits of growth are ours."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import DynamicsError
from pipeline.simulation import INTEGRATORS, Equation, Integrator, Problem, Trajectory, get_integrator
from springmass.testing import check
from tests.sampling import sampled

STORED = json.loads((Path(__file__).resolve().parents[1] / "reference" / "dynamics.json").read_text())
STEP = STORED["step_s"]
# The largest error over the amplitude in a quarter of the stored step, where nothing rubs and the drag is not strong.
LARGEST = {
    "forward-euler": math.inf,
    "symplectic-euler": 0.1,
    "verlet": 0.05,
    "yoshida4": 2e-3,
    "rk4": 1e-5,
    "exact": 1e-12,
    "strang": 5e-6,
    "dop853": 1e-5,
}


@pytest.fixture(params=INTEGRATORS)
def integrator(request: pytest.FixtureRequest) -> Integrator:
    """Return each integrator by its name."""
    return get_integrator(request.param)


def test_it_keeps_the_rules_for_integrators(integrator: Integrator) -> None:
    """Its error falls by its order, its states do not depend on which are kept, and it refuses what cannot be."""
    check(integrator)


def problem_of(case: dict[str, Any]) -> Problem:
    """Return the problem of a stored case."""
    return Problem(Equation(**case["equation"]), case["displacement_m"], case["velocity_m_per_s"])


def error_of(case: dict[str, Any], trajectory: Trajectory) -> float:
    """Return the largest error over the amplitude at the stored times."""
    truth = np.array([float(y) for y in case["y"]])
    return float(np.max(np.abs(trajectory.y[case["rows"]] - truth))) / trajectory.problem.amplitude_m()


@pytest.mark.parametrize("name", sampled(STORED["cases"], 6))
def test_the_error_against_forty_digits_is_small(integrator: Integrator, name: str) -> None:
    """Against a reference that shares no code each method errs by no more than its order lets it, or refuses."""
    case = STORED["cases"][name]
    chosen = [k for k, row in enumerate(case["rows"]) if row <= 3000]
    case = {**case, "rows": [case["rows"][k] for k in chosen], "y": [case["y"][k] for k in chosen]}
    problem, steps = problem_of(case), case["rows"][-1]
    if integrator.refusal(problem):
        with pytest.raises(DynamicsError, match=integrator.name):
            integrator.run(problem, STEP, steps)
        return
    parts = 4 if integrator.order else 1
    if integrator.stable_step(problem) < STEP / parts:
        return  # another test covers such a step
    if integrator.name in ("verlet", "yoshida4", "rk4") and problem.equation.gamma_per_s * STEP > 1.0:
        return  # a step does not resolve the drag
    result = error_of(case, integrator.run(problem, STEP / parts, steps * parts, every=parts))
    assert result <= (LARGEST[integrator.name] if not integrator.no_estimate(problem) else 0.1)


@pytest.mark.parametrize(
    ("drag_per_m", "cubic_per_m2_s2"), [(0.0, 0.002), (0.0, -0.05), (0.05, 0.0), (0.002, 0.05)], ids=str
)
def test_located_turning_points_leave_the_order_as_it_is(drag_per_m: float, cubic_per_m2_s2: float) -> None:
    """With friction Strang's error over fifty turning points falls about as the square of the step, or faster."""
    problem = Problem(
        Equation(
            angular_frequency_per_s=1.0, drag_per_m=drag_per_m, friction_m_per_s2=0.001, cubic_per_m2_s2=cubic_per_m2_s2
        ),
        0.9,
        0.3,
    )
    strang, truth = get_integrator("strang"), get_integrator("strang").run(problem, 0.1 / 64, 1600 * 64, every=64).y
    errors = [
        float(np.max(np.abs(strang.run(problem, 0.1 / parts, 1600 * parts, every=parts).y - truth)))
        for parts in (1, 2, 4, 8)
    ]
    assert np.all(np.divide(errors[:-1], errors[1:]) > 2.5)
    assert errors[0] / errors[-1] > 30.0


@pytest.mark.parametrize("name", ["forward-euler", "symplectic-euler", "verlet", "strang"])
def test_inside_the_limit_nothing_grows_and_beyond_it_all_does(name: str) -> None:
    """Free linear motion stays bounded at 0.99 of the limit; at 1.02 of it the energy grows without end."""
    integrator = get_integrator(name)
    for ratio in (0.05, 1.0, 30.0):
        problem = Problem(Equation(angular_frequency_per_s=8.66, gamma_per_s=8.66 * ratio), 0.05)
        limit = integrator.stable_step(problem)
        if math.isinf(limit):
            run = integrator.run(problem, 10.0 / 8.66, 500)
            assert np.all(np.abs(run.y) <= 0.05 * (1.0 + 1e-12))
            continue
        inside = integrator.run(problem, 0.99 * limit, 20_000, every=20_000)
        assert inside.relative_energy()[-1] < 0.5
        grown = integrator.run(problem, 1.02 * limit, 500, every=500)
        assert grown.relative_energy()[-1] > 1.05
