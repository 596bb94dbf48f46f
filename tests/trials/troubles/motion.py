"""A bob on a spring, solved step by step, and what is true of its motion; no code of the estimators is in it.

The equation is solved by the classical Runge-Kutta method of order 4 with a hundred steps a period. What is true of a
motion is read off the solution's own turning points: the amplitude is how far they lie from the rest position, the
damping rate how fast that falls, the period what lies between them. So an error of the steps is no error of the truth.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
GRAVITY_M_PER_S2 = 9.81
STEPS_A_PERIOD = 100


@dataclass(frozen=True, kw_only=True)
class Bob:
    """What moves, and how it starts."""

    omega: float = 8.3  # angular frequency without damping at small amplitudes, rad/s
    amplitude: float = 0.05  # m: displacement A cos(phase) and velocity -A omega sin(phase) at the start
    phase: float = 0.0  # rad
    gamma: float = 0.0  # 1/s, of drag that makes dA/dt = -(mu + gamma A + beta A^2)
    beta: float = 0.0  # 1/(m s)
    mu: float = 0.0  # m/s
    c: float = 0.0  # of drag that makes dA/dt = -c A^n
    n: float = 1.0
    cubic: float = 0.0  # 1/m^2: the restoring force grows by the factor 1 + cubic x^2
    slackens: bool = False  # whether the spring hangs slack above its own length, where only the weight acts
    drift: float = 0.0  # relative change of the stiffness a second, 1/s
    drive: float = 0.0  # acceleration of a periodic force, m/s^2
    drive_omega: float = 0.0  # its angular frequency, rad/s
    drive_chirp: float = 0.0  # how that grows, rad/s^2


class Motion:
    """A solution: displacement from rest, m, at the steps, and what is true of it.

    A lopsided one goes farther to one side of the rest position than to the other.
    """

    def __init__(self, t: F8, x: F8, v: F8, *, lopsided: bool = False) -> None:
        self.t, self.x, self.v, self.lopsided = t, x, v, lopsided

    def position(self, t: F8) -> F8:
        """Return the displacement at t (m,), m, by cubic Hermite interpolation; at rest beyond the last step."""
        return self._between(t)[0]

    def velocity(self, t: F8) -> F8:
        """Return the velocity at t (m,), m/s."""
        return self._between(t)[1]

    def amplitude(self, t: float) -> float:
        """Return the amplitude at a moment, m: half of what lies between the turning points about it."""
        # The turning point of e^(-rt) cos(wt + p) lies where the cosine is cos(arctan(r/w)).
        times, _ = self.turns
        omega = math.pi * (times.size - 1) / (times[-1] - times[0])
        return math.exp(float(self._curve(t))) * math.hypot(1.0, self.rate(t) / omega)

    def rate(self, t: float) -> float:
        """Return how fast the amplitude falls at a moment, relative to itself, 1/s."""
        return -float(self._curve(t, 1))

    def period(self, first: float, last: float) -> float:
        """Return twice the mean time between turning points of first to last, s, by a straight line through them."""
        times, _ = self.turns
        inside = times[(times >= first) & (times <= last)]
        return 2.0 * float(np.polyfit(np.arange(inside.size), inside, 1)[0])

    @cached_property
    def turns(self) -> tuple[F8, F8]:
        """Times and displacements of the turning points."""
        v, step = self.v, np.diff(self.t)
        k = np.flatnonzero((v[:-1] != 0.0) & (v[:-1] * v[1:] <= 0.0))
        # The velocity's straight line, once corrected along the cubic that the displacement follows.
        share = v[k] / (v[k] - v[k + 1])
        for _ in range(3):
            _, slope = self._hermite(k, share)
            bend = (self._hermite(k, share + 1e-5)[1] - slope) / 1e-5
            share = np.clip(share - slope / np.where(bend == 0.0, np.inf, bend), 0.0, 1.0)
        return self.t[k] + share * step[k], self._hermite(k, share)[0]

    @cached_property
    def _curve(self) -> Any:
        """Logarithm of the amplitude against time: a spline through neighbouring turning points' half distances."""
        from scipy.interpolate import CubicSpline

        times, values = self.turns
        size = np.abs(values)
        if self.lopsided:
            # Half the distance between the turning points of either side, whose own mean is not the rest position.
            times, size = times[1:-1], 0.25 * (size[:-2] + 2.0 * size[1:-1] + size[2:])
        return CubicSpline(times, np.log(size))

    def _between(self, t: F8) -> tuple[F8, F8]:
        inside = np.clip(t, self.t[0], self.t[-1])
        k = np.clip(np.searchsorted(self.t, inside, side="right") - 1, 0, self.t.size - 2)
        return self._hermite(k, (inside - self.t[k]) / (self.t[k + 1] - self.t[k]))

    def _hermite(self, k: NDArray[np.int64], s: F8) -> tuple[F8, F8]:
        h = self.t[k + 1] - self.t[k]
        a, b, va, vb = self.x[k], self.x[k + 1], self.v[k] * h, self.v[k + 1] * h
        c, d = 3.0 * (b - a) - 2.0 * va - vb, 2.0 * (a - b) + va + vb
        return a + s * (va + s * (c + s * d)), (va + s * (2.0 * c + 3.0 * s * d)) / h


