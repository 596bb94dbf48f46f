"""Synthetic runs with known truth, in plain numpy; shares no code with what it judges."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
# Of each law that takes part in the choice, coefficients of a disc like those recorded.
LAW_TRUTHS = {
    "linear": {"gamma": 0.01463},
    "quadratic": {"beta": 0.45},
    "friction": {"mu": 2e-4},
    "linear+quadratic": {"gamma": 0.0073, "beta": 0.235},
    "linear+friction": {"gamma": 0.0073, "mu": 1.5e-4},
    "quadratic+friction": {"beta": 0.3, "mu": 1e-4},
    "power": {"c": 0.07, "n": 1.5},
}


@dataclass(frozen=True, kw_only=True)
class Truth:
    """A free oscillation: y = offset + A(t) cos(phase(t)), omega(A) = omega + kappa A^2.

    dA/dt = -(mu + gamma A + beta A^2 + c A^n) until A is zero. Lengths in m, times in s, ``phase`` in rad at t = 0.
    """

    amplitude: float = 0.05
    omega: float = 8.3
    phase: float = 0.7
    offset: float = 0.22
    gamma: float = 0.0
    beta: float = 0.0
    kappa: float = 0.0
    mu: float = 0.0
    c: float = 0.0
    n: float = 1.0

    @property
    def period(self) -> float:
        """Period of small oscillations, s."""
        return 2.0 * np.pi / self.omega

    def amplitude_at(self, t: F8) -> F8:
        """Return A at t (n,), m: by hand without friction and power, else by integration."""
        if self.mu or self.c:
            return _integrated(self.amplitude, self.mu, self.gamma, self.beta, self.c, self.n, float(np.max(t)))(t)
        if self.gamma == 0.0:
            return self.amplitude / (1.0 + self.beta * self.amplitude * t)
        decay = np.exp(-self.gamma * t)
        return self.amplitude * decay / (1.0 + self.beta * self.amplitude * (1.0 - decay) / self.gamma)

    def phase_at(self, t: F8) -> F8:
        """Return the total phase at t (n,), rad."""
        angle = self.phase + self.omega * t
        if self.kappa == 0.0:
            return angle
        grid = np.linspace(min(0.0, float(t.min())), float(t.max()), 200_001)
        squared = self.amplitude_at(grid) ** 2
        area = np.concatenate([[0.0], np.cumsum(0.5 * (squared[1:] + squared[:-1]) * np.diff(grid))])
        area -= np.interp(0.0, grid, area)
        return angle + self.kappa * np.interp(t, grid, area)

    def position(self, t: F8) -> F8:
        """Return y at t (n,), m."""
        return self.offset + self.amplitude_at(t) * np.cos(self.phase_at(t))


@lru_cache(maxsize=64)
def _integrated(
    start: float, mu: float, gamma: float, beta: float, c: float, n: float, seconds: float
) -> Callable[[F8], F8]:
    """Return A(t) by an adaptive Runge-Kutta method of order 8, zero once it has reached zero."""
    from scipy.integrate import solve_ivp

    def fall(_: float, a: F8) -> F8:
        left = np.maximum(a, 0.0)
        return -(mu + gamma * left + beta * left**2 + c * left**n)

    def stopped(_: float, a: F8) -> float:
        return float(a[0]) - 1e-9 * start

    stopped.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        fall, (0.0, seconds + 1e-9), [start], "DOP853", rtol=1e-11, atol=1e-15, dense_output=True, events=stopped
    )
    end = float(found.t[-1])

    def amplitude(t: F8) -> F8:
        return np.where(t < end, found.sol(np.minimum(t, end))[0], 0.0 if found.t_events[0].size else found.y[0, -1])

    return amplitude


def solved(acceleration: Callable[[float, float, float], float], x: float, t: F8) -> tuple[F8, F8]:
    """Return displacement and velocity of a motion from rest at x, with the acceleration as a function of t, x, v."""
    from scipy.integrate import solve_ivp

    def slope(at: float, state: F8) -> list[float]:
        return [state[1], acceleration(at, float(state[0]), float(state[1]))]

    found = solve_ivp(slope, (0.0, float(t[-1])), [x, 0.0], "DOP853", t_eval=t, rtol=1e-10, atol=1e-12)
    return found.y[0], found.y[1]


def times(seconds: float, rate_hz: float = 100.0) -> F8:
    """Return the sample times of a record from 0, s."""
    return np.arange(round(seconds * rate_hz)) / rate_hz


def noisy(truth: Truth, t: F8, sigma_m: float, seed: int) -> F8:
    """Return the motion at t with white normal noise, m."""
    return truth.position(t) + sigma_m * np.random.default_rng(seed).standard_normal(t.size)


def fisher_bounds(truth: Truth, t: F8, sigma_m: float) -> dict[str, float]:
    """Return the Cramer-Rao bounds of an exponentially damped sine in white noise, all parameters unknown.

    The derivatives are taken of offset + A e^(-gamma t) cos(omega t + phase) by hand; the period's bound follows
    from the frequency's. ``undamped`` names what holds where gamma is known to be 0.
    """
    decay = np.exp(-truth.gamma * t)
    angle = truth.omega * t + truth.phase
    cosine, sine = decay * np.cos(angle), decay * np.sin(angle)
    columns = {
        "offset": np.ones_like(t),
        "amplitude": cosine,
        "phase": -truth.amplitude * sine,
        "omega": -truth.amplitude * t * sine,
        "gamma": -truth.amplitude * t * cosine,
    }
    jacobian = np.stack(list(columns.values()), axis=1)
    scale = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.inv((jacobian / scale).T @ (jacobian / scale)) / np.outer(scale, scale)
    bounds = dict(zip(columns, sigma_m * np.sqrt(np.diag(inverse)), strict=True))
    return {**bounds, "period": bounds["omega"] * truth.period / truth.omega}
