"""What planning a run costs and tells: bounds instead of pilots where the run is short, predictions when asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.dynamics import Equation, Integrator, Problem, get_integrator
from pipeline.dynamics.choose import SAFETY_BOUND, choose
from pipeline.dynamics.integrators.taylor import TAYLOR
from pipeline.dynamics.terms import reduced, required

# gamma, drag, friction, cubic term, in units of the spring at the starting amplitude
MODERATE = [
    (0.0, 0.1, 0.0, 0.0),
    (0.02, 0.6, 0.0, 0.05),
    (1.5, 0.2, 0.0, 0.0),
    (2.8, 0.9, 0.1, 0.0),
    (0.004, 0.008, 0.0, 0.002),
    (0.0, 1e-3, 2e-4, 0.0),
    (0.01, 0.02, 0.05, -0.1),
    (0.0, 0.0, 0.0, 0.15),
    (0.0, 0.0, 0.01, -0.18),
    (0.1, 0.0, 0.2, 0.01),
]


def moderate(numbers: tuple[float, float, float, float], angle: float) -> Problem:
    """Return the problem of unit frequency and amplitude."""
    gamma, drag, friction, cubic = numbers
    return Problem(
        Equation(
            angular_frequency_per_s=1.0,
            gamma_per_s=gamma,
            drag_per_m=drag,
            friction_m_per_s2=friction,
            cubic_per_m2_s2=cubic,
        ),
        math.cos(angle),
        math.sin(angle),
    )


def error(integrator: Integrator, problem: Problem, step: float, count: int) -> float:
    """Return the largest error of the displacement over the amplitude."""
    return float(np.max(np.abs(integrator.run(problem, step, count).y - TAYLOR.run(problem, step, count).y)))


@pytest.mark.parametrize("angle", [0.0, 1.2])
@pytest.mark.parametrize("numbers", MODERATE)
@pytest.mark.parametrize(("step", "radians"), [(0.8, 40.0), (0.13, 12.0), (0.04, 300.0)])
def test_a_bound_lies_above_the_error(
    numbers: tuple[float, float, float, float], angle: float, step: float, radians: float
) -> None:
    """Of Strang splitting and of the averaged model, where they solve the problem; with what a choice adds besides."""
    problem, count = moderate(numbers, angle), round(radians / step)
    for integrator in (get_integrator("strang"), get_integrator("averaged")):
        if not integrator.refusal(problem):
            bound = integrator.bound(problem, step, step * count)
            assert error(integrator, problem, step, count) <= SAFETY_BOUND * bound < math.inf


def test_a_bound_is_near_the_error() -> None:
    """Half of them lie within three times the error: a choice by a bound is not much dearer than one by a pilot."""
    strang, ratios = get_integrator("strang"), []
    for numbers in MODERATE:
        for angle in (0.0, 1.2):
            problem = moderate(numbers, angle)
            if numbers[1] or numbers[3]:
                ratios.append(strang.bound(problem, 0.1, 60.0) / error(strang, problem, 0.1, 600))
    assert np.median(ratios) < 3.0


def test_no_bound_is_told_beyond_what_it_was_fitted_to() -> None:
    """Stiff drag, strong cubic terms and runs of millions of radians take a pilot."""
    strang = get_integrator("strang")
    for numbers in ((10.0, 0.1, 0.0, 0.0), (0.0, 3.0, 0.0, 0.0), (0.0, 0.1, 0.0, 1.0), (0.0, 0.1, 0.8, 0.0)):
        assert strang.bound(moderate(numbers, 0.0), 0.1, 60.0) == math.inf
    usual = moderate((0.0, 0.1, 0.0, 0.0), 0.0)
    assert strang.bound(usual, 0.1, 60.0) < math.inf
    assert strang.bound(usual, 0.1, 3e6) == strang.bound(usual, 3.0, 60.0) == math.inf
    assert get_integrator("rk4").bound(usual, 0.1, 60.0) == math.inf


@pytest.mark.parametrize("numbers", MODERATE)
def test_a_short_run_is_planned_without_a_step(
    numbers: tuple[float, float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is solved before the run: it would take longer than the run. The error is predicted when asked for."""
    made: list[int] = []
    for name in ("strang", "averaged", "taylor", "rk4"):
        kind = type(get_integrator(name))
        march = kind.march
        monkeypatch.setattr(kind, "march", lambda *given, march=march: made.append(given[3]) or march(*given))
    problem = moderate(numbers, 0.0)
    choice = choose(problem, 0.2, 60, 1e-5)
    assert not made
    truth = TAYLOR.run(problem, 0.2, 60).y
    assert np.max(np.abs(choice.run(60).y - truth)) <= 1e-5
    assert 0.0 < choice.predicted_error <= 1e-5
    assert choice.predicted_error == choice.integrator.predicted_error(choice.problem, choice.step_s, 12.0)
    assert 0.0 < choice.predicted_velocity_error < math.inf


def test_a_long_run_is_planned_by_a_pilot() -> None:
    """Where it costs little beside the run: fewer steps than the bound asks for."""
    problem = moderate((0.0, 0.3, 0.0, 0.1), 0.0)
    strang, choice = get_integrator("strang"), choose(problem, 0.2, 5000, 1e-6)
    assert choice.integrator.name == "strang"
    assert strang.bound(problem, choice.step_s, 1000.0) > 1e-6 >= choice.predicted_error


def test_a_choice_tells_what_it_left_out() -> None:
    """The same problem and terms as by themselves; what is left out counts in the predicted errors."""
    problem = moderate((1e-7, 0.02, 0.0, 0.0), 0.0)
    choice = choose(problem, 0.1, 300, 1e-4)
    solved, terms = required(problem, 30.0, 1e-4)
    assert choice.terms == terms
    assert [term.name for term in terms if term.included] == ["quadratic_drag"]
    assert choice.problem.equation.gamma_per_s == solved.equation.gamma_per_s == 0.0
    assert choice.left_out == reduced(problem, 30.0, 1e-4)[1] == sum(term.size for term in terms if not term.included)
    alone = choice.integrator.predicted_error(choice.problem, choice.step_s, 30.0)
    assert choice.predicted_error == alone + choice.left_out > alone
