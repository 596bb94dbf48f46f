"""What error to expect of a method that repeats one step, before it runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pipeline.dynamics.equation import Problem
from pipeline.dynamics.flow import flows
from pipeline.dynamics.integrators.averaged import amplitude
from pipeline.dynamics.integrators.exact import rounding_error
from pipeline.dynamics.pilot import predicted_by_pilot
from pipeline.dynamics.stability import step_matrix
from pipeline.track import F8

if TYPE_CHECKING:
    from pipeline.dynamics.integrators.one_step import OneStep

__all__ = ["predicted_by_average"]

POINTS = 1500
STRONG = 0.02  # damping a radian, or cubic spring, beyond which the linear oscillator is no measure of the error


def predicted_by_average(method: OneStep, problem: Problem, step_s: float, seconds: float) -> float:
    """Return the expected largest error of the displacement over the starting amplitude.

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
    problem, _ = problem.scaled()
    steps = max(1, round(seconds / step_s))
    floor = rounding_error(problem, seconds, steps)
    whole = _linear if problem.equation.is_linear else _averaged
    error = whole(method, problem, step_s, steps)
    return error + floor if math.isfinite(error) else math.inf


def _linear(method: OneStep, problem: Problem, h: float, steps: int) -> float:
    """Largest difference between powers of the step's matrix and the flow, on a grid of times."""
    stride = max(1, steps // POINTS)
    grown = _orbit(method, problem, h, stride, steps // stride)
    exact = _exact(problem, h * stride * np.arange(steps // stride + 1, dtype=np.float64))
    return float(np.max(np.abs(grown - exact)) / problem.amplitude_m())


def _orbit(method: OneStep, problem: Problem, h: float, stride: int, count: int) -> F8:
    """Displacements after multiples of a stride of steps."""
    omega = problem.equation.angular_frequency_per_s
    matrix = step_matrix(method, omega * h, problem.equation.gamma_per_s / omega)
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


def _averaged(method: OneStep, problem: Problem, h: float, steps: int) -> float:
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
        return predicted_by_pilot(method, problem, h, h * steps) + float(friction)
    matrix = step_matrix(method, omega * h, gamma / omega)
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
    squares = grown**2 - true**2
    phase = late * t + bend * np.concatenate([[0.0], np.cumsum(0.5 * (squares[1:] + squares[:-1]) * t[1])])
    secular = float(np.max(np.abs(grown * np.exp(1j * phase) - true))) / start
    # Within a cycle: the linear oscillator's error beyond what a cycle accumulates.
    cycle = max(1, min(steps, math.ceil(2.0 * math.pi / (omega * h))))
    short = _linear(method, problem, h, cycle)
    within = max(0.0, short - abs(np.expm1((turning + gamma - 1j * math.sqrt(omega**2 - gamma**2)) * h * cycle)))
    return float(secular + within + friction)
