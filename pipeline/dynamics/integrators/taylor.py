"""Taylor series of any order with turning points located: the reference among the integrators.

By hand, as nothing of scipy's is as exact: over two minutes of mixed drag it errs by 1e-14 of the amplitude in 0.15 s,
DOP853 at its least tolerance by 8e-12 in 4 s.

Between turning points the equation has no kink, and its solution's Taylor coefficients follow from each other. The
step is as long as the last coefficients allow; where the velocity passes zero the series ends, the signs of drag and
friction change, and a bob that the spring pulls with less than friction holds stays where it is.

References
----------
.. [1] A. Jorba, M. Zou, Exp. Math. 14 (2005) 99, doi:10.1080/10586458.2005.10128904.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from operator import mul

import numpy as np

from pipeline.dynamics.amplitude import stopping_time
from pipeline.dynamics.equation import Equation
from pipeline.dynamics.flow import flow
from pipeline.dynamics.integrator import Integrator, demand_times
from pipeline.dynamics.prediction.envelope import frequency, pace_and_shear
from pipeline.dynamics.prediction.growth import Rates, grown, levels, slow_from
from pipeline.dynamics.prediction.pilot import in_own_units
from pipeline.dynamics.prediction.rounding import expected_rounding, rounding_error, sheared_rounding
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["TAYLOR", "Taylor"]

LONGEST = 1.6  # radians a step; turning points lie twice as far apart
MOST_STEPS = 200_000
MOST_LOOKS = 400  # steps from which an error is told


@dataclass(frozen=True, slots=True)
class Taylor(Integrator):
    """Adaptive Taylor series.

    Parameters
    ----------
    tolerance : float
        Error over the amplitude at the end of the run; the step passed to :meth:`run` is only the spacing of what is
        kept.
    longest : float
        Radians a step at most.
    """

    name: str = "taylor"
    words: str = "adaptive Taylor series with turning points located"
    order: int = 0
    tolerance: float = 1e-13
    longest: float = LONGEST

    def refusal(self, problem: Problem) -> str:
        """Return why not, where viscous drag is so stiff that the series would take a step for nothing."""
        eq = problem.equation
        if eq.gamma_per_s > 1e4 * eq.angular_frequency_per_s:
            return "viscous drag this stiff needs a step far below the motion's own time; take strang, exact or auto"
        return ""

    def bound(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return the tolerance, or the rounding where that is more; inf for more steps than it takes."""
        demand_times(step_s, seconds)
        problem, _ = problem.scaled()
        eq = problem.equation
        # Where drag outweighs the spring its own time is what a step has; at a turning point another step ends.
        stiff = math.sqrt(1.0 + eq.drag_per_m * problem.amplitude_m())
        turns = min(seconds, _held(problem)) * float(frequency(eq, np.array([problem.amplitude_m()]))[0]) / math.pi
        longest = (_fastest(problem) * stiff + eq.gamma_per_s) * seconds / self.longest
        if longest + (turns if _kinked(eq) else 0.0) > MOST_STEPS:
            return math.inf
        return max(self.tolerance, rounding_error(problem, seconds))

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what the first terms left out add up to, and the rounding; inf for more steps than it takes."""
        return self._predicted(problem, step_s, seconds, of_velocity=False)

    def predicted_velocity_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return the same of the velocity."""
        return self._predicted(problem, step_s, seconds, of_velocity=True)

    def _predicted(self, problem: Problem, step_s: float, seconds: float, *, of_velocity: bool) -> float:
        bound = self.bound(problem, step_s, seconds)
        if math.isinf(bound) or self.refusal(problem):
            return math.inf
        return min(bound, left_out(in_own_units(problem), self, seconds, of_velocity=of_velocity))

    def order_of(self, problem: Problem, seconds: float) -> int:
        """Return the number of terms of its series."""
        return _order(local_error(problem, seconds, self.tolerance), self.longest)

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve from turning point to turning point."""
        states = _solve(problem, step_s * every, steps // every + 1, self.tolerance, self.longest)
        return states[:, 0], states[:, 1]


TAYLOR = Taylor()


def _fastest(problem: Problem) -> float:
    """The frequency of a spring as hard as it gets, 1/s."""
    eq = problem.equation
    start = problem.amplitude_m()
    return math.sqrt(eq.angular_frequency_per_s**2 + 3.0 * max(eq.cubic_per_m2_s2, 0.0) * start * start)


def local_error(problem: Problem, seconds: float, tolerance: float) -> float:
    """What a step may err so that all of them keep the tolerance."""
    eq, start = problem.equation, problem.amplitude_m()
    reach = start / eq.angular_frequency_per_s
    # Under a cubic spring an error of the amplitude shifts the frequency, and the phase for all the time that is left.
    bend = 0.75 * abs(eq.cubic_per_m2_s2) * reach * reach
    radians = _fastest(problem) * seconds
    drifts = 1.0 + bend / (1.0 + bend) * radians if bend < math.inf else 1.0 + radians
    return max(tolerance / (1.0 + radians) / drifts, 1e-18)


def _order(local: float, longest: float) -> int:
    return next(p for p in range(6, 60) if longest**p / math.factorial(p) < local)


STRONG = 0.3  # drag over spring at the starting amplitude from which errors die out as fast
CYCLES = 2  # from which the error of all is told
SCATTERS = 1.4  # of the relative rounding, times the root of the phase: what many sums leave


def left_out(problem: Problem, method: Taylor, seconds: float, *, of_velocity: bool) -> float:
    """Return the error that the terms left out make of a whole run, over the starting amplitude, and the rounding.

    Parameters
    ----------
    problem : Problem
        With its own amplitude as the unit.
    method : Taylor
    seconds : float
    of_velocity : bool
        Of the velocity, over the amplitude times the angular frequency.

    Notes
    -----
    A step errs by the first terms that it leaves out. Of some cycles, the first and some at amplitudes on the way, they
    are summed as errors of energy and of time, which the averaged motion carries to the end.
    """
    start = problem.amplitude_m()
    if start == 0.0:
        return 0.0
    first, rates, since = _cycles(problem, method, seconds)
    error = first[of_velocity] / start
    if rates is not None:
        error += grown(problem, seconds, since, rates, of_velocity=of_velocity)
    return error + expected_rounding(problem, seconds, SCATTERS, 0.5) + sheared_rounding(problem, seconds, SCATTERS)


@functools.lru_cache(maxsize=8)
def _cycles(problem: Problem, method: Taylor, seconds: float) -> tuple[tuple[float, float], Rates | None, float]:
    """Return the largest errors so far of the first cycles, the rates after them, and from when these hold."""
    local = local_error(problem, seconds, method.tolerance)
    since = slow_from(problem, seconds)
    eq = problem.equation
    first, _ = _lacking(problem, local, method.longest, since)
    if since >= seconds:
        return first, None, since

    def rate(level: Problem) -> tuple[float, float]:
        cycle = 2.0 * math.pi / float(frequency(eq, np.array([level.displacement_m]))[0])
        return _lacking(level, local, method.longest, CYCLES * cycle)[1]

    return first, Rates.at(levels(problem, seconds, since), eq, rate), since


def _lacking(
    problem: Problem, local: float, longest: float, seconds: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the largest errors of displacement and of velocity per radian, and what a second adds.

    Along the motion an error is one of time, across it one of size. Another size is another pace under a cubic spring.
    """
    eq, reach = problem.equation, problem.amplitude_m()
    omega = eq.angular_frequency_per_s
    pace, shear = (float(each[0]) for each in pace_and_shear(eq, np.array([reach])))
    stiff = omega**2 + eq.cubic_per_m2_s2 * reach**2
    looks = itertools.islice(pieces(problem, local, longest, spare=True), MOST_LOOKS)
    if eq.drag_per_m * reach > STRONG:
        return _carried(eq, problem.displacement_m, looks, seconds), (0.0, 0.0)
    time = of_size = of_time = 0.0
    most = [0.0, 0.0]
    for piece in looks:
        if piece.long == math.inf:
            break
        (y, v), (dy, dv) = piece.end, piece.lacks
        pull = float(eq.spring(y))
        speed = v * v + pull * pull / stiff
        if speed == 0.0:
            continue
        of_time += (dy * v - dv * pull / stiff) / speed - shear * of_size * piece.long
        of_size += (v * dv + pull * dy) / (reach * reach * stiff)
        time += piece.long
        size = abs(of_size) * max(abs(y), abs(v) / omega)
        most[0] = max(most[0], abs(of_time * v) + size)
        most[1] = max(most[1], abs(of_time * pull / omega) + size)
        if time >= seconds * (1.0 - 1e-9):
            break
    return (most[0], most[1]), (of_size / time if time else 0.0, of_time * pace / time if time else 0.0)


