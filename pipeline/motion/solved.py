"""The equation of motion as a model of samples: the free motion of a bob at any times and for any law of drag."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipeline.damping.laws.drag import COEFFICIENTS, Drag
from pipeline.dynamics import Equation, Problem, Trajectory
from pipeline.dynamics.equation import Real
from pipeline.dynamics.strang import STRANG
from pipeline.numerics.least_squares import CENTRAL_STEP
from pipeline.track import F8

STATE = ("rest", "displacement", "velocity", "angular_frequency")
# Time step in radians: interpolation errs by 1e-7 of the amplitude, and splitting under weak drag by 1e-6, as measured
# by `python -m benchmarks.dynamics`.
STEP = 0.08
REACH = 3.0  # maximum ratio, either way, of a frequency to its start value


def envelope(y: float, v: float, omega: float, mu: float, gamma: float, beta: float) -> tuple[float, float, float]:
    """Return amplitude and phase of a damped motion at displacement y and velocity v, and the amplitude's error bound.

    The amplitude A is that of :math:`y = A\\cos\\varphi`: the smooth curve whose law has these coefficients. With
    :math:`\\lambda = \\gamma + \\beta A + \\mu/A` and :math:`\\omega_d^2 = \\omega^2 - \\lambda^2`, linear drag gives

    .. math:: A\\cos\\varphi = y, \\quad A\\sin\\varphi = -(v + \\lambda y)/\\omega_d,

    which is used for all laws. Quadratic drag and friction dissipate at other phases of a swing (N. N. Bogoliubov,
    Y. A. Mitropolsky, "Asymptotic methods in the theory of non-linear oscillations", 1961). To first order,
    with :math:`\\varphi` from 0 to :math:`\\pi` and :math:`h = \\frac12\\sin 2\\varphi`, they increase A by

    .. math:: \\tfrac{\\beta A^2}{\\omega}\\left[\\tfrac{3\\pi}{4}\\left(\\tfrac23 - \\cos\\varphi
              + \\tfrac13\\cos^3\\varphi\\right) - \\varphi + h\\right]
              + \\tfrac{\\mu}{\\omega}\\left[\\tfrac{\\pi}{2}(1 - \\cos\\varphi) - \\varphi + h\\right].

    Compared with the curve through the turning points of adaptive integrations, A has a relative error of up to
    :math:`0.3\\,\\lambda(\\lambda - \\gamma)/\\omega^2`; under linear drag it is exact.
    """
    start = amplitude = math.hypot(y, v / omega) or 1e-300
    turn, rate = 0.0, gamma
    for _ in range(8):
        rate = min(max(gamma + beta * amplitude + mu / amplitude, -0.9 * omega), 0.9 * omega)
        side = -(v + rate * y) / math.sqrt(omega**2 - rate**2)
        turn = math.atan2(side, y)
        angle = turn % math.pi
        cosine, half = math.cos(angle), 0.5 * math.sin(2.0 * angle)
        quadratic = 0.75 * math.pi * (2.0 / 3.0 - cosine + cosine**3 / 3.0) - angle + half
        dry = 0.5 * math.pi * (1.0 - cosine) - angle + half
        found = math.hypot(y, side) + (beta * amplitude**2 * quadratic + mu * dry) / omega
        amplitude = min(max(found, 0.5 * start), 2.0 * start)
    return amplitude, turn, 0.3 * amplitude * abs(rate * (rate - gamma)) / omega**2


@dataclass(frozen=True, slots=True, eq=False)
class FreeMotion:
    """Distances from the sensor for the parameters (o, y0, v0, omega0, mu, gamma, beta), with the start at t = 0.

    Negative coefficients, which an unbounded fit must be able to pass through, have no equation of motion. For them
    the motion is continued from zero as an odd function, :math:`x(-c) = 2x(0) - x(c)`. This is smooth to first order,
    which suffices for a coefficient within a few standard uncertainties of zero.
    """

    seconds: float  # the motion is solved up to this time
    omega: float  # approximate angular frequency, from which the integrator's step follows
    amplitude_m: float  # approximate first amplitude, from which the step of difference quotients follows
    _kept: dict[bytes, Trajectory] = field(default_factory=dict)

    def position(self, t: F8, theta: F8) -> F8:
        """Return the distances (n,); NaN for parameters that are not finite or a frequency far from the start."""
        if not (np.all(np.isfinite(theta)) and self.omega / REACH < theta[3] < REACH * self.omega):
            return np.full(t.size, np.nan)
        found: F8 = theta[0] + self.trajectory(theta).at(t)
        if np.any(theta[4:] < 0.0):
            at_zero = np.concatenate([theta[:4], np.maximum(theta[4:], 0.0)])
            found = 2.0 * (theta[0] + self.trajectory(at_zero).at(t)) - found
        return found

    def derivatives(self, t: F8, theta: F8, slots: list[int]) -> F8:
        """Return the derivatives (n, p) by the parameters with indices ``slots``; coefficients not among them are zero.

        Difference quotients are used for the coefficients only. The other derivatives follow from the invariance of
        the motion under a shift of the start along it and under changes of the units of length and time:

        .. math::
            (\\dot y_0\\,\\partial_{y_0} + \\ddot y_0\\,\\partial_{v_0})\\,y &= \\dot y \\\\
            (y_0\\,\\partial_{y_0} + v_0\\,\\partial_{v_0}
            + \\mu\\,\\partial_\\mu - \\beta\\,\\partial_\\beta)\\,y &= y \\\\
            (\\omega_0\\,\\partial_{\\omega_0} + v_0\\,\\partial_{v_0}
            + \\mu\\,\\partial_\\mu + \\gamma\\,\\partial_\\gamma + \\beta\\,\\partial_\\beta)\\,y &= t\\,\\dot y
        """
        count = len(STATE)
        below = [slot for slot in range(count, theta.size) if theta[slot] < 0.0]
        found = self._slopes(t, np.concatenate([theta[:count], np.abs(theta[count:])]), slots)
        if below:
            at_zero = self._slopes(t, np.concatenate([theta[:count], np.maximum(theta[count:], 0.0)]), slots)
            # The derivative by a negative coefficient equals that at its absolute value, as the continuation is odd.
            found = np.where(np.isin(slots, below), found, 2.0 * at_zero - found)
        return found

    def _slopes(self, t: F8, theta: F8, slots: list[int]) -> F8:
        """Return the derivatives (n, p) if no coefficient is negative."""
        path, amplitude_m, rate = self.trajectory(theta), self.amplitude_m, 0.01 * self.omega
        scale = dict(zip(range(len(STATE), theta.size), (rate * amplitude_m, rate, rate / amplitude_m), strict=True))
        y, speed = path.at(t), self._velocity(path, t)
        columns: dict[int, F8] = {}
        sized, timed = y.copy(), t * speed
        for slot in (slot for slot in slots if slot >= len(STATE)):
            moved = theta.copy()
            moved[slot] += CENTRAL_STEP * scale[slot]
            columns[slot] = (self.trajectory(moved).at(t) - y) / (moved[slot] - theta[slot])
            power = slot - len(STATE)  # of the amplitude; the unit of the coefficient has the length to 1 - power
            sized -= (1 - power) * theta[slot] * columns[slot]
            timed -= theta[slot] * columns[slot]
        _, y0, v0, omega = theta[: len(STATE)].tolist()
        a0 = self._acceleration(path.problem.equation, y0, v0)
        determinant = y0 * a0 - v0 * v0
        columns[0] = np.ones(t.size)
        columns[1] = (a0 * sized - v0 * speed) / determinant
        columns[2] = (y0 * speed - v0 * sized) / determinant
        columns[3] = (timed - v0 * columns[2]) / omega
        return np.stack([columns[slot] for slot in slots], axis=1)

    def velocity(self, t: F8, theta: F8) -> F8:
        """Return the velocities (n,)."""
        return self._velocity(self.trajectory(theta), t)

    def _velocity(self, path: Trajectory, t: F8) -> F8:
        pull = self._acceleration(path.problem.equation, path.y, path.v)
        # A state with zero velocity is taken as held by friction; turning points lie between two states of the path.
        return Trajectory(path.problem, path.spacing_s, path.v, np.where(path.v == 0.0, 0.0, pull)).at(t)

    @staticmethod
    def _acceleration(equation: Equation, y: Real, v: Real) -> Real:
        drag = (2.0 * equation.gamma_per_s + equation.drag_per_m * np.abs(v)) * v
        return -equation.spring(y) - drag - equation.friction_m_per_s2 * np.sign(v)

    def trajectory(self, theta: F8) -> Trajectory:
        """Return the solution about the rest position, with the absolute values of the coefficients."""
        key = theta[1:].tobytes()
        if key not in self._kept:
            _, y, v, omega, mu, gamma, beta = (float(x) for x in theta)
            equation = Equation.from_laws(omega, gamma_per_s=abs(gamma), beta_per_m_s=abs(beta), mu_m_per_s=abs(mu))
            # A fit evaluates residuals and derivatives at the same point, so the latest trajectories are cached.
            while len(self._kept) > 2 * len(COEFFICIENTS):
                self._kept.pop(next(iter(self._kept)))
            spacing = STEP / self.omega
            self._kept[key] = STRANG.run(Problem(equation, y, v), spacing, max(2, math.ceil(self.seconds / spacing)))
        return self._kept[key]


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """The model of samples with the drag of one law: its parameters are the state and the law's coefficients."""

    law: Drag
    motion: FreeMotion

    @property
    def slots(self) -> list[int]:
        """Indices of the parameters among all seven."""
        return [*range(len(STATE)), *(len(STATE) + power for power in self.law.powers)]

    def full(self, values: F8) -> F8:
        """Return all parameters (7,), with zero for absent coefficients."""
        theta = np.zeros(len(STATE) + len(COEFFICIENTS))
        theta[self.slots] = values
        return theta

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the distances (n,) at t, and a function that gives their derivatives (n, p)."""
        theta = self.full(values)
        return self.motion.position(t, theta), lambda: self.motion.derivatives(t, theta, self.slots)
