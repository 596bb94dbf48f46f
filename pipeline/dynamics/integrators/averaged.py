"""The averaged amplitude model: the amplitude by its own law, the phase beside it; no step at all.

It is the motion that the analysis fits, and an approximation of the equation of motion: what drag does within a cycle
is averaged away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.damping.laws.drag import amplitudes
from pipeline.dynamics.equation import Problem, Real
from pipeline.dynamics.integrator import Trajectory, integrate, worst_error
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["AVERAGED", "Averaged", "amplitude", "stopping_time"]

MOST_TURNS = 8
WEAK = 0.3  # damping rate over frequency up to which a cycle can be averaged over


def amplitude(start: Real, gamma: Real, beta: Real, mu: Real, t: F8) -> F8:
    """Return A(t) of dA/dt = -(mu + gamma A + beta A^2), 0 once it has stopped.

    Parameters
    ----------
    start : float or (m,) float64, m
    gamma, beta, mu : float or (m,) float64
        1/s, 1/(m s), m/s.
    t : (n,) float64, s

    Returns
    -------
    (n,) or (n, m) float64, m
        By the closed form of :mod:`pipeline.damping.laws.drag`.

    Raises
    ------
    DynamicsError
        If products of the coefficients leave the range of numbers.

    Examples
    --------
    >>> amplitude(0.05, 0.0, 0.0, 0.01, np.array([0.0, 2.0, 6.0]))
    array([0.05, 0.03, 0.  ])
    """
    theta = np.array(np.broadcast_arrays(start, mu, gamma, beta), np.float64)
    with np.errstate(all="ignore"):
        found = amplitudes(np.asarray(t, np.float64), theta.reshape(4, -1).T)
    if np.any(np.isnan(found)):
        raise DynamicsError("the amplitude's coefficients leave the range of numbers; take smaller ones")
    return found[0] if theta.ndim == 1 else np.ascontiguousarray(found.T)


def stopping_time(start: Real, gamma: Real, beta: Real, mu: Real) -> Real:
    """Return when the amplitude reaches 0, s; inf without friction.

    Examples
    --------
    >>> float(stopping_time(0.05, 0.0, 0.0, 0.01))
    5.0
    """
    with np.errstate(all="ignore"):
        square = 0.25 * np.square(gamma) - np.multiply(mu, beta)
        kappa = np.sqrt(np.abs(square))
        # A negative rate, as of a method that adds energy, may outgrow friction: then it never stops.
        pull = mu + 0.5 * np.asarray(gamma) * start
        held = (np.asarray(mu) > 0) & (pull > 0) & (mu + (gamma + np.multiply(beta, start)) * start > 0)
        ratio = np.asarray(start) / np.where(held, pull, 1.0)
        x = kappa * ratio
        # kappa < gamma / 2 keeps x below 1 where the hyperbolic form holds.
        hyperbolic = np.arctanh(np.minimum(np.where(square > 0, x, 0.0), 1.0 - 1e-16))
        angle = np.where(square > 0, hyperbolic, np.arctan(x))
        time = np.where(kappa > 0, angle / np.where(kappa > 0, kappa, 1.0), ratio)
        return np.where(held & ~np.isnan(time), time, np.inf)


@dataclass(frozen=True, slots=True)
class Averaged:
    """The averaged amplitude model."""

    name: str = "averaged"
    words: str = "the averaged amplitude model"
    order: int = 0

    def refusal(self, problem: Problem) -> str:
        """Return why not, where a cycle changes the amplitude too much to be averaged over."""
        if not np.all(_weakness(problem) <= WEAK):
            return (
                f"a cycle can be averaged over where damping takes less than {WEAK:g} per radian; take strang or auto"
            )
        return ""

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Evaluate the model at every kept time; see :class:`Integrator`."""
        return integrate(self, problem, step_s, steps, every, _march)

    def stable_step(self, problem: Problem) -> float:  # noqa: ARG002 - every integrator has the same signature
        """Return inf: it takes no steps."""
        return math.inf

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what a pilot run shows."""
        from pipeline.dynamics.pilot import predicted_by_pilot

        def of(one: Problem) -> float:
            return math.inf if self.refusal(one) else predicted_by_pilot(self, one, step_s, seconds)

        return worst_error(problem, step_s, seconds, of)


AVERAGED = Averaged()


def _weakness(problem: Problem) -> Real:
    """Damping per radian at the start."""
    gamma, beta, mu = problem.equation.laws()
    start = np.asarray(problem.amplitude_m())
    with np.errstate(all="ignore"):
        held = np.where(start > 0, mu / np.where(start > 0, start, 1.0), 0.0)
        return (gamma + beta * start + held) / problem.equation.angular_frequency_per_s


def _march(problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
    eq = problem.equation
    gamma, beta, mu = eq.laws()
    times: F8 = step_s * every * np.arange(steps // every + 1, dtype=np.float64)
    t = times.reshape(-1, *(1,) * np.ndim(problem.displacement_m))
    damped = np.sqrt((eq.angular_frequency_per_s - gamma) * (eq.angular_frequency_per_s + gamma))
    y, v = problem.displacement_m, problem.velocity_m_per_s
    # Displacement and velocity tell amplitude and phase only together with the rate at which it falls.
    start, rate = np.asarray(problem.amplitude_m()), np.asarray(gamma)
    bend = 0.375 * np.asarray(eq.cubic_per_m2_s2) / eq.angular_frequency_per_s
    turn = damped
    for _ in range(MOST_TURNS):
        before, with_rate = start, np.where(start > 0, start, 1.0)
        rate = gamma + beta * start + np.where(start > 0, mu / with_rate, 0.0)
        turn = damped + bend * start**2
        start = np.hypot(y, (v + rate * y) / turn)
        if np.all(np.abs(start - before) <= 1e-16 * start):
            break
    phase = np.arctan2(-(v + rate * y) / turn, y)
    a = amplitude(start, gamma, beta, mu, times)
    falling = np.where(a > 0, mu + (gamma + beta * a) * a, 0.0)
    angle = phase + damped * t
    if np.any(bend):
        squares = np.zeros(np.broadcast_shapes(t.shape, a.shape))
        np.cumsum(0.5 * (a[1:] ** 2 + a[:-1] ** 2) * (step_s * every), axis=0, out=squares[1:])
        angle = angle + bend * squares
    cosine, sine = np.cos(angle), np.sin(angle)
    return a * cosine, -falling * cosine - a * (damped + bend * a**2) * sine
