"""What error to expect of a run before it is made: by rounding, by a repeated step, of an ensemble's worst member."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.dynamics.amplitude import amplitude
from pipeline.dynamics.flow import flows
from pipeline.dynamics.integrator import Integrator, StepMaker, demand_times
from pipeline.dynamics.pilot import in_own_units, predicted_by_pilot
from pipeline.dynamics.problem import Problem
from pipeline.dynamics.stability import step_matrix
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["every_member", "predicted_by_average", "rounding_error", "worst_error"]

POINTS = 1500
STRONG = 0.02  # damping a radian, or cubic spring, beyond which the linear oscillator is no measure of the error


def rounding_error(problem: Problem, seconds: float, steps: float = 0.0) -> float:
    """Return the error over the amplitude that rounding leaves at best: of the phase, and of steps that repeat.

    Notes
    -----
    The phase :math:`\\omega t` is a product of rounded numbers: its error is its own size times the relative rounding.
    A step that is repeated repeats the rounding of its coefficients: a fifth of the relative rounding each.
    """
    phase = float(np.max(problem.equation.angular_frequency_per_s)) * seconds
    return float(np.finfo(np.float64).eps) * (4.0 + phase + 0.2 * steps)


def worst_error(problem: Problem, step_s: float, seconds: float, of: Callable[[Problem], float]) -> float:
    """Return the largest predicted error of an ensemble's members, inf where the prediction runs beyond all numbers.

    Raises
    ------
    DynamicsError
        If there is no member, or step or duration are none.
    """
    demand_times(step_s, seconds)

    def bounded(one: Problem) -> float:
        try:
            error = of(one)
        except (OverflowError, ZeroDivisionError):
            return math.inf
        return math.inf if math.isnan(error) else error

    with np.errstate(all="ignore"):
        return every_member(problem, bounded, max)


def every_member(problem: Problem, of: Callable[[Problem], float], worst: Callable[..., float]) -> float:
    """Return the worst of a number over an ensemble's members.

    Raises
    ------
    DynamicsError
        If there is no member.
    """
    if not problem.size:
        raise DynamicsError("an ensemble has at least one member, got none")
    return worst(of(one) for one in problem.members())


def predicted_by_average(
    method: Integrator, make: StepMaker, solver: Integrator, problem: Problem, step_s: float, seconds: float
) -> float:
    """Return the expected largest error of the displacement over the starting amplitude.

    Parameters
    ----------
    method : Integrator
        Which repeats the step that ``make`` makes.
    make : callable
        Equation and step to the function of one step.
    solver : Integrator
        For the truth of a pilot, where damping is too strong for averages.
    problem : Problem
        Of one trajectory.
    step_s, seconds : float
        Of the run that is planned, s.

    Notes
    -----
    On the linear oscillator the step is a matrix, and powers of it against the exact flow are the error itself.
    Otherwise the eigenvalues of that matrix give the method's own frequency and damping, with which the averaged
    amplitude law is compared with the true one; what differs within a cycle is taken from the linear oscillator. A
    turning point that is not located adds friction times step to the velocity, with a sign that scatters.
    """
    start = problem.amplitude_m()
    if start == 0.0:
        return 0.0
    problem = in_own_units(problem)
    steps = max(1, round(seconds / step_s))
    floor = rounding_error(problem, seconds, steps)
    if problem.equation.is_linear:
        error = _linear(make, problem, step_s, steps)
    else:
        error = _averaged(method, make, solver, problem, step_s, steps)
    return error + floor if math.isfinite(error) else math.inf


def _linear(make: StepMaker, problem: Problem, h: float, steps: int) -> float:
    """Largest difference between powers of the step's matrix and the flow, on a grid of times."""
    stride = max(1, steps // POINTS)
    grown = _orbit(make, problem, h, stride, steps // stride)
    exact = _exact(problem, h * stride * np.arange(steps // stride + 1, dtype=np.float64))
    return float(np.max(np.abs(grown - exact)) / problem.amplitude_m())


def _orbit(make: StepMaker, problem: Problem, h: float, stride: int, count: int) -> F8:
    """Displacements after multiples of a stride of steps."""
    omega = problem.equation.angular_frequency_per_s
    matrix = step_matrix(make, omega * h, problem.equation.gamma_per_s / omega)
    (a, b), (c, d) = np.linalg.matrix_power(matrix, stride).tolist()
    y, v = problem.displacement_m, problem.velocity_m_per_s / omega
    found = [y]
    for _ in range(count):
        y, v = a * y + b * v, c * y + d * v
        found.append(y)
    return np.array(found)


def _exact(problem: Problem, t: F8) -> F8:
    a, b, _, _ = flows(problem.equation.angular_frequency_per_s, problem.equation.gamma_per_s, t)
    return np.asarray(a * problem.displacement_m + b * problem.velocity_m_per_s)


def _averaged(method: Integrator, make: StepMaker, solver: Integrator, problem: Problem, h: float, steps: int) -> float:
    eq, start = problem.equation, problem.amplitude_m()
    gamma, beta, mu = eq.laws()
    omega = eq.angular_frequency_per_s
    # The spring as stiff as it is on average at this amplitude.
    omega = math.sqrt(max(omega**2 + 0.75 * eq.cubic_per_m2_s2 * start**2, 0.1 * omega**2))
    friction = eq.friction_m_per_s2 * h / (omega * start) * math.sqrt(1.0 + omega * h * steps / math.pi) if mu else 0.0
    bent = 0.75 * abs(eq.cubic_per_m2_s2) * start * start / omega
    if gamma + beta * start + bent > STRONG * omega:
        if h > method.stable_step(problem):
            return math.inf
        return predicted_by_pilot(method, solver, problem, h, h * steps) + float(friction)
    matrix = step_matrix(make, omega * h, gamma / omega)
    if not np.all(np.isfinite(matrix)):
        return math.inf
    values = np.linalg.eigvals(matrix.astype(np.complex128))
    turning = np.log(values[np.argmax(values.imag)]) / h
    if turning.imag <= 0.0:
        return math.inf
    late = turning.imag - math.sqrt(omega**2 - gamma**2)
    t = np.linspace(0.0, h * steps, POINTS)
    true, grown = (amplitude(start, rate, beta, mu, t) for rate in (gamma, -turning.real))
    bend = 0.375 * eq.cubic_per_m2_s2 / omega
    phase = late * t
    if bend:
        from scipy.integrate import cumulative_trapezoid

        phase += bend * cumulative_trapezoid(grown**2 - true**2, t, initial=0.0)
    secular = float(np.max(np.abs(grown * np.exp(1j * phase) - true))) / start
    # Within a cycle: the linear oscillator's error beyond what a cycle accumulates.
    cycle = max(1, min(steps, math.ceil(2.0 * math.pi / (omega * h))))
    short = _linear(make, problem, h, cycle)
    within = max(0.0, short - abs(np.expm1((turning + gamma - 1j * math.sqrt(omega**2 - gamma**2)) * h * cycle)))
    return float(secular + within + friction)
