"""Friction, linear and quadratic drag in all combinations: one closed form for all eight laws.

It is written by hand because no library has it. An adaptive integrator (scipy's DOP853 at a relative tolerance of
1e-10) takes ninety times as long for the amplitudes of 160 windows, and gives no derivatives.

Notes
-----
:math:`dA/dt = -(\\mu + \\gamma A + \\beta A^2)` is a Riccati equation, so its flow is a Moebius map. With
:math:`s^2 = \\gamma^2/4 - \\beta\\mu`, :math:`C = \\cosh st` and :math:`S = \\sinh(st)/s`,

.. math:: A(t) = \\frac{N}{D} = \\frac{A_0 C - (\\mu + \\gamma A_0/2) S}{C + (\\beta A_0 + \\gamma/2) S},

with determinant 1. Three results follow. First, the derivative by :math:`A_0` is :math:`1/D^2`. Second, a change of
the amplitude at :math:`\\tau` becomes :math:`D(\\tau)^2/D(t)^2` times as large at t. So the derivatives by
:math:`\\mu`, :math:`\\gamma` and :math:`\\beta` are :math:`-D(t)^{-2}` times the integrals of :math:`D^2`, :math:`ND`
and :math:`N^2` from 0 to t. These are combinations of :math:`\\int C^2 = t + s^2 X`, :math:`\\int CS = S^2/2` and
:math:`X = \\int S^2 = (SC - t)/2s^2`. Third, only the sign of :math:`s^2` distinguishes cases. If s is real, numerator
and denominator are divided by :math:`e^{st}`; if it is imaginary, they contain cosine and sine. If :math:`s t` is
small, X is summed as a series.

In the real case the difference :math:`\\gamma/2 - s` would suffer cancellation, so it is calculated as
:math:`\\beta\\mu/(\\gamma/2 + s)`. Friction stops the motion: once :math:`N` reaches zero, the amplitude stays zero.

References
----------
.. [1] K. Lelas, R. Pezer, "On the amplitude decay of damped oscillators", arXiv:2502.07458.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.track import F8
from pipeline.units import Unit

COEFFICIENTS = ("mu", "gamma", "beta")  # coefficients of the powers 0, 1 and 2 of the amplitude


@dataclass(frozen=True)
class Drag:
    """A law whose rate is a sum of powers of the amplitude: friction mu, linear drag gamma, quadratic drag beta."""

    # name, words: short name, and the name in a sentence.
    name: str
    words: str
    # Powers of the amplitude in :math:`-dA/dt`: 0 for friction, 1 for linear, 2 for quadratic drag.
    powers: tuple[int, ...]

    @functools.cached_property
    def parameters(self) -> Mapping[str, Unit]:
        """A0 and the coefficients; the unit for :math:`A^k` is :math:`\\mathrm{m}^{1-k}/\\mathrm{s}`."""
        return {"A0": Unit(1)} | {COEFFICIENTS[power]: Unit(1 - power, -1) for power in self.powers}

    @functools.cached_property
    def cases(self) -> tuple[str, ...]:
        """Names of the laws that have only some of these coefficients."""
        return tuple(law.name for law in DRAGS if set(law.powers) < set(self.powers))

    def curve(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return the closed form; 0 after friction has stopped the motion, infinite beyond a pole of a growing one."""
        full = self._full(theta)
        flow = _flow(t, *full)
        return flow.amplitude, _slopes(t, flow, self.powers, *full).T

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return -(mu + gamma A + beta A^2), or 0 if the amplitude is not positive."""
        _, mu, gamma, beta = self._full(theta)
        return np.asarray(np.where(amplitude > 0.0, -mu - amplitude * (gamma + beta * amplitude), 0.0))

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return start values (p,) for a fit to one or more points in the order of time.

        The integrated equation, :math:`A = A_0 - \\mu t - \\gamma\\int A - \\beta\\int A^2`, is linear in all
        parameters, and integrals of noisy points are far less noisy than their differences.
        """
        level = float(amplitude.max())
        found = np.zeros(len(self.parameters))
        found[0] = max(float(amplitude.mean()), NEGLIGIBLE * level)
        if amplitude.size < 2 or not t[-1] > t[0]:
            return found
        y, span = amplitude / level, float(t[-1])
        columns = [np.ones(t.size)]
        for power in self.powers:
            term = y**power
            # The amplitude is taken as constant up to the first point, which is only part of a period.
            fallen = np.cumsum(0.5 * (term[1:] + term[:-1]) * np.diff(t))
            columns.append(-(term[0] * t[0] + np.concatenate([[0.0], fallen])) / span)
        values = np.linalg.lstsq(np.stack(columns, axis=1), y, rcond=1e-12)[0]
        if np.all(np.isfinite(values)) and values[0] > 0.0:
            found[0] = values[0] * level
            found[1:] = [
                x * level ** (1 - power) / span for power, x in zip(self.powers, values[1:].tolist(), strict=True)
            ]
        return found

    def _full(self, theta: F8) -> tuple[float, float, float, float]:
        """Return A0, mu, gamma and beta; a coefficient that the law lacks is zero."""
        start, *coefficients = theta.tolist()
        full = [0.0, 0.0, 0.0]
        for power, value in zip(self.powers, coefficients, strict=True):
            full[power] = value
        return start, full[0], full[1], full[2]


class _Flow(NamedTuple):
    """The parts of the closed form, (n,) each: amplitude, D, C and S times e^(-st), and terms of the derivatives."""

    amplitude: F8
    denominator: F8
    cosh: F8
    sinh: F8
    fall: F8  # e^(-2st), 1 where s is imaginary
    square: float  # s^2
    ends: F8 | None  # 0 where friction has stopped the motion, infinite beyond a pole, else NaN


