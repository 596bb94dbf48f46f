"""Predictions of an error: their leading terms, what they cost, and what becomes of them in a long run."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.dynamics import Equation, Problem, get_integrator
from pipeline.dynamics.integrators.taylor import TAYLOR
from pipeline.dynamics.prediction.envelope import frequency
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
