"""Predictions of an error: their leading terms, what they cost, and what becomes of them in a long run."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.dynamics import Equation, Problem, get_integrator
from pipeline.dynamics.integrators.taylor import TAYLOR
from pipeline.dynamics.prediction.envelope import frequency
from pipeline.dynamics.prediction.rounding import sheared_rounding
from pipeline.dynamics.terms import required

WEAK = [(0.01, 0.0, 0.005), (0.0, 0.01, 0.0), (0.004, 0.008, 0.0), (0.001, 0.02, -0.01), (0.0, 0.0, 0.02)]


@pytest.mark.parametrize("method", ["strang", "averaged"])
@pytest.mark.parametrize("angle", [0.0, 1.2])
@pytest.mark.parametrize(("gamma", "drag", "cubic"), WEAK)
def test_leading_terms_are_those_of_the_error(
    method: str, angle: float, gamma: float, drag: float, cubic: float
) -> None:
    """Where drag and cubic term are weak the closed form is the error, at most a fifth short, ten times too large."""
    problem = Problem(
        Equation(angular_frequency_per_s=1.0, gamma_per_s=gamma, drag_per_m=drag, cubic_per_m2_s2=cubic),
        math.cos(angle),
        math.sin(angle),
    )
    integrator, step, count = get_integrator(method), 0.143, 3000
    predicted = integrator.predicted_error(problem, step, step * count)
    found = np.max(np.abs(integrator.run(problem, step, count).y - TAYLOR.run(problem, step, count).y))
    assert 0.1 * predicted <= found <= 1.25 * predicted


@pytest.mark.parametrize("steps_a_cycle", [40.03, 40.97, 63.5])
@pytest.mark.parametrize("angle", [0.0, 1.2])
def test_weak_drag_leaves_only_what_its_kicks_resonate(steps_a_cycle: float, angle: float) -> None:
    """Corrected to first order, Strang's error is that of kicks next to an even number a cycle, as it is foretold."""
    problem = Problem(Equation(angular_frequency_per_s=1.0, drag_per_m=1e-5), math.cos(angle), math.sin(angle))
    strang, step, count = get_integrator("strang"), 2.0 * math.pi / steps_a_cycle, 6000
    found = np.max(np.abs(strang.run(problem, step, count).y - TAYLOR.run(problem, step, count).y))
    predicted = strang.predicted_error(problem, step, step * count)
    assert 0.2 * predicted <= found <= 1.1 * predicted
    assert found < 0.4 * 1e-5 * step**2 / 24.0 or abs(steps_a_cycle - 40.0) < 0.1


def test_errors_between_kept_states_are_not_those_of_what_is_kept() -> None:
    """Drag that outweighs the spring damps early errors: a run kept from the 45th cycle on has none of them."""
    problem = Problem(Equation(angular_frequency_per_s=1.0, gamma_per_s=3e-5, drag_per_m=16.0), 1.0)
    coarse = replace(TAYLOR, tolerance=1e-6)
    sparse, dense = (coarse.predicted_error(problem, spacing, 3e4) for spacing in (281.0, 0.1))
    assert sparse < 0.1 * dense


def test_rounding_repeats_from_turning_point_to_turning_point() -> None:
    """Under a cubic spring friction's turning points make rounding grow as the square of the time, not its 3/2."""
    spring = {"angular_frequency_per_s": 1.0, "cubic_per_m2_s2": 0.2}
    free, held = (Problem(Equation(**spring, friction_m_per_s2=each), 1.0) for each in (0.0, 1e-9))
    grows = [sheared_rounding(each, 1e5) / sheared_rounding(each, 1e4) for each in (free, held)]
    assert grows == pytest.approx([10.0**1.5, 10.0**2], rel=0.02)


@pytest.mark.parametrize("method", ["strang", "averaged", "rk4"])
def test_a_prediction_is_made_of_a_stretch(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a run of a hundred thousand cycles no more than some thousand steps are made to predict its error."""
    integrator = get_integrator(method)
    problem = Problem(Equation(angular_frequency_per_s=1.0, drag_per_m=0.1, friction_m_per_s2=1e-9), 1.0)
    made = []
    for kind in {type(integrator), type(get_integrator("strang"))}:
        march = kind.march
        monkeypatch.setattr(kind, "march", lambda *given, march=march: made.append(given[3]) or march(*given))
    assert 0.0 < integrator.predicted_error(problem, 0.1, 2e5 * math.pi) < math.inf
    assert sum(made) < 20_000


def test_the_frequency_of_a_cubic_spring_is_that_of_its_motion() -> None:
    """The arithmetic-geometric mean gives the period between turning points of a run, hardening and softening."""
    for cubic in (1e-3, 0.5, 40.0, -0.3):
        equation = Equation(angular_frequency_per_s=2.0, cubic_per_m2_s2=4.0 * cubic)
        period = 2.0 * math.pi / float(frequency(equation, np.array([1.0]))[0])
        run = TAYLOR.run(Problem(equation, 1.0), period, 5)
        np.testing.assert_allclose(run.y, 1.0, rtol=0, atol=1e-9)
        np.testing.assert_allclose(run.v, 0.0, rtol=0, atol=1e-9)


def test_what_is_left_out_counts_as_another_pace_under_a_cubic_spring() -> None:
    """Drag that is nothing for a linear spring is kept where the pace depends on the amplitude that it changes."""
    drag = {"gamma_per_s": 1e-8}
    linear = Problem(Equation(angular_frequency_per_s=1.0, drag_per_m=0.1, **drag), 1.0)
    cubic = Problem(Equation(angular_frequency_per_s=1.0, cubic_per_m2_s2=1e4, **drag), 1.0)
    held = [required(each, 30.0, 1e-4)[0].equation.gamma_per_s for each in (linear, cubic)]
    assert held[0] == 0.0
    assert held[1] > 0.0
