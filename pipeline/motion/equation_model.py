"""The free motion of a bob from its equation of motion, at any times and for any law of drag, as a model for fits."""

from __future__ import annotations

import math

import numpy as np

from pipeline.dynamics import Equation, Problem, Trajectory
from pipeline.dynamics.equation import Real
from pipeline.dynamics.strang import STRANG
from pipeline.track import F8

STATE = ("rest", "displacement", "velocity", "angular_frequency")
STEP = 0.08  # time step in radians; splitting and interpolation then err by less than 1e-4 of the amplitude
REACH = 3.0  # maximum ratio, either way, of a frequency to its start value
DIFFERENCE = 1e-6  # change of a coefficient in a difference quotient, relative to the coefficient's scale
LENGTHS = (1, 1, 1, 0, 1, 0, -1)  # power of length in the unit of each parameter
KEPT = 8  # maximum number of cached trajectories


def envelope(y: float, v: float, omega: float, mu: float, gamma: float, beta: float) -> tuple[float, float, float]:
    """Return amplitude and phase of a damped motion at displacement y and velocity v, and the amplitude's error bound.

    Parameters
    ----------
    y, v, omega, mu, gamma, beta : float
        Values in m, m/s, rad/s and the units of the amplitude laws.

    Notes
    -----
    The amplitude A is that of :math:`y = A\\cos\\varphi`: the smooth curve whose law has these coefficients. With
    :math:`\\lambda = \\gamma + \\beta A + \\mu/A` and :math:`\\omega_d^2 = \\omega^2 - \\lambda^2`, linear drag gives

    .. math:: A\\cos\\varphi = y, \\quad A\\sin\\varphi = -(v + \\lambda y)/\\omega_d,

    which is used for all laws. Quadratic drag and friction dissipate at other phases of a swing [1]_. To first order,
    with :math:`\\varphi` from 0 to :math:`\\pi` and :math:`h = \\frac12\\sin 2\\varphi`, they increase A by

    .. math:: \\tfrac{\\beta A^2}{\\omega}\\left[\\tfrac{3\\pi}{4}\\left(\\tfrac23 - \\cos\\varphi
              + \\tfrac13\\cos^3\\varphi\\right) - \\varphi + h\\right]
              + \\tfrac{\\mu}{\\omega}\\left[\\tfrac{\\pi}{2}(1 - \\cos\\varphi) - \\varphi + h\\right].

    Compared with the curve through the turning points of adaptive integrations, A has a relative error of up to
    :math:`0.3\\,\\lambda(\\lambda - \\gamma)/\\omega^2`; under linear drag it is exact.

    References
    ----------
    .. [1] N. N. Bogoliubov, Y. A. Mitropolsky, "Asymptotic methods in the theory of non-linear oscillations", 1961.
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


class FreeMotion:
    """Distances from the sensor against time for the parameters (o, y0, v0, omega0, mu, gamma, beta).

    Parameters
    ----------
    t : (n,) float64, s
        Time since the instant at which the displacement is y0 and the velocity v0.
    omega : float
        Approximate angular frequency, rad/s, from which the integrator's step follows.
    amplitude_m : float
        Approximate first amplitude, m, from which the step of difference quotients follows.

    Notes
    -----
    Negative coefficients, which an unbounded fit must be able to pass through, have no equation of motion. For them
    the motion is continued from zero as an odd function, :math:`x(-c) = 2x(0) - x(c)`. This is smooth to first order,
    which suffices for a coefficient within a few standard uncertainties of zero.
    """

    def __init__(self, t: F8, omega: float, amplitude_m: float) -> None:
        self.t, self._omega = t, omega
        self._spacing = STEP / omega
        self._steps = max(2, math.ceil(float(np.max(t)) / self._spacing))
        self._kept: dict[bytes, Trajectory] = {}
        rate = 0.01 * omega
        self.scale: F8 = np.array(
            [amplitude_m, amplitude_m, amplitude_m * omega, omega, rate * amplitude_m, rate, rate / amplitude_m]
        )

    def position(self, theta: F8) -> F8:
        """Return the distances (n,) in m; NaN for parameters that are not finite or a frequency far from the start."""
        if not (np.all(np.isfinite(theta)) and self._omega / REACH < theta[3] < REACH * self._omega):
            return np.full(self.t.size, np.nan)
        found: F8 = theta[0] + self.trajectory(theta).at(self.t)
        if np.any(theta[4:] < 0.0):
            at_zero = np.concatenate([theta[:4], np.maximum(theta[4:], 0.0)])
            found = 2.0 * (theta[0] + self.trajectory(at_zero).at(self.t)) - found
        return found

    def derivatives(self, theta: F8, slots: list[int]) -> F8:
        """Return the derivatives (n, p) of the distances by the parameters with indices ``slots``.

        All nonzero coefficients must be among these parameters.

        Notes
        -----
        Difference quotients are used for the coefficients only. The other derivatives follow from the invariance of
        the motion under a shift of the start along it and under changes of the units of length and time:

        .. math::
            (\\dot y_0\\,\\partial_{y_0} + \\ddot y_0\\,\\partial_{v_0})\\,y &= \\dot y \\
            (y_0\\,\\partial_{y_0} + v_0\\,\\partial_{v_0}
            + \\mu\\,\\partial_\\mu - \\beta\\,\\partial_\\beta)\\,y &= y \\
            (\\omega_0\\,\\partial_{\\omega_0} + v_0\\,\\partial_{v_0}
            + \\mu\\,\\partial_\\mu + \\gamma\\,\\partial_\\gamma + \\beta\\,\\partial_\\beta)\\,y &= t\\,\\dot y
        """
        below = [slot for slot in range(len(STATE), theta.size) if theta[slot] < 0.0]
        found = self._slopes(np.concatenate([theta[: len(STATE)], np.abs(theta[len(STATE) :])]), slots)
        if below:
            at_zero = self._slopes(np.concatenate([theta[: len(STATE)], np.maximum(theta[len(STATE) :], 0.0)]), slots)
            # The derivative by a negative coefficient equals that at its absolute value, as the continuation is odd.
            found = np.where(np.isin(slots, below), found, 2.0 * at_zero - found)
        return found

    def _slopes(self, theta: F8, slots: list[int]) -> F8:
        """Return the derivatives (n, p) if no coefficient is negative."""
        path = self.trajectory(theta)
        y, speed = path.at(self.t), self._velocity(path)
        columns: dict[int, F8] = {}
        sized, timed = y.copy(), self.t * speed
        for slot in (slot for slot in slots if slot >= len(STATE)):
            moved = theta.copy()
            moved[slot] += DIFFERENCE * self.scale[slot]
            columns[slot] = (self.trajectory(moved).at(self.t) - y) / (moved[slot] - theta[slot])
            sized -= LENGTHS[slot] * theta[slot] * columns[slot]
            timed -= theta[slot] * columns[slot]
        _, y0, v0, omega = theta[: len(STATE)].tolist()
        a0 = self._acceleration(path.problem.equation, y0, v0)
        determinant = y0 * a0 - v0 * v0
        columns[0] = np.ones(self.t.size)
        columns[1] = (a0 * sized - v0 * speed) / determinant
        columns[2] = (y0 * speed - v0 * sized) / determinant
        columns[3] = (timed - v0 * columns[2]) / omega
        return np.stack([columns[slot] for slot in slots], axis=1)

    def velocity(self, theta: F8) -> F8:
        """Return the velocities (n,) in m/s."""
        return self._velocity(self.trajectory(theta))

    def _velocity(self, path: Trajectory) -> F8:
        pull = self._acceleration(path.problem.equation, path.y, path.v)
        # A state with zero velocity is taken as held by friction; turning points lie between two states of the path.
        return Trajectory(path.problem, path.spacing_s, path.v, np.where(path.v == 0.0, 0.0, pull)).at(self.t)

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
            while len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = STRANG.run(Problem(equation, y, v), self._spacing, self._steps)
        return self._kept[key]