def _flow(t: F8, start: float, mu: float, gamma: float, beta: float) -> _Flow:
    square = 0.25 * gamma * gamma - beta * mu
    if square < 0.0:
        pace = math.sqrt(-square)
        angle = np.minimum(pace * t, np.pi)
        cosh, sinh, fall = np.cos(angle), np.sin(angle) / pace, np.ones(t.size)
        numerator = start * cosh - (mu + 0.5 * gamma * start) * sinh
        denominator = cosh + (beta * start + 0.5 * gamma) * sinh
        ends = _turning_ends(pace, pace * t, start, mu, gamma, beta)
    else:
        root = math.sqrt(square)
        # The root of x^2 - gamma x + beta mu with the larger modulus has no cancellation; the other follows from it.
        greater = 0.5 * gamma + math.copysign(root, gamma)
        lesser = beta * mu / greater if greater != 0.0 else 0.0
        fall = np.exp(-2.0 * root * t)
        sinh = np.expm1(-2.0 * root * t) / (-2.0 * root) if root > 0.0 else 1.0 * t
        cosh = 0.5 * fall + 0.5
        numerator = (start if gamma < 0.0 else start * fall) - (mu + lesser * start) * sinh
        denominator = (fall if gamma < 0.0 else 1.0) + (lesser + beta * start) * sinh
        ends = None
        if not (numerator.min() > 0.0 and denominator.min() > 0.0):
            # If beta is not negative, the amplitude reaches zero before a pole, which lies at negative amplitudes.
            lost = (denominator <= 0.0) & (beta < 0.0)
            ends = np.where(lost, np.inf, np.where((numerator <= 0.0) | (denominator <= 0.0), 0.0, np.nan))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        amplitude = numerator / denominator
    if ends is not None:
        amplitude = np.where(np.isnan(ends), amplitude, ends)
    return _Flow(amplitude, denominator, cosh, sinh, fall, square, ends)


def _turning_ends(pace: float, angle: F8, start: float, mu: float, gamma: float, beta: float) -> F8:
    """Return 0 after a stop, infinity beyond a pole and NaN elsewhere, at angles |s|t (n,), where s is imaginary."""
    if beta > 0.0:
        return np.where(angle >= math.atan2(pace * start, mu + 0.5 * gamma * start), 0.0, np.nan)
    return np.where(angle >= math.atan2(pace, -beta * start - 0.5 * gamma), np.inf, np.nan)


def _slopes(t: F8, flow: _Flow, powers: tuple[int, ...], start: float, mu: float, gamma: float, beta: float) -> F8:
    """Return the derivatives (p, n) of the amplitude by A0 and by the coefficients of some powers."""
    # All terms below contain the factor e^(-2st), because the scaled D^-2 contains its inverse.
    elapsed = flow.fall * t
    squares = _integral_of_squares(t, flow, elapsed)
    cosines = elapsed + flow.square * squares
    mixed = 0.5 * flow.sinh * flow.sinh
    pull, push = mu + 0.5 * gamma * start, beta * start + 0.5 * gamma
    # The weights of C^2, CS and S^2 in the integrals of D^2, ND and N^2.
    by_mu, by_gamma = (1.0, 2.0 * push, push * push), (start, start * push - pull, -pull * push)
    shares = by_mu, by_gamma, (start * start, -2.0 * start * pull, pull * pull)
    slopes = np.empty((1 + len(powers), t.size))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        over = -1.0 / (flow.denominator * flow.denominator)
        slopes[0] = -over * flow.fall
        for row, power in zip(slopes[1:], powers, strict=True):
            of_cosines, of_mixed, of_squares = shares[power]
            row[:] = over * (of_cosines * cosines + of_mixed * mixed + of_squares * squares)
    if flow.ends is not None:
        # After the stop all derivatives are zero; beyond a pole they are infinite like the amplitude.
        slopes = np.where(np.isnan(flow.ends), slopes, flow.ends)
    return slopes


def _integral_of_squares(t: F8, flow: _Flow, elapsed: F8) -> F8:
    """Return e^(-2st) times the integral of S^2 from 0 to t, by a series where the closed form would cancel."""
    z = flow.square * t * t
    small = np.abs(z) < 0.05
    series = elapsed * t * t
    if small.any():
        series *= 1.0 / 3.0 + z * (1.0 / 15.0 + z * (2.0 / 315.0 + z * (1.0 / 2835.0 + z * 2.0 / 155925.0)))
        if small.all():
            return np.asarray(series)
    with np.errstate(over="ignore", invalid="ignore"):
        closed = (flow.sinh * flow.cosh - elapsed) / (2.0 * flow.square)
        return np.asarray(np.where(small, series, closed))


def amplitudes(t: F8, theta: F8) -> F8:
    """Return the amplitudes of several motions: 0 after a stop by friction, infinite beyond a pole."""
    return np.array([_flow(t, *row).amplitude for row in theta.tolist()])


DRAGS: tuple[Drag, ...] = (
    Drag("none", "no damping", ()),
    Drag("linear", "linear drag", (1,)),
    Drag("quadratic", "quadratic drag", (2,)),
    Drag("friction", "dry friction", (0,)),
    Drag("linear+quadratic", "linear and quadratic drag together", (1, 2)),
    Drag("linear+friction", "linear drag and dry friction together", (1, 0)),
    Drag("quadratic+friction", "quadratic drag and dry friction together", (2, 0)),
    Drag("linear+quadratic+friction", "linear and quadratic drag and dry friction together", (1, 2, 0)),
)
