"""Strang steps of a bob with friction: turning points located, and the latch that holds it there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.dynamics.equation import Equation, Problem, Real
from pipeline.dynamics.flow import flow, flows, underdamped
from pipeline.track import F8

__all__ = ["Friction", "Frictions"]

Entries = tuple[F8, F8, F8, F8]
"""The matrix of half a step, each entry of every member."""

OVERWHELMING = 1e9  # friction over every other force: it stops the bob before anything else acts
BLOCK_RADIANS, LONGEST_BLOCK = 1.4, 32  # turning points lie pi apart
_CLOSE = 1e-12  # of a step: the displacement does not feel it where the velocity is 0
_MOST = 40


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
        self._coefficients = tuple(getattr(eq, name) for name in eq.__slots__)
        self._omega, self._gamma = eq.angular_frequency_per_s, eq.gamma_per_s
        self._hold = eq.friction_m_per_s2
        self._shift = eq.friction_m_per_s2 / eq.angular_frequency_per_s**2
        self._half = flow(self._omega, self._gamma, 0.5 * step_s)
        self._way = eq.direction(self.y, self.v)
        if self._hold > OVERWHELMING * (abs(eq.spring(self.y)) + (self._omega + self._gamma) * abs(self.v)):
            self.v, self._way = 0.0, 0

    def run(self, steps: int) -> F8:
        """Go on by so many steps, around the turning points that lie within them; return the states (steps, 2)."""
        kept: list[float] = []
        left = steps
        while left and self._way:
            left = self._straight(left, kept)
            if left:
                self._around()
                kept += (self.y, self.v)
                left -= 1
        states = np.empty((steps, 2))
        states[: steps - left] = np.array(kept).reshape(-1, 2)
        states[steps - left :] = self.y, self.v
        return states

    def _straight(self, steps: int, kept: list[float]) -> int:
        """Step until a turning point lies within the next step; return how many steps are left."""
        a, b, c, d = self._half
        way, keep = self._way, kept.append
        slow, rest = self._eq.drag_per_m * self._h, -way * self._shift
        kick, push = 0.5 * self._h * self._eq.cubic_per_m2_s2, 0.0
        y, v = self.y - rest, self.v
        while steps:
            y1, v1 = a * y + b * v, c * y + d * v
            if kick:
                push = kick * (y1 + rest) ** 3
                v1 -= push
            v1 = v1 / (1.0 + slow * v1) - push if v1 > 0.0 else v1 / (1.0 - slow * v1) - push
            v2 = c * y1 + d * v1
            if v2 * way <= 0.0:
                break
            y, v = a * y1 + b * v1, v2
            keep(y + rest)
            keep(v)
            steps -= 1
        self.y, self.v = y + rest, v
        return steps

    def _around(self) -> None:
        """Make one step that holds a turning point."""
        y, v = self._moved(self._half, self._h)
        spent, way = self._turning(y, v), self._way
        y, _ = self._moved(flow(self._omega, self._gamma, 0.5 * spent), spent)
        self.y, self.v = y, 0.0
        self._way = self._eq.direction(y, 0.0)
        if not self._way:
            return
        left = self._h - spent
        lacking, rate = _lacking(self._coefficients, y, (spent, left), (way, self._way))
        if abs(lacking) < abs(rate) * left:  # else it hardly leaves the turning point
            left += lacking / rate
        if left > 0.0:
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

    def _turning(self, y: float, after: float) -> float:
        """Return the time within the step at which the velocity passes zero: Hermite's guess, then secants."""
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
        """Return the acceleration if it keeps its way."""
        eq = self._eq
        drag = (2.0 * self._gamma + eq.drag_per_m * v * self._way) * v
        return float(-(eq.spring(y) + drag + self._way * self._hold))


