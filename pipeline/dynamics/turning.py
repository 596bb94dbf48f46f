"""Strang steps of a bob with friction, with located turning points at which friction can hold the bob.

Turning points are located by secants from a Hermite estimate, implemented here for speed. A whole step around a
turning point takes 13 us. One call of scipy.optimize.brentq takes 20 us for a cosine, and here each of its
evaluations would be a step.
"""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.dynamics.flow import Entries, flow
from pipeline.dynamics.problem import Problem

__all__ = ["Friction"]

OVERWHELMING = 1e9  # ratio of friction to the spring and viscous forces above which it stops the bob immediately
UNSEEN = 1e-17  # relative change of a length that is far below rounding
_CLOSE = 1e-12  # accuracy of a turning time, relative to the step; at zero velocity its effect is negligible
_MOST = 40  # maximum number of iterations for a turning time


class Friction:
    """The state of one bob with friction, advanced step by step.

    Parameters
    ----------
    problem : Problem
    step_s : float
        Step in s; at most one radian, so that a step contains at most one turning point.
    """

    def __init__(self, problem: Problem, step_s: float) -> None:
        eq = problem.equation
        self.y, self.v = problem.displacement_m, problem.velocity_m_per_s
        self._eq, self._h = eq, step_s
        self._coefficients = tuple(getattr(eq, name) for name in eq.__slots__)
        self._omega, self._gamma = eq.angular_frequency_per_s, eq.gamma_per_s
        self._hold = eq.friction_m_per_s2
        self._shift = eq.friction_m_per_s2 / eq.angular_frequency_per_s**2
        self._half = flow(self._omega, self._gamma, 0.5 * step_s)
        self._way = eq.direction(self.y, self.v)
        # With overcritical damping the bob need not turn: it counts as held when its displacement no longer changes.
        slow = self._omega * self._omega / (2.0 * self._gamma) if self._gamma > self._omega else 0.0
        self._still = UNSEEN * slow * self._shift
        if self._hold > OVERWHELMING * (abs(eq.spring(self.y)) + (self._omega + self._gamma) * abs(self.v)):
            self.v, self._way = 0.0, 0

    def states(self) -> Iterator[float]:
        """Yield displacement and velocity alternately after each step until the bob is held."""
        while self._way:
            yield from self._straight()
            if self._still and self._moved(self._half, self._h)[1] * self._way >= 0.0:
                self.v = 0.0
                return
            self._around()
            yield self.y
            yield self.v

    def _straight(self) -> Iterator[float]:
        """Step until a turning point lies within the next step."""
        a, b, c, d = self._half
        way = self._way
        slow, rest = self._eq.drag_per_m * self._h, -way * self._shift
        kick, push = 0.5 * self._h * self._eq.cubic_per_m2_s2, 0.0
        y, v = self.y - rest, self.v
        while True:
            y1, v1 = a * y + b * v, c * y + d * v
            if kick:
                push = kick * (y1 + rest) ** 3
                v1 -= push
            v1 = v1 / (1.0 + slow * v1) - push if v1 > 0.0 else v1 / (1.0 - slow * v1) - push
            v2 = c * y1 + d * v1
            if v2 * way <= self._still:
                break
            y, v = a * y1 + b * v1, v2
            yield y + rest
            yield v
        self.y, self.v = y + rest, v

    def _around(self) -> None:
        """Make one step that contains a turning point."""
        y, v = self._moved(self._half, self._h)
        spent, way = self._turning(y, v), self._way
        y, _ = self._moved(flow(self._omega, self._gamma, 0.5 * spent), spent)
        self.y, self.v = y, 0.0
        self._way = self._eq.direction(y, 0.0)
        if not self._way:
            return
        left = self._h - spent
        lacking, rate = _lacking(self._coefficients, y, (spent, left), (way, self._way))
        if abs(lacking) < abs(rate) * left:  # otherwise the bob hardly leaves the turning point
            left += lacking / rate
        if left > 0.0:
            self.y, self.v = self._moved(flow(self._omega, self._gamma, 0.5 * left), left)

    def _moved(self, half: Entries, h: float) -> tuple[float, float]:
        """Return the state after a step h without a turning point; ``half`` is the oscillator's flow over h / 2."""
        a, b, c, d = half
        rest = -self._way * self._shift
        y, v = self.y - rest, self.v
        y, v = a * y + b * v, c * y + d * v
        force = self._eq.cubic_per_m2_s2
        push = 0.5 * h * force * (y + rest) ** 3 if force else 0.0
        v -= push
        v = v / (1.0 + self._eq.drag_per_m * h * abs(v)) - push
        return a * y + b * v + rest, c * y + d * v

    def _turning(self, y: float, after: float) -> float:
        """Return the time within the step at which the velocity is zero, by secants from a Hermite estimate."""
        low, high = 0.0, self._h
        before, since = self.v, 0.0
        t = _guess(self._h, before, after, self._slope(self.y, before), self._slope(y, after))
        if not low < t < high:
            t = 0.5 * high
        for _ in range(_MOST):
            _, v = self._moved(flow(self._omega, self._gamma, 0.5 * t), t)
            if v * self._way > 0.0:
                low = t
            else:
                high = t
            better = t - v * (t - since) / (v - before) if v != before else t
            before, since = v, t
            if not low <= better <= high:
                better = 0.5 * (low + high)
            if abs(better - t) <= _CLOSE * self._h:
                return better
            t = better
        return t

    def _slope(self, y: float, v: float) -> float:
        """Return the acceleration for motion in the present direction."""
        eq = self._eq
        drag = (2.0 * self._gamma + eq.drag_per_m * v * self._way) * v
        return float(-(eq.spring(y) + drag + self._way * self._hold))


def _lacking(
    coefficients: tuple[float, ...], y: float, parts: tuple[float, float], ways: tuple[int, int]
) -> tuple[float, float]:
    """Return the velocity error that a step lacks because a turning point splits it, and the acceleration after it.

    A step h has a velocity error of -K h^3 / 24, with K from the splitting's commutators. Along the motion these
    errors nearly cancel. The two parts t of a step that a turning point splits have smaller errors. The difference,
    -K t (h^2 - t^2) / 24 for each part, would accumulate over the turning points as the third power of the step.

    Parameters
    ----------
    coefficients : tuple
        The coefficients of the equation in the order of its fields.
    y : float
        Displacement at the turning point.
    parts, ways : tuple
        Durations of the parts before and after the turning point, and the directions of motion in them.
    """
    omega, gamma, drag, hold, cubic = coefficients
    stiffness, viscous = omega * omega, 2.0 * gamma
    kick, steeper = -cubic * y * y * y, -3.0 * cubic * y * y
    lacking, rate = 0.0, 0.0
    for t, other, way in ((*parts, ways[0]), (*reversed(parts), ways[1])):
        smooth = -stiffness * y - way * hold
        rate = smooth + kick
        bend = steeper * (smooth + 4.0 * kick) + (viscous * viscous - stiffness) * kick - 2.0 * way * drag * rate * rate
        lacking = lacking - bend * t * other * (t + t + other) / 24.0
    return lacking, rate


def _guess(h: float, v0: float, v1: float, a0: float, a1: float) -> float:
    """Return the time at v = 0 of a cubic t(v) through (v0, 0) and (v1, h) with slopes 1 / a0 and 1 / a1."""
    if a0 == 0.0 or a1 == 0.0 or v0 == v1:
        return 0.5 * h
    s = v0 / (v0 - v1)
    return h * s * s * (3.0 - 2.0 * s) + (v1 - v0) * s * (1.0 - s) * ((1.0 - s) / a0 - s / a1)
