"""The rules for an integrator, on problems that it can solve."""

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.simulation import INTEGRATORS, Equation, Integrator, Problem
from pipeline.simulation.methods import acceleration
from springmass.testing.demands import demand

_STEP_S = 0.01
PROBLEMS = (
    Problem(Equation(angular_frequency_per_s=8.66, gamma_per_s=0.05), 0.05),
    Problem(Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235), 0.05, 0.1),
)


def _motion(problem: Problem) -> Callable[[float, tuple[float, float]], tuple[float, float]]:
    a = acceleration(problem.equation)
    return lambda _, state: (state[1], a(*state))


def _solvable(method: Integrator, problems: Sequence[Problem]) -> list[Problem]:
    """Return the problems that a method does not refuse; it has a name of its own, and refuses others in one line."""
    demand(INTEGRATORS.get(method.name, method) is method, f"take a new name, {method.name} is taken")
    demand(not any("\n" in method.refusal(each) for each in problems), "return one line from refusal")
    solvable = [each for each in problems if not method.refusal(each)]
    demand(solvable, "give a Problem that it does not refuse as an example")
    return solvable


def error_is_of_the_order(method: Integrator, problems: Sequence[Problem]) -> None:
    """A line through log error against log step has the order as its slope; without an order the error is small."""
    from scipy.integrate import solve_ivp

    for problem in _solvable(method, problems):
        if method.no_estimate(problem):
            continue
        t, start = _STEP_S * np.arange(501), (problem.displacement_m, problem.velocity_m_per_s)
        truth = solve_ivp(_motion(problem), t[[0, -1]], start, "DOP853", t, rtol=1e-13, atol=1e-16).y[0]
        parts = {0: [1], 1: [16, 32, 64, 128], 2: [4, 8, 16]}.get(method.order, [1, 2, 4])
        runs = [method.run(problem, _STEP_S / n, 500 * n, every=n).y for n in parts]
        errors = [float(np.max(np.abs(y - truth))) / problem.amplitude_m() for y in runs]
        if not method.order:
            demand(errors[0] <= 1e-5, f"err by at most 1e-5 of the amplitude without an order, got {errors[0]:.1g}")
        elif min(errors) > 1e-12:
            slope = float(np.polyfit(-np.log(parts), np.log(errors), 1)[0])
            demand(abs(slope - method.order) < 0.15, f"state the order of its error, {slope:.2f}, not {method.order}")


def spacing_changes_nothing(method: Integrator, problems: Sequence[Problem]) -> None:
    """``every`` chooses among the same steps; without an order a wider spacing is one; a bob at rest stays."""
    for problem in _solvable(method, problems):
        close = (1e-14 if method.order else 1e-5) * problem.amplitude_m()
        each, some = method.run(problem, _STEP_S, 120), method.run(problem, _STEP_S, 120, every=12)
        same = np.allclose(some.y, each.y[::12], rtol=0, atol=close) and np.allclose(some.t, each.t[::12], rtol=1e-15)
        demand(same, "keep every n-th of the same states")
        wide = some if method.order else method.run(problem, 12 * _STEP_S, 10)
        demand(np.allclose(wide.y, some.y, rtol=0, atol=close), "give states that do not depend on the spacing")
        rest = method.run(Problem(problem.equation, 0.0), _STEP_S, 50)
        demand(not rest.y.any() and not rest.v.any(), "leave a bob at rest where it is")


RULES = (error_is_of_the_order, spacing_changes_nothing)