def swing(bob: Bob, seconds: float, *, start: float = -2.0) -> Motion:
    """Solve the motion of a bob from ``start`` to ``seconds``; it ends where friction holds the bob, if it does.

    The start lies before 0, so that the amplitude at 0 lies between turning points.
    """
    step = 2.0 * math.pi / bob.omega / STEPS_A_PERIOD
    accelerate = _law(bob)
    friction = 0.5 * math.pi * bob.omega * bob.mu
    t, x = start, bob.amplitude * math.cos(bob.phase)
    v = -bob.amplitude * bob.omega * math.sin(bob.phase)
    sign = math.copysign(1.0, -x if v == 0.0 else v)
    ts, xs, vs = [t], [x], [v]
    half = 0.5 * step
    while t < seconds + 2.0:
        push = -sign * friction
        h = step
        for _ in range(2):
            a1 = accelerate(t, x, v) + push
            v2 = v + 0.5 * h * a1
            a2 = accelerate(t + 0.5 * h, x + 0.5 * h * v, v2) + push
            v3 = v + 0.5 * h * a2
            a3 = accelerate(t + 0.5 * h, x + 0.5 * h * v2, v3) + push
            v4 = v + h * a3
            a4 = accelerate(t + h, x + h * v3, v4) + push
            later_x = x + h * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
            later_v = v + h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
            if not friction or later_v * sign >= -1e-12 or h < step:
                break
            # Friction turns with the velocity: a shorter step ends where that is zero.
            h = max(step * v / (v - later_v), 1e-6 * half)
        t, x, v = t + h, later_x, later_v
        if friction and h < step:
            v, sign = 0.0, -sign
        ts.append(t)
        xs.append(x)
        vs.append(v)
        if friction and v == 0.0 and abs(accelerate(t, x, 0.0)) <= friction:
            ts.append(t + step)
            xs.append(x)
            vs.append(0.0)
            break
    return Motion(np.array(ts), np.array(xs), np.array(vs), lopsided=bob.slackens)


def _law(bob: Bob) -> Callable[[float, float, float], float]:
    """Return the acceleration as a function of time, displacement and velocity, friction aside."""
    stiff, drag = bob.omega**2, 2.0 * bob.gamma
    # Averaged over a period, b |v| v makes the amplitude fall by 4 b omega A^2 / (3 pi) a second, and d |v|^(n-1) v
    # by d omega^(n-1) A^n times the mean of |sin|^(n+1).
    square = 0.75 * math.pi * bob.beta / bob.omega
    mean = math.gamma(0.5 * bob.n + 1.0) / (math.sqrt(math.pi) * math.gamma(0.5 * bob.n + 1.5))
    power = bob.c / (bob.omega ** (bob.n - 1.0) * mean)
    sag = GRAVITY_M_PER_S2 / stiff
    plain = not (bob.c or bob.cubic or bob.slackens or bob.drift or bob.drive)

    def simple(t: float, x: float, v: float) -> float:
        return -stiff * x - (drag + square * abs(v)) * v

    def general(t: float, x: float, v: float) -> float:
        force = -stiff * (1.0 + bob.drift * t) * x * (1.0 + bob.cubic * x * x)
        if bob.slackens and x > sag:
            force = -GRAVITY_M_PER_S2
        if bob.c:
            force -= power * abs(v) ** (bob.n - 1.0) * v
        if bob.drive:
            force += bob.drive * math.cos((bob.drive_omega + 0.5 * bob.drive_chirp * t) * t)
        return force - (drag + square * abs(v)) * v

    return simple if plain else general
