"""The free motion of a bob by its equation, at any times and for any of the laws of drag: what a fit compares."""

from __future__ import annotations

import math

import numpy as np

from pipeline.dynamics import Equation, Problem, Trajectory
from pipeline.dynamics.strang import STRANG
from pipeline.track import F8

__all__ = ["COEFFICIENTS", "STATE", "FreeMotion"]

STATE = ("rest", "displacement", "velocity", "angular_frequency")
COEFFICIENTS = ("mu", "gamma", "beta")
STEP = 0.08  # of the oscillation's angle: splitting and interpolation then err by less than 1e-4 of the amplitude
REACH = 3.0  # factor by which a frequency may leave that of the start
DIFFERENCE = 1e-6  # of each parameter's scale, by which it is moved for a derivative


class FreeMotion:
    """Displacements from the sensor against time, of parameters (o, y0, v0, omega0, mu, gamma, beta).

    Parameters
    ----------
    t : (n,) float64, s
        Since the instant at which displacement y0 and velocity v0 are taken.
    omega : float
        About the angular frequency, rad/s: it sets the integrator's step.
    amplitude_m : float
        About the first amplitude, m, for the size of differences.
    step : float
        Of the integrator, rad.

    Notes
    -----
    Coefficients below zero, through which an unbounded fit must pass, have no equation of motion. There the motion is
    continued from zero by its odd part, :math:`x(-c) = 2x(0) - x(c)`, which is smooth to first order: all that a
    coefficient of a few standard uncertainties feels.
    """

    def __init__(self, t: F8, omega: float, amplitude_m: float, step: float = STEP) -> None:
        self.t, self._omega = t, omega
        self._spacing = step / omega
        self._steps = max(2, math.ceil(float(np.max(t)) / self._spacing))
        rate = 0.01 * omega
        self.scale: F8 = np.array(
            [amplitude_m, amplitude_m, amplitude_m * omega, omega, rate * amplitude_m, rate, rate / amplitude_m]
        )

    def position(self, theta: F8) -> F8:
        """Return the distances (n,), m; NaN where the parameters are none of this motion."""
        if not (np.all(np.isfinite(theta)) and self._omega / REACH < theta[3] < REACH * self._omega):
            return np.full(self.t.size, np.nan)
        found: F8 = theta[0] + self.trajectory(theta).at(self.t)
        if np.any(theta[4:] < 0.0):
            at_zero = np.concatenate([theta[:4], np.maximum(theta[4:], 0.0)])
            found = 2.0 * (theta[0] + self.trajectory(at_zero).at(self.t)) - found
        return found

    def derivatives(self, theta: F8, slots: list[int]) -> F8:
        """Return the derivatives (n, p) of the distances by some of the parameters."""
        here = self.position(theta)
        columns = []
        for slot in slots:
            moved = theta.copy()
            moved[slot] += DIFFERENCE * self.scale[slot]
            step = moved[slot] - theta[slot]
            columns.append(np.ones(self.t.size) if slot == 0 else (self.position(moved) - here) / step)
        return np.stack(columns, axis=1)

    def velocity(self, theta: F8) -> F8:
        """Return the velocities (n,), m/s."""
        path = self.trajectory(theta)
        eq, v = path.problem.equation, path.v
        drag = (2.0 * eq.gamma_per_s + eq.drag_per_m * np.abs(v)) * v + eq.friction_m_per_s2 * np.sign(v)
        # A bob without velocity is taken to be held; one that only turns there is seen between two other states.
        pull = np.where(v == 0.0, 0.0, -eq.spring(path.y) - drag)
        return Trajectory(path.problem, path.spacing_s, v, pull).at(self.t)

    def trajectory(self, theta: F8) -> Trajectory:
        """Return the solution about rest; of coefficients below zero their amounts count."""
        _, y, v, omega, mu, gamma, beta = (float(x) for x in theta)
        equation = Equation.from_laws(omega, gamma_per_s=abs(gamma), beta_per_m_s=abs(beta), mu_m_per_s=abs(mu))
        return STRANG.run(Problem(equation, y, v), self._spacing, self._steps)
