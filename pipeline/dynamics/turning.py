"""Strang steps of a bob with friction: turning points located, and the latch that holds it there."""

from __future__ import annotations


import numpy as np

from pipeline.dynamics.equation import Problem
from pipeline.dynamics.flow import flow, flows
from pipeline.track import F8

__all__ = ["Friction", "Frictions"]

OVERWHELMING = 1e9  # friction over every other force: it stops the bob before anything else acts
_NEWTON = 8


class Friction:
    """One bob, stepped.

    Parameters
    ----------
    problem : Problem
        Of one trajectory.
    step_s : float
        At most a radian, so that a step holds one turning point at most.
    """

    def __init__(self, problem: Problem, step_s: float) -> None:
        eq = problem.equation
        self.y, self.v = problem.displacement_m, problem.velocity_m_per_s
        self._eq, self._h = eq, step_s
        self._omega, self._gamma = eq.angular_frequency_per_s, eq.gamma_per_s
        self._hold = eq.friction_m_per_s2
        self._shift = eq.friction_m_per_s2 / eq.angular_frequency_per_s**2
        self._half = flow(self._omega, self._gamma, 0.5 * step_s)
        self._way = eq.direction(self.y, self.v)
        if self._hold > OVERWHELMING * (abs(eq.spring(self.y)) + (self._omega + self._gamma) * abs(self.v)):
            self.v, self._way = 0.0, 0

    def step(self) -> None:
        """Go on by one step, around a turning point if one lies within it."""
        if not self._way:
            return
        y, v = self._moved(self._half, self._h)
        if v * self._way > 0.0:
            self.y, self.v = y, v
            return
        spent = self._turning(v)
        y, _ = self._moved(flow(self._omega, self._gamma, 0.5 * spent), spent)
        self.y, self.v = y, 0.0
        self._way = self._eq.direction(y, 0.0)
        left = self._h - spent
        if self._way and left > 0.0:
            self.y, self.v = self._moved(flow(self._omega, self._gamma, 0.5 * left), left)

    def _moved(self, half: tuple[float, float, float, float], h: float) -> tuple[float, float]:
        """Return the state after a step whose half oscillator is given, if it does not turn."""
        a, b, c, d = half
        rest = -self._way * self._shift
        y, v = self.y - rest, self.v
        y, v = a * y + b * v, c * y + d * v
        force = self._eq.cubic_per_m2_s2
        push = 0.5 * h * force * (y + rest) ** 3 if force else 0.0
        v -= push
        v = v / (1.0 + self._eq.drag_per_m * h * abs(v)) - push
        return a * y + b * v + rest, c * y + d * v

    def _turning(self, after: float) -> float:
        """Return the time within the step at which the velocity passes zero: Newton's method between bounds."""
        low, high = 0.0, self._h
        t = self._h * self.v / (self.v - after) if self.v != after else 0.5 * self._h
        for _ in range(_NEWTON):
            y, v = self._moved(flow(self._omega, self._gamma, 0.5 * t), t)
            if v * self._way > 0.0:
                low = t
            else:
                high = t
            slope = -(self._eq.spring(y) + self._way * self._hold + 2.0 * self._gamma * v)
            better = t - v / slope if slope else 0.5 * (low + high)
            if not low <= better <= high:
                better = 0.5 * (low + high)
            if abs(better - t) <= 1e-15 * self._h:
                return better
            t = better
        return t


class Frictions:
    """An ensemble of such bobs; those that turn within a step are treated together.

    Parameters
    ----------
    problem : Problem
        Of an ensemble of m.
    step_s : float
        At most a radian of the fastest.
    """

    def __init__(self, problem: Problem, step_s: float) -> None:
        eq = problem.equation
        self.y: F8 = np.array(problem.displacement_m)
        self.v: F8 = np.array(problem.velocity_m_per_s)
        self._h = step_s
        self._omega, self._gamma, self._drag = eq.angular_frequency_per_s, eq.gamma_per_s, eq.drag_per_m
        self._hold, self._cubic = eq.friction_m_per_s2, eq.cubic_per_m2_s2
        self._shift = eq.friction_m_per_s2 / eq.angular_frequency_per_s**2
        self._half = np.array(flows(self._omega, self._gamma, 0.5 * step_s))
        self._all = np.arange(problem.size)
        others = np.abs(eq.spring(self.y)) + (self._omega + self._gamma) * np.abs(self.v)
        held = self._hold > OVERWHELMING * others
        self.v[held] = 0.0
        self._way = self._directions(self._all)

    def step(self) -> None:
        """Go on by one step."""
        y, v = self._moved(self._all, self._half, self._h)
        turns = np.flatnonzero((v * self._way <= 0.0) & (self._way != 0.0))
        held = self._way == 0.0
        y[held], v[held] = self.y[held], 0.0
        if turns.size:
            spent = self._turning(turns, v[turns])
            self.y[turns], _ = self._moved(turns, self._flows(turns, spent), spent)
            self.v[turns] = 0.0
            self._way[turns] = self._directions(turns)
            left = self._h - spent
            after = self._moved(turns, self._flows(turns, left), left)
            going = self._way[turns] != 0.0
            y[turns] = np.where(going, after[0], self.y[turns])
            v[turns] = np.where(going, after[1], 0.0)
        self.y, self.v = y, v

    def _flows(self, which: F8, t: F8) -> F8:
        return np.array(flows(self._omega[which], self._gamma[which], 0.5 * t))

    def _pull(self, which: F8, y: F8) -> F8:
        return np.asarray(self._omega[which] ** 2 * y + self._cubic[which] * y**3)

    def _directions(self, which: F8) -> F8:
        pull = self._pull(which, self.y[which])
        released = np.where(np.abs(pull) <= self._hold[which], 0.0, -np.sign(pull))
        return np.where(self.v[which] != 0.0, np.sign(self.v[which]), released)

    def _moved(self, which: F8, half: F8, h: float | F8) -> tuple[F8, F8]:
        a, b, c, d = half
        rest = -self._way[which] * self._shift[which]
        y, v = self.y[which] - rest, self.v[which]
        y, v = a * y + b * v, c * y + d * v
        push = 0.5 * h * self._cubic[which] * (y + rest) ** 3
        v = v - push
        v = v / (1.0 + self._drag[which] * h * np.abs(v)) - push
        return a * y + b * v + rest, c * y + d * v

    def _turning(self, which: F8, after: F8) -> F8:
        before, way = self.v[which], self._way[which]
        low, high = np.zeros(which.size), np.full(which.size, self._h)
        t = self._h * np.clip(before / np.where(before == after, 1.0, before - after), 0.0, 1.0)
        for _ in range(_NEWTON):
            y, v = self._moved(which, self._flows(which, t), t)
            ahead = v * way > 0.0
            low, high = np.where(ahead, t, low), np.where(ahead, high, t)
            slope = -(self._pull(which, y) + way * self._hold[which] + 2.0 * self._gamma[which] * v)
            better = t - v / np.where(slope == 0.0, 1.0, slope)
            t = np.where((slope != 0.0) & (better >= low) & (better <= high), better, 0.5 * (low + high))
        return t
