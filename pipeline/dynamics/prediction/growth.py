"""How an error grows along a motion whose amplitude falls slowly: from its rates at a few amplitudes.

A method errs in amplitude and phase by some rate at each amplitude. Those rates are seen in a few cycles; the averaged
equations carry them to the end, however far that is.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.prediction.envelope import Envelope, frequency, pace_and_shear
from pipeline.dynamics.problem import Problem
from pipeline.track import F8

__all__ = ["Rates", "grown", "levels", "slow_from"]

SLOW = 0.02  # of the amplitude a radian: a motion that loses less is told from a few of its cycles
SHORT, FIRST = 60.0, 19.0  # radians: of a motion that is looked at whole; of its first cycles
DEEP = 30.0  # starting amplitude over the least that is looked at: what errs below that is small
APART = 6.5  # one level's amplitude over the next one's
SAME = 1.15  # a range of amplitudes that one level stands for
FAR = 0.1  # an error that changes its own growth
CYCLES_LEFT = 24.0  # amplitude over friction's shift of the rest position: three cycles lose half of it

Rate = Callable[[Problem], tuple[float, float]]
"""A start at rest to the relative amplitude error and the phase error that a second adds, 1/s."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """What a method adds to its error at amplitudes (k,), largest first.

    Parameters
    ----------
    amplitude : (k,) float64, m
    of_amplitude, of_phase : (k,) float64, 1/s
    """

    amplitude: F8
    of_amplitude: F8
    of_phase: F8

    @classmethod
    def at(cls, amplitudes: F8, eq: Equation, rate: Rate) -> Rates:
        """Return the rates at some amplitudes."""
        found = np.array([rate(Problem(eq, float(each))) for each in amplitudes])
        return cls(amplitudes, found[:, 0], found[:, 1])


@functools.lru_cache(maxsize=16)
def slow_from(problem: Problem, seconds: float) -> float:
    """Return from when on a motion loses little a cycle, s; the whole time where it never does or is short.

    Parameters
    ----------
    problem : Problem
    seconds : float
    """
    eq = problem.equation
    omega, hold = eq.angular_frequency_per_s, eq.friction_m_per_s2 / eq.angular_frequency_per_s**2
    pace = float(frequency(eq, np.array([problem.amplitude_m()]))[0])
    if eq.gamma_per_s > SLOW * omega or pace * seconds < SHORT:
        return seconds
    gamma, beta, mu = eq.laws()
    course = Envelope.of(problem, seconds)
    a = course.amplitude
    with np.errstate(all="ignore"):
        slow = (gamma + beta * a + mu / a < SLOW * omega) & (a > CYCLES_LEFT * hold)
    if not slow.any():
        return seconds
    first = float(course.t[int(np.argmax(slow))])
    # Drag that outweighs the spring lets the bob creep home first.
    creep = 3.0 * math.sqrt(eq.drag_per_m * problem.amplitude_m())
    return min(seconds, max(first, (creep if first > 0.0 else 0.0) / omega) + FIRST / pace)


def levels(problem: Problem, seconds: float, since: float) -> F8:
    """Return amplitudes, largest first, that stand for those of a motion from a time on, (k,) float64, m."""
    eq = problem.equation
    course = Envelope.of(problem, seconds, since)
    top = float(course.amplitude[0])
    bottom = max(
        float(course.amplitude[-1]), top / DEEP, CYCLES_LEFT * eq.friction_m_per_s2 / eq.angular_frequency_per_s**2
    )
    ratio = top / min(bottom, top)
    count = 1 if ratio < SAME else 2 + int(math.log(ratio) / math.log(APART))
    return np.asarray(top * ratio ** -np.linspace(0.0, 1.0, count)) if count > 1 else np.array([top])


def grown(problem: Problem, seconds: float, since: float, rates: Rates, *, of_velocity: bool = False) -> float:
    """Return the largest error over the starting amplitude that rates make of a motion from a time on.

    Parameters
    ----------
    problem : Problem
    seconds, since : float
        s.
    rates : Rates
    of_velocity : bool
        Of the velocity, over the amplitude times the angular frequency.

    Notes
    -----
    With :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)` an error of the amplitude follows
    :math:`\\dot\\delta = r_A A - (\\gamma + 2\\beta A)\\delta`, and the phase's
    :math:`\\dot\\varphi = r_\\varphi + \\Omega'(A)\\,\\delta`.
    """
    eq, start = problem.equation, problem.amplitude_m()
    _, beta, _ = eq.laws()
    course = Envelope.of(problem, seconds, since)
    t, a = course.t, np.maximum(course.amplitude, 1e-12 * start)
    pace, shear = pace_and_shear(eq, a)
    added = _between(rates.amplitude, rates.of_amplitude, a)
    with np.errstate(all="ignore"):
        lost = np.minimum(_summed(eq.gamma_per_s + 2.0 * beta * a, t), 700.0)
        off = np.exp(-lost) * _summed(np.exp(lost) * a * added, t)
        if np.max(np.abs(off)) > FAR * start:
            off = _far(t, a, added, eq.gamma_per_s, beta)
            if eq.cubic_per_m2_s2 and np.max(off) > start:
                return math.inf  # where the spring is another one
        of_phase = _summed(_between(rates.amplitude, rates.of_phase, a) + shear * pace * off / a, t)
        bend = eq.cubic_per_m2_s2 * a * a
        stiff = eq.angular_frequency_per_s**2
        # Over the amplitude: how fast the displacement passes rest, and how fast the velocity turns.
        fastest = (
            (stiff + bend) / (eq.angular_frequency_per_s * pace) if of_velocity else np.sqrt(stiff + 0.5 * bend) / pace
        )
        turned = 2.0 * np.sin(0.5 * np.minimum(np.abs(of_phase), math.pi))
        error = float(np.max(np.hypot(off * (fastest if of_velocity else 1.0), a * fastest * turned))) / start
    return math.inf if math.isnan(error) else error


def _far(t: F8, a: F8, added: F8, gamma: float, beta: float) -> F8:
    """The error of the amplitude where it is large: what grows by itself, and is held by quadratic drag."""
    off, now = np.zeros_like(a), 0.0
    for k in range(1, len(t)):
        dt, rate = float(t[k] - t[k - 1]), float(added[k])
        now = now + rate * float(a[k]) * dt
        now *= math.exp(min((rate - gamma - 2.0 * beta * float(a[k])) * dt, 700.0))
        now /= 1.0 + beta * abs(now) * dt
        off[k] = now = min(now, 1e300)
    return off


def _summed(values: F8, t: F8) -> F8:
    """The integral from the first time to each, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])


def _between(at: F8, values: F8, wanted: F8) -> F8:
    """Interpolate: by a power law where all values have one sign, beyond the ends as at the ends."""
    x = np.log(wanted / at[-1])
    known = np.log(at[::-1] / at[-1])
    values = values[::-1]
    if np.all(values > 0.0) or np.all(values < 0.0):
        return np.asarray(np.sign(values[0]) * np.exp(np.interp(x, known, np.log(np.abs(values)))))
    return np.asarray(np.interp(x, known, values))