def _carried(eq: Equation, y: float, looks: Iterator[Piece], seconds: float) -> tuple[float, float]:
    """Return the largest errors where drag outweighs the spring and damps them too, each step's by its own drag."""
    omega = eq.angular_frequency_per_s
    off_y = off_v = time = 0.0
    most = [0.0, 0.0]
    for piece in looks:
        if piece.long == math.inf:
            break
        drag = eq.gamma_per_s + eq.drag_per_m * abs(piece.end[0] - y) / piece.long
        a, b, c, d = flow(omega, drag, piece.long)
        off_y, off_v = a * off_y + b * off_v + piece.lacks[0], c * off_y + d * off_v + piece.lacks[1]
        most = [max(most[0], abs(off_y)), max(most[1], abs(off_v) / omega)]
        y, time = piece.end[0], time + piece.long
        if time >= seconds:
            break
    return most[0], most[1]


def _held(problem: Problem) -> float:
    """When friction holds the bob, s; beyond critical damping it never quite does."""
    eq = problem.equation
    return stopping_time(problem.amplitude_m(), *eq.laws()) if eq.gamma_per_s < eq.angular_frequency_per_s else math.inf


def _kinked(eq: Equation) -> bool:
    return eq.drag_per_m > 0 or eq.friction_m_per_s2 > 0