def _lacking(
    coefficients: tuple[Real, ...], y: Real, parts: tuple[Real, Real], ways: tuple[Real, Real]
) -> tuple[Real, Real]:
    """Return what the two parts of a step lack in velocity, and the acceleration with which the bob leaves.

    A step h errs in velocity by -K h^3 / 24, with K from the splitting's commutators. Along the motion these errors
    pass over into each other and little adds up. The parts t of a step that a turning point splits err by less: what
    they lack, -K t (h^2 - t^2) / 24 each, would add up over the turning points as the third power of the step.

    Parameters
    ----------
    coefficients : tuple
        Of the equation, in its order.
    y : float or (m,) float64
        Where the bob turns.
    parts, ways : tuple
        Before it and after it: the part's time, and which way the bob moves.
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
    """Return where a cubic through (v0, 0) and (v1, h) with slopes 1 / a0 and 1 / a1 says that v is 0."""
    if a0 == 0.0 or a1 == 0.0 or v0 == v1:
        return 0.5 * h
    s = v0 / (v0 - v1)
    return h * s * s * (3.0 - 2.0 * s) + (v1 - v0) * s * (1.0 - s) * ((1.0 - s) / a0 - s / a1)


class Frictions:
    """An ensemble of such bobs, in blocks of steps; those that turn within a block are treated together.

    Within a block every bob keeps its way. Those that should have turned are then taken up where they did, around their
    turning points all at once, and from there to the block's end; what was written of them meanwhile is written anew.

    Parameters
    ----------
    problem : Problem
        Of an ensemble of m.
    step_s : float
        At most a radian of the fastest.
    """

    def __init__(self, problem: Problem, step_s: float) -> None:
        self.y: F8 = np.array(problem.displacement_m)
        self.v: F8 = np.array(problem.velocity_m_per_s)
        self._h = step_s
        self._all = _Members(problem.equation)
        self._half = self._all.half(np.full(self.y.size, step_s))
        others = np.abs(self._all.pull(self.y)) + self._all.fastest * np.abs(self.v)
        self.v[self._all.hold > OVERWHELMING * others] = 0.0
        self._way = np.where(self.v != 0.0, np.sign(self.v), self._all.released(self.y))
        # As long as few turn twice within a block: those are not treated together.
        fastest = float(np.max(problem.equation.angular_frequency_per_s, initial=0.0))
        self._block = min(max(int(BLOCK_RADIANS / (fastest * step_s or 1.0)), 1), LONGEST_BLOCK)

    def run(self, steps: int, every: int) -> F8:
        """Go on by so many steps; return every so many states, displacements and velocities (2, n, m)."""
        states = np.empty((2, steps // every, self.y.size))
        for done in range(0, steps, self._block):
            within = self._after(min(self._block, steps - done))
            kept = np.arange(-(done + 1) % every, within.shape[1], every)
            states[:, (done + 1 + kept) // every - 1] = within[:, kept]
        return states

    def _after(self, steps: int) -> F8:
        """Go on by a block; return all its states (2, steps, m)."""
        way, rest = self._way, -self._way * self._all.shift
        states = np.empty((2, steps, self.y.size))
        y, v = self.y, self.v
        straight, late, before = way != 0.0, [], []
        for number in range(steps):
            y_after, v_after = self._all.moved(y, v, rest, self._half, self._h)
            turns = np.flatnonzero((v_after * way <= 0.0) & straight)
            late.append(turns)
            if turns.size:
                straight[turns] = False
                before.append((y[turns], v[turns], y_after[turns], v_after[turns]))
            y, v = y_after, v_after
            states[0, number], states[1, number] = y, v
        held = way == 0.0
        if held.any():
            states[0][:, held], states[1][:, held] = self.y[held], 0.0
        if before:
            self._turned(states, late, before)
        self.y, self.v = states[:, -1]
        return states

    def _turned(self, states: F8, late: list[NDArray[np.intp]], before: list[tuple[F8, F8, F8, F8]]) -> None:
        """Write the states, from their turning point to the end of the block, of those that turn."""
        which = np.concatenate(late)
        some, way = self._all[which], self._way[which]
        half = _those(self._half, which)
        y, v, way = self._around(some, way, *(np.concatenate(each) for each in zip(*before, strict=True)))
        count = 0
        for number, turns in enumerate(late):
            if count:  # those of earlier steps go on
                one, entries = some[:count], _those(half, slice(count))
                y[:count], v[:count], way[:count] = self._step(one, entries, y[:count], v[:count], way[:count])
            count += turns.size
            states[0, number, which[:count]], states[1, number, which[:count]] = y[:count], v[:count]
        self._way[which] = way

    def _step(self, some: _Members, half: Entries, y: F8, v: F8, way: F8) -> tuple[F8, F8, F8]:
        """Return states and ways after one step, whoever turns in it."""
        y_after, v_after = some.moved(y, v, -way * some.shift, half, self._h)
        turns = np.flatnonzero(v_after * way <= 0.0)
        if turns.size:
            held = way[turns] == 0.0
            y_after[turns[held]], v_after[turns[held]] = y[turns[held]], 0.0
            turns = turns[~held]
        if turns.size:
            way = way.copy()
            y_after[turns], v_after[turns], way[turns] = self._around(
                some[turns], way[turns], y[turns], v[turns], y_after[turns], v_after[turns]
            )
        return y_after, v_after, way

    def _around(self, some: _Members, way: F8, y: F8, v: F8, y_after: F8, v_after: F8) -> tuple[F8, F8, F8]:
        """Return the states and ways after a step that holds a turning point."""
        spent, y = self._turning(some, y, v, way, y_after, v_after)
        before, way = way, some.released(y)
        left = self._h - spent
        lacking, rate = _lacking(some.coefficients, y, (spent, left), (before, way))
        leaves = np.abs(lacking) < np.abs(rate) * left
        left = left + np.where(leaves, lacking, 0.0) / np.where(leaves, rate, 1.0)
        after = some.moved(y, np.zeros_like(y), -way * some.shift, some.half(left), left)
        return np.where(way != 0.0, after[0], y), np.where(way != 0.0, after[1], 0.0), way

    def _turning(self, some: _Members, y: F8, v: F8, way: F8, y_after: F8, v_after: F8) -> tuple[F8, F8]:
        """Return the times within the step at which velocities pass zero, and the displacements there."""
        low, high = np.zeros(y.size), np.full(y.size, self._h)
        slopes = (some.slope(y, v, way), some.slope(y_after, v_after, way))
        safe = [np.where(slope == 0.0, 1.0, slope) for slope in slopes]
        share = v / np.where(v == v_after, 1.0, v - v_after)
        t = self._h * share**2 * (3.0 - 2.0 * share) + (v_after - v) * share * (1.0 - share) * (
            (1.0 - share) / safe[0] - share / safe[1]
        )
        t = np.where((t > low) & (t < high), t, 0.5 * high)
        rest = -way * some.shift
        before, since = v, low
        for number in range(_MOST):
            y_now, now = some.moved(y, v, rest, some.half(t), t)
            ahead = now * way > 0.0
            low, high = np.where(ahead, t, low), np.where(ahead, high, t)
            # The guess is near: from there along the acceleration, then along secants.
            rise, run = (now - before, t - since) if number else (some.slope(y_now, now, way), 1.0)
            better = t - np.where(rise == 0.0, 0.0, now * run / np.where(rise == 0.0, 1.0, rise))
            better = np.where((better >= low) & (better <= high), better, 0.5 * (low + high))
            before, since = now, t
            change, t = np.abs(better - t), better
            if np.max(change) <= _CLOSE * self._h:
                break
        return t, y_now  # so near the turning point the displacement rests


def _those(half: Entries, which: NDArray[np.intp] | slice) -> Entries:
    a, b, c, d = half
    return a[which], b[which], c[which], d[which]


class _Members:
    """The coefficients of an ensemble, or of some of its members, as arrays."""

    def __init__(self, equation: Equation) -> None:
        self.omega, self.gamma, self.drag, self.hold, self.cubic = (
            getattr(equation, name) for name in equation.__slots__
        )
        self.shift = self.hold / self.omega**2
        self.fastest = self.omega + self.gamma
        self.between = np.sqrt(np.abs((self.gamma - self.omega) * (self.gamma + self.omega)))
        self._turning = bool(np.all(self.gamma < self.omega))
        self._with_cubic = bool(np.any(self.cubic))

    def __getitem__(self, which: NDArray[np.intp] | slice) -> _Members:
        some = object.__new__(_Members)
        for name in ("omega", "gamma", "drag", "hold", "cubic", "shift", "fastest", "between"):
            setattr(some, name, getattr(self, name)[which])
        some._turning, some._with_cubic = self._turning, self._with_cubic
        return some

    @property
    def coefficients(self) -> tuple[F8, ...]:
        """Those of the equation, in its order."""
        return self.omega, self.gamma, self.drag, self.hold, self.cubic

    def half(self, t: F8) -> Entries:
        """Return the matrix of half a step of each its own length."""
        if self._turning:
            return underdamped(self.omega, self.gamma, self.between, 0.5 * t)
        return flows(self.omega, self.gamma, 0.5 * t)

    def pull(self, y: F8) -> F8:
        """Return the spring's pull per mass."""
        return np.asarray(self.omega**2 * y + self.cubic * y * y * y if self._with_cubic else self.omega**2 * y)

    def released(self, y: F8) -> F8:
        """Return which way each moves from rest, 0 where friction holds it."""
        pull = self.pull(y)
        return np.where(np.abs(pull) <= self.hold, 0.0, -np.sign(pull))

    def slope(self, y: F8, v: F8, way: F8) -> F8:
        """Return the acceleration of each if it keeps its way."""
        return np.asarray(-(self.pull(y) + (2.0 * self.gamma + self.drag * v * way) * v + way * self.hold))

    def moved(self, y: F8, v: F8, rest: F8, half: Entries, h: float | F8) -> tuple[F8, F8]:
        """Return the states after a step about the rest position of each one's way, if none turns."""
        a, b, c, d = half
        y = y - rest
        y_middle, speed = a * y, b * v
        y_middle += speed
        np.multiply(c, y, out=y)
        v = d * v
        v += y
        if self._with_cubic:
            reach = y_middle + rest
            push = reach * reach
            push *= reach
            push *= self.cubic
            push *= 0.5 * h
            v -= push
        np.abs(v, out=speed)
        speed *= self.drag
        speed *= h
        speed += 1.0
        v /= speed
        if self._with_cubic:
            v -= push
        np.multiply(a, y_middle, out=y)
        np.multiply(b, v, out=speed)
        y += speed
        y += rest
        np.multiply(c, y_middle, out=y_middle)
        v *= d
        v += y_middle
        return y, v
