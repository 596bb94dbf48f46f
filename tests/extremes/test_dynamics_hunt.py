"""No warning, overflow or NaN leaves a public function of the dynamics, whatever numbers it is given."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pipeline.dynamics import INTEGRATORS, Equation, Integrator, Problem, get_integrator, halving, methods
from pipeline.dynamics.halving import auto, halved, solved_once
from pipeline.errors import DynamicsError

PROBLEMS = 60
STEPS = 40
EXTREMES = (
    *(0.0, -0.0, 1e-12, 1.0, 1e12, 1e100, 1e155, 1e300, 1.7e308),
    *(math.inf, -math.inf, math.nan, -1.0, -1e300),
)
REFUSED = object()


def value(rng: np.random.Generator, tame: float) -> float:
    """Return a number near 1 with some probability, else of many powers of ten, else an extreme."""
    draw = rng.random()
    if draw < tame:
        return float(10.0 ** rng.uniform(-3.0, 2.0))
    if draw < 0.9:
        return float(10.0 ** rng.uniform(-12.0, 12.0)) * (1.0 if rng.random() < 0.9 else -1.0)
    return EXTREMES[rng.integers(len(EXTREMES))]


def coefficients(rng: np.random.Generator) -> dict[str, float]:
    """Return what an equation is made of: each term there or not."""
    shares = {"gamma_per_s": 0.7, "drag_per_m": 0.6, "friction_m_per_s2": 0.4, "cubic_per_m2_s2": 0.3}
    found = {name: value(rng, 0.5) if rng.random() < share else 0.0 for name, share in shares.items()}
    return {"angular_frequency_per_s": value(rng, 0.7), **found}


def attempt(call: Callable[[], Any], *, infinite: bool = False) -> Any:
    """Return what a call gives, every number in it finite; a refusal in one line passes too."""
    try:
        found = call()
    except DynamicsError as error:
        refusal = str(error)
        found = REFUSED
    else:
        refusal = ""
    assert "\n" not in refusal
    for each in found if isinstance(found, tuple) else (found,):
        if isinstance(each, float | np.ndarray):
            assert not np.any(np.isnan(each))
            assert infinite or np.all(np.isfinite(each))
    return found


@pytest.mark.trials
@pytest.mark.parametrize("seed", range(4))
def test_every_number_is_answered_by_a_number_or_one_line(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 1e-12 to 1e12, and extremes to refuse: warnings are errors, so are overflows and NaN."""
    # What would take minutes gives up after moments, by the same way.
    monkeypatch.setattr(halving, "MOST_STEPS", 50_000)
    monkeypatch.setattr(methods, "MOST_CALLS", 5_000)
    rng = np.random.default_rng((61, seed))
    for _ in range(PROBLEMS):
        given: dict[str, Any] = coefficients(rng)
        equation = attempt(lambda given=given: Equation(**given))
        if equation is REFUSED:
            continue
        attempt(equation.laws, infinite=True)
        start = value(rng, 0.5), value(rng, 0.5)
        problem = attempt(lambda equation=equation, start=start: Problem(equation, *start))
        if problem is REFUSED:
            continue
        step = float(rng.choice([1e-3, 0.05, 0.5, 2.0]) / equation.angular_frequency_per_s)
        step = step if rng.random() < 0.8 else value(rng, 0.3)
        solved_by_all(problem, step, rng)
        chosen_for(problem, step, float(10.0 ** rng.uniform(-13.0, 0.0)))


def solved_by_all(problem: Problem, step: float, rng: np.random.Generator) -> None:
    """Ask some integrators for everything they can say about a problem."""
    for name in rng.choice(list(INTEGRATORS), 4, replace=False).tolist():
        solved_by(get_integrator(name), problem, step)


def solved_by(integrator: Integrator, problem: Problem, step: float) -> None:
    """Ask one integrator."""
    attempt(lambda: integrator.refusal(problem))
    attempt(lambda: integrator.stable_step(problem), infinite=True)
    attempt(lambda: integrator.no_estimate(problem))
    if integrator.order:
        attempt(lambda: solved_once(problem, integrator, step, STEPS).error, infinite=True)
    run = attempt(lambda: integrator.run(problem, step, STEPS, every=4))
    if run is REFUSED:
        return
    for each in (run.y, run.v, run.t):
        assert np.all(np.isfinite(each))
    attempt(run.relative_energy, infinite=True)
    attempt(lambda: run.at(np.array([-1.0, 0.0, step, 50.0 * step])))


def chosen_for(problem: Problem, step: float, tolerance: float) -> None:
    """Ask for the solution to a tolerance."""
    attempt(problem.amplitude_m)
    solution = attempt(lambda: auto(problem, step, STEPS, tolerance))
    if solution is not REFUSED:
        assert 0.0 <= solution.error <= tolerance
    attempt(lambda: halved(problem, get_integrator("verlet"), step, STEPS, tolerance).error)


def test_a_run_that_would_not_end_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number of calls is the end of an adaptive method, and its line says what to take instead."""
    monkeypatch.setattr(methods, "MOST_CALLS", 5_000)
    problem = Problem(Equation.from_laws(8.66, beta_per_m_s=0.235), 0.05)
    with pytest.raises(DynamicsError, match=r"dop853 .*take .*strang or auto"):
        get_integrator("dop853").run(problem, 1.0, 10_000)


def test_a_step_that_is_none_is_refused() -> None:
    """Outside 1e-30 to 1e30 s, and with friction beyond 1e6 radians, the line says so."""
    problem = Problem(Equation(angular_frequency_per_s=8.66, friction_m_per_s2=0.1), 0.05)
    for step in (1e-310, 1e-31, 1e31, math.nan, -1.0, 0.0):
        with pytest.raises(DynamicsError, match=r"the step must be between 1e-30 and 1e\+30 s, got"):
            get_integrator("strang").run(problem, step, 10)
    with pytest.raises(DynamicsError, match=r"friction.*radians.*take a shorter step"):
        get_integrator("strang").run(problem, 1e6, 10)