def _solve(problem: Problem, apart: float, count: int, tolerance: float, longest: float) -> F8:
    """Return the states (count, 2) at multiples of a time apart."""
    states = np.empty((count, 2))
    states[0] = problem.displacement_m, problem.velocity_m_per_s
    local = local_error(problem, apart * count, tolerance)
    too_long = DynamicsError(
        f"taylor needs more than {MOST_STEPS} steps for {apart * (count - 1):g} s; take a shorter run, strang or auto"
    )
    if _fastest(problem) * min(apart * (count - 1), _held(problem)) > longest * MOST_STEPS:
        raise too_long
    row, since = 0, 0.0  # the last state kept, and the time since: a sum of short times rounds little
    for each in itertools.islice(pieces(problem, local, longest), MOST_STEPS):
        if each.long == math.inf:
            states[row + 1 :] = each.end
            return states
        row, since = _keep(states, row, since, apart, each)
        if row == count - 1:
            return states
    raise too_long


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One step.

    Parameters
    ----------
    ys, vs : list of float
        The series in powers of t / unit.
    unit, long : float
        s; inf long where friction holds the bob.
    end : tuple of float
        Displacement and velocity where the next piece starts.
    lacks : tuple of float
        The first terms left out, there.
    """

    ys: list[float]
    vs: list[float]
    unit: float
    long: float
    end: tuple[float, float]
    lacks: tuple[float, float] = (0.0, 0.0)


def pieces(problem: Problem, local: float, longest: float, *, spare: bool = False) -> Iterator[Piece]:
    """Yield one step after the other, without end.

    Parameters
    ----------
    problem : Problem
    local : float
        What a step may err, over the size of the motion.
    longest : float
        Radians a step.
    spare : bool
        Whether to say what the first terms left out come to.
    """
    eq = problem.equation
    y, v = problem.displacement_m, problem.velocity_m_per_s
    fast, order, kinked = _fastest(problem), _order(local, longest), _kinked(eq)
    lacks = (0.0, 0.0)
    while True:
        way = eq.direction(y, v) if kinked else 1
        if way == 0:
            yield Piece([y], [0.0], 1.0, math.inf, (y, 0.0))
            return
        unit = min(1.0 / fast, 0.5 / eq.gamma_per_s if eq.gamma_per_s else math.inf)
        if eq.drag_per_m:
            # The drag's own time shrinks with speed; where friction is strong it is the speed within the step.
            unit = min(unit, 1.0 / (eq.drag_per_m * (abs(v) + abs(y) * fast)) if abs(v) + abs(y) else unit)
        ys, vs = _series(eq, way, y, v, unit, order + spare)
        next_y, next_v = (ys.pop(), vs.pop()) if spare else (0.0, 0.0)
        size = max(abs(y), abs(v) / fast, abs(ys[2]))
        h = min(_step(ys, vs, size, local, unit * fast), longest / (unit * fast))
        end = _polynomial(vs, h)
        turned = kinked and end * way <= 0.0
        if turned:
            h = _root(vs, h, way)
        y, v = _polynomial(ys, h), 0.0 if turned else _polynomial(vs, h)
        if spare:
            lacks = next_y * h ** (order + 1), next_v * h ** (order + 1)
        yield Piece(ys, vs, unit, h * unit, (y, v), lacks)


def _series(eq: Equation, way: int, y: float, v: float, unit: float, order: int) -> tuple[list[float], list[float]]:
    """Return the coefficients of displacement and velocity in powers of t / unit."""
    stiffness, viscous = eq.angular_frequency_per_s**2, 2.0 * eq.gamma_per_s
    drag, cubic = way * eq.drag_per_m, eq.cubic_per_m2_s2
    ys, vs, squares = [y], [v], [y * y]
    force = way * eq.friction_m_per_s2
    for k in range(order):
        change = -stiffness * ys[k] - viscous * vs[k] - force
        force = 0.0
        if drag:
            change -= drag * sum(map(mul, vs, reversed(vs)))
        if cubic:
            change -= cubic * sum(map(mul, squares, reversed(ys)))
        ys.append(unit * vs[k] / (k + 1))
        vs.append(unit * change / (k + 1))
        if cubic:
            squares.append(sum(map(mul, ys, reversed(ys))))
    return ys, vs


def _step(ys: list[float], vs: list[float], size: float, local: float, radians: float) -> float:
    """Return the step, in units, at which the last terms fall to the local tolerance."""
    longest = math.inf
    for back in (1, 2):
        # Displacement and velocity over the same size: velocity per radian of the unit.
        last = max(abs(ys[-back]), abs(vs[-back]) * radians)
        if last > 0.0:
            longest = min(longest, (local * size / last) ** (1.0 / (len(ys) - back)))
    return longest


def _polynomial(coefficients: list[float], x: float) -> float:
    value = 0.0
    for c in reversed(coefficients):
        value = value * x + c
    return value


def _root(vs: list[float], h: float, way: int) -> float:
    """Return where in (0, h] the velocity leaves its sign."""
    slopes = [k * c for k, c in enumerate(vs)][1:]
    low, high = 0.0, h
    x = h
    for _ in range(60):
        value = _polynomial(vs, x)
        low, high = (x, high) if value * way > 0.0 else (low, x)
        slope = _polynomial(slopes, x)
        better = x - value / slope if slope else low
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - x) <= 1e-16 * h:
            return better
        x = better
    return x


def _keep(states: F8, row: int, since: float, apart: float, piece: Piece) -> tuple[int, float]:
    """Fill in the states that the step passes; return the last one's row and the time since."""
    passed = min(math.floor((since + piece.long) / apart), len(states) - 1 - row)
    if passed:
        times = (apart * np.arange(1, passed + 1) - since) / piece.unit
        powers = np.vander(times, len(piece.ys), increasing=True)
        states[row + 1 : row + 1 + passed] = powers @ np.array((piece.ys, piece.vs)).T
    return row + passed, since + piece.long - passed * apart
