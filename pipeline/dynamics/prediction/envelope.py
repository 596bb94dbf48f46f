"""How the amplitude of a motion falls, at few times: where errors are added up along it."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.amplitude import amplitude, stopping_time
from pipeline.dynamics.equation import Equation
from pipeline.dynamics.problem import Problem
from pipeline.track import F8

__all__ = ["Envelope", "frequency", "pace_and_shear", "slow_rate"]

POINTS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Envelope:
    """The averaged amplitude at times that lie closer where it falls faster.

    Parameters
    ----------
    t : (n,) float64, s
        From 0 to the end, or to where friction holds the bob.
    amplitude : (n,) float64, m
    share : (n,) float64
        Amplitude over that of the start.
    """

    t: F8
    amplitude: F8
    share: F8

    @classmethod
    @functools.lru_cache(maxsize=16)
    def of(cls, problem: Problem, seconds: float, since: float = 0.0) -> Envelope:
        """Return the envelope of a motion with an amplitude, from a time on.

        Parameters
        ----------
        problem : Problem
        seconds, since : float
            s.
        """
        problem, unit = problem.scaled()
        eq, start = problem.equation, problem.amplitude_m()
        _, beta, mu = eq.laws()
        slow = slow_rate(eq)
        with np.errstate(all="ignore"):
            fall = slow + beta * start + mu / start
            time = 1.0 / fall if fall > 0.0 else math.inf
            span = min(seconds - since, stopping_time(start, slow, beta, mu))
            # From uniform where little is lost to geometric where all is.
            x = np.linspace(0.0, 1.0, POINTS)
            long = math.log1p(span / time) if time > 0.0 else 700.0
            t = span * (x if long < 1e-3 else np.expm1(long * x) / math.expm1(min(long, 700.0)))
            a = amplitude(start, slow, beta, mu, since + t)
        return cls(since + t, a * unit, a / start)


def slow_rate(eq: Equation) -> float:
    """Return the rate at which viscous drag ends a motion, 1/s: beyond critical damping that of the slower part."""
    omega, gamma = eq.angular_frequency_per_s, eq.gamma_per_s
    return omega * (omega / (gamma + math.sqrt((gamma - omega) * (gamma + omega)))) if gamma > omega else gamma


def frequency(eq: Equation, amplitude_m: F8) -> F8:
    """Return the angular frequency of the undamped motion with amplitudes (n,), 1/s.

    Notes
    -----
    :math:`\\sqrt{\\omega^2 + cA^2}\\,\\mathrm{agm}(1, \\sqrt{1-m})` with :math:`m = cA^2/2(\\omega^2+cA^2)`: by
    the arithmetic-geometric mean, the complete elliptic integral of the cubic spring's quarter period.
    """
    stiffness = eq.angular_frequency_per_s**2
    if not eq.cubic_per_m2_s2:
        return np.full_like(amplitude_m, eq.angular_frequency_per_s)
    bend = eq.cubic_per_m2_s2 * amplitude_m * amplitude_m
    one, other = np.ones_like(bend), np.sqrt(1.0 - 0.5 * bend / (stiffness + bend))
    for _ in range(6):
        one, other = 0.5 * (one + other), np.sqrt(one * other)
    return np.asarray(np.sqrt(stiffness + bend) * one)


def pace_and_shear(eq: Equation, amplitude_m: F8) -> tuple[F8, F8]:
    """Return the frequency (n,), 1/s, and by what share of itself it changes for one of the amplitude (n,)."""
    pace = frequency(eq, amplitude_m)
    if not eq.cubic_per_m2_s2:
        return pace, np.zeros_like(pace)
    return pace, (frequency(eq, 1.001 * amplitude_m) - frequency(eq, 0.999 * amplitude_m)) / (0.002 * pace)
