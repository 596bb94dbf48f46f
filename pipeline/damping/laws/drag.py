"""Friction, linear and quadratic drag, alone and together: one closed form for all eight laws.

Notes
-----
:math:`dA/dt = -(\\mu + \\gamma A + \\beta A^2)` is a Riccati equation, so its flow is a Moebius map. With
:math:`s^2 = \\gamma^2/4 - \\beta\\mu`, :math:`C = \\cosh st` and :math:`S = \\sinh(st)/s`,

.. math:: A(t) = \\frac{N}{D} = \\frac{A_0 C - (\\mu + \\gamma A_0/2) S}{C + (\\beta A_0 + \\gamma/2) S},

of determinant 1. Three things follow. The derivative by :math:`A_0` is :math:`1/D^2`. An impulse at :math:`\\tau`
arrives at t as :math:`D(\\tau)^2/D(t)^2` of itself, so the derivatives by :math:`\\mu`, :math:`\\gamma` and
:math:`\\beta` are :math:`-D(t)^{-2}` times the integrals of :math:`D^2`, :math:`ND` and :math:`N^2` from 0 to t, which
are combinations of :math:`\\int C^2 = t + s^2 X`, :math:`\\int CS = S^2/2` and
:math:`X = \\int S^2 = (SC - t)/2s^2`. And nothing but the sign of :math:`s^2` makes a case: numerator and denominator
are divided by :math:`e^{st}` where s is real and taken with cosine and sine where it is imaginary; where :math:`s t` is
small X is summed as a series.

In the real case the difference :math:`\\gamma/2 - s` would cancel, so it is taken as
:math:`\\beta\\mu/(\\gamma/2 + s)`. Friction stops the motion: after :math:`N` reaches zero the amplitude stays zero.

References
----------
.. [1] K. Lelas, R. Pezer, "On the amplitude decay of damped oscillators", arXiv:2502.07458.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.track import F8

__all__ = ["FADING", "Drag", "amplitudes", "fading", "guesses", "jacobians_of"]

UNITS = {"A0": "m", "mu": "m/s", "gamma": "1/s", "beta": "1/(m s)"}
POWERS = {"mu": 0, "gamma": 1, "beta": 2}
SLOTS = tuple(UNITS)  # where each parameter stands in the full set of four
FLOOR = 1e-3  # share of the greatest amplitude below which a start value divides by nothing smaller


@dataclass(frozen=True, slots=True)
class Drag:
    """A law with some of friction mu, linear drag gamma and quadratic drag beta.

    Parameters
    ----------
    name, words : str
    parameters : tuple of str
        "A0" and the coefficients.
    """

    name: str
    words: str
    parameters: tuple[str, ...]

    @property
    def units(self) -> tuple[str, ...]:
        """Of the parameters."""
        return tuple(UNITS[name] for name in self.parameters)

    @property
    def cases(self) -> tuple[str, ...]:
        """Every law with fewer of the coefficients."""
        mine = set(self.parameters)
        return tuple(law.name for law in DRAGS if set(law.parameters) < mine)

    @property
    def slots(self) -> tuple[int, ...]:
        """Places of the parameters in the full set (A0, mu, gamma, beta)."""
        return tuple(SLOTS.index(name) for name in self.parameters)

    def full(self, theta: F8) -> F8:
        """Return (1, 4) float64: the full set, absent coefficients zero."""
        whole = np.zeros((1, 4))
        whole[0, list(self.slots)] = theta
        return whole

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return the closed form."""
        if self._fades(t, theta):
            start, _, gamma, beta = self.full(theta)[0].tolist()
            return _faded(t, start, gamma, beta)
        return np.asarray(amplitudes(t, self.full(theta))[0])

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return the derivatives by A0 and the coefficients."""
        return self.both(t, theta)[1]

    def both(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return amplitude and jacobian, which share most of their work."""
        if self._fades(t, theta):
            amplitude, by = FADING[self.parameters](t, *theta.tolist())
            return amplitude, np.ascontiguousarray(by.T)
        amplitudes, by = jacobians_of(t, self.full(theta))
        return amplitudes[0], np.ascontiguousarray(by[0, list(self.slots)].T)

    def _fades(self, t: F8, theta: F8) -> bool:
        """Whether the amplitude only falls, and never to a stop: no friction, and nothing negative."""
        return "mu" not in self.parameters and bool(theta.min() >= 0.0) and bool(t.min(initial=0.0) >= 0.0)

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return mu + gamma A + beta A^2; nothing where there is no amplitude left."""
        rate = np.zeros_like(amplitude)
        for name, value in zip(self.parameters[1:], theta[1:].tolist(), strict=True):
            rate += value * amplitude ** POWERS[name]
        return np.asarray(np.where(amplitude > 0.0, rate, 0.0))

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return the coefficients of a line through integrals of the amplitudes."""
        return guesses(t, amplitude, (self,))[0, list(self.slots)]

    def rescaled(self, theta: F8, length_m: float) -> F8:
        """Return theta with lengths divided by ``length_m``."""
        powers = {"A0": -1.0, "mu": -1.0, "gamma": 0.0, "beta": 1.0}
        return np.asarray(theta * length_m ** np.array([powers[name] for name in self.parameters]))


class _Flow(NamedTuple):
    """The parts of the closed form, all (k, n): N and D times e^(-st), and what the derivatives need."""

    time: F8
    numerator: F8
    denominator: F8
    cosh: F8
    sinh: F8
    fall: F8  # e^(-2st), 1 where s is imaginary
    square: F8  # s^2, (k, 1)
    ends: NDArray[np.float64] | None  # 0 where friction has stopped the motion, infinite beyond a pole, else NaN


def _flow(t: F8, theta: F8) -> _Flow:
    start, mu, gamma, beta = theta.T[:, :, None]
    square = 0.25 * gamma * gamma - beta * mu
    root = np.sqrt(np.maximum(square, 0.0))
    growing = gamma < 0.0
    # The greater root of x^2 - gamma x + beta mu in size is safe, the lesser is their product over it.
    greater = 0.5 * gamma + np.where(growing, -root, root)
    lesser = np.divide(beta * mu, greater, out=np.zeros_like(greater), where=greater != 0.0)
    twice = 2.0 * root
    power = twice * -t
    fall = np.exp(power)
    sinh = np.expm1(power, out=power)
    sinh /= np.where(twice > 0.0, -twice, -1.0)
    sinh[twice[:, 0] == 0.0] = t
    cosh = 0.5 * fall
    cosh += 0.5
    numerator = start * fall
    numerator -= (mu + lesser * start) * sinh
    denominator = (lesser + beta * start) * sinh
    if growing.any():
        rows = growing[:, 0]
        numerator[rows] += start[rows] * (1.0 - fall[rows])
        denominator[rows] += fall[rows]
        denominator[~rows] += 1.0
    else:
        denominator += 1.0
    turning = np.flatnonzero(square[:, 0] < 0.0)
    if turning.size:
        pace = np.sqrt(-square[turning])
        angle = np.minimum(pace * t, np.pi)
        cosh[turning], sinh[turning], fall[turning] = np.cos(angle), np.sin(angle) / pace, 1.0
        c, s, a = cosh[turning], sinh[turning], start[turning]
        numerator[turning] = a * c - (mu[turning] + 0.5 * gamma[turning] * a) * s
        denominator[turning] = c + (beta[turning] * a + 0.5 * gamma[turning]) * s
    ends = None
    if turning.size or min(numerator.min(), denominator.min()) <= 0.0:
        ends = _ends(t, theta, numerator, denominator, square)
    return _Flow(t, numerator, denominator, cosh, sinh, fall, square, ends)


def _ends(t: F8, theta: F8, numerator: F8, denominator: F8, square: F8) -> NDArray[np.float64]:
    """What becomes of amplitudes that have an end: at rest, or beyond a pole."""
    start, mu, gamma, beta = theta.T[:, :, None]
    # Zero is reached before a pole where beta is not negative, for a pole is then on the side of negative amplitudes.
    lost = (denominator <= 0.0) & (beta < 0.0)
    ends = np.where(lost, np.inf, np.where((numerator <= 0.0) | (denominator <= 0.0), 0.0, np.nan))
    turning = np.flatnonzero(square[:, 0] < 0.0)
    if turning.size:
        a, m, g, b = start[turning], mu[turning], gamma[turning], beta[turning]
        pace = np.sqrt(-square[turning])
        # Both coefficients have one sign: positive ones end in rest, negative ones at a pole.
        rest = np.arctan2(pace * a, m + 0.5 * g * a)
        pole = np.arctan2(pace, -b * a - 0.5 * g)
        over = pace * t >= np.where(b > 0.0, rest, pole)
        ends[turning] = np.where(over, np.where(b > 0.0, 0.0, np.inf), np.nan)
    return ends


def fading(t: F8, start: float, gamma: float, beta: float) -> tuple[F8, F8]:
    """Return amplitudes (n,) and their derivatives by A0, gamma and beta (3, n) of a motion without friction.

    .. math:: A = \\frac{A_0 e^{-\\gamma t}}{1 + \\beta A_0 R},\\quad R = (1 - e^{-\\gamma t})/\\gamma

    A quarter of the work of the closed form with friction. True where the denominator has no zero; for coefficients
    that are not negative it has none.
    """
    turn = gamma * t
    fall = np.exp(-turn)
    reach = _reach(t, turn, gamma)
    if _slight(turn):
        bend = t * t * (turn * (1.0 / 3.0 - turn * (0.125 - turn / 30.0)) - 0.5)
    else:
        bend = (t * fall - reach) / gamma
    rise = beta * start
    below = 1.0 + rise * reach
    share = fall / below
    amplitude = start * share
    by = np.empty((3, t.size))
    np.divide(share, below, out=by[0])
    np.multiply(-amplitude, t + rise * bend / below, out=by[1])
    np.multiply(-amplitude * start, reach / below, out=by[2])
    return amplitude, by


def _faded(t: F8, start: float, gamma: float, beta: float) -> F8:
    """The amplitudes of :func:`fading` alone."""
    turn = gamma * t
    fall = start * np.exp(-turn)
    return fall / (1.0 + beta * start * _reach(t, turn, gamma)) if beta else fall


def _reach(t: F8, turn: F8, gamma: float) -> F8:
    """R, which is t where there is no linear drag."""
    if _slight(turn):
        return np.asarray(t * (1.0 - turn * (0.5 - turn * (1.0 / 6.0 - turn / 24.0))))
    return np.asarray(np.expm1(-turn) / -gamma)


def _slight(turn: F8) -> bool:
    """Whether the next terms of the series in gamma t are below 1e-14."""
    return float(np.abs(turn).max(initial=0.0)) < 1e-3


def _constant(t: F8, start: float) -> tuple[F8, F8]:
    return np.full(t.size, start), np.ones((1, t.size))


def _exponential(t: F8, start: float, gamma: float) -> tuple[F8, F8]:
    by = np.empty((2, t.size))
    fall = np.exp(-gamma * t, out=by[0])
    amplitude = start * fall
    np.multiply(amplitude, -t, out=by[1])
    return amplitude, by


def _hyperbola(t: F8, start: float, beta: float) -> tuple[F8, F8]:
    by = np.empty((2, t.size))
    share = 1.0 / (1.0 + (beta * start) * t)
    amplitude = start * share
    np.multiply(share, share, out=by[0])
    np.multiply(amplitude * amplitude, -t, out=by[1])
    return amplitude, by


FADING: dict[tuple[str, ...], Callable[..., tuple[F8, F8]]] = {
    ("A0",): _constant,
    ("A0", "gamma"): _exponential,
    ("A0", "beta"): _hyperbola,
    ("A0", "gamma", "beta"): fading,
}
"""Of each law without friction: amplitudes (n,) and derivatives (p, n) from times (n,) and the p parameters.

What :func:`fading` becomes where a coefficient is zero, without the work that then comes to nothing.
"""


def amplitudes(t: F8, theta: F8) -> F8:
    """Return the amplitudes of several laws at once.

    Parameters
    ----------
    t : (n,) float64, s
    theta : (k, 4) float64
        A0, mu, gamma, beta of each law, zero where a law has none.

    Returns
    -------
    (k, n) float64, m
        Zero after friction has stopped the motion; infinite beyond the pole of an amplitude that grows.
    """
    return _amplitudes(_flow(t, theta))


def _amplitudes(flow: _Flow) -> F8:
    if flow.ends is None:
        return flow.numerator / flow.denominator
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values = flow.numerator / flow.denominator
    return np.where(np.isnan(flow.ends), values, flow.ends)


def jacobians_of(t: F8, theta: F8) -> tuple[F8, F8]:
    """Return :func:`amplitudes` and their derivatives (k, 4, n) by A0, mu, gamma and beta, which share much work."""
    flow = _flow(t, theta)
    start, mu, gamma, beta = theta.T[:, :, None]
    # Everything below carries the factor e^(-2st) that D^-2 brings along.
    elapsed = flow.fall * t
    both = flow.sinh * flow.cosh
    squares = _integral_of_squares(flow, both, elapsed)
    cosines = elapsed + flow.square * squares
    mixed = 0.5 * flow.sinh * flow.sinh
    pull, push = mu + 0.5 * gamma * start, beta * start + 0.5 * gamma
    jacobian = np.empty((theta.shape[0], 4, t.size))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        over = -1.0 / (flow.denominator * flow.denominator)
        jacobian[:, 0] = -over * flow.fall
        jacobian[:, 1] = over * (cosines + push * (2.0 * mixed + push * squares))
        jacobian[:, 2] = over * (start * cosines + (start * push - pull) * mixed - pull * push * squares)
        jacobian[:, 3] = over * (start * start * cosines - pull * (2.0 * start * mixed - pull * squares))
    if flow.ends is not None:
        # After the stop nothing depends on anything; beyond a pole there is nothing to depend.
        jacobian = np.where(np.isnan(flow.ends)[:, None, :], jacobian, flow.ends[:, None, :])
    return _amplitudes(flow), jacobian


def _integral_of_squares(flow: _Flow, both: F8, elapsed: F8) -> F8:
    """e^(-2st) times the integral of S^2 from 0 to t."""
    z = flow.square * flow.time**2
    small = np.abs(z) < 0.05
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        closed = (both - elapsed) / (2.0 * flow.square)
    series = 1.0 / 3.0 + z * (1.0 / 15.0 + z * (2.0 / 315.0 + z * (1.0 / 2835.0 + z * 2.0 / 155925.0)))
    return np.asarray(np.where(small, elapsed * flow.time**2 * series, closed))


def guesses(t: F8, amplitude: F8, laws: Sequence[Drag]) -> F8:
    """Return start values of several laws from one set of sums.

    Parameters
    ----------
    t, amplitude : (n,) float64
        At least one point, in the order of time.
    laws : sequence of Drag

    Returns
    -------
    (k, 4) float64

    Notes
    -----
    The equation integrated once, :math:`A = A_0 - \\mu t - \\gamma\\int A - \\beta\\int A^2`, is linear in all
    parameters; integrals of noisy points are far less noisy than their differences.
    """
    found = np.zeros((len(laws), 4))
    found[:, 0] = max(float(amplitude.mean()), FLOOR * float(amplitude.max()))
    if amplitude.size < 2 or not t[-1] > t[0]:
        return found
    level = float(amplitude.max())
    y, span = amplitude / level, float(t[-1])
    step = np.diff(t) / span
    columns = np.empty((4, t.size))
    columns[0], columns[1] = 1.0, -t / span
    for row, power in ((2, y), (3, y * y)):
        # Up to the first point the fall is taken as flat; it is a part of a period.
        columns[row, 0] = -power[0] * t[0] / span
        columns[row, 1:] = columns[row, 0] - np.cumsum(0.5 * (power[1:] + power[:-1]) * step)
    units = np.array([level, level / span, 1.0 / span, 1.0 / (level * span)])
    absent = np.ones((len(laws), 4), np.bool_)
    for row, law in enumerate(laws):
        absent[row, list(law.slots)] = False
    gram = np.where(absent[:, :, None] | absent[:, None, :], 0.0, columns @ columns.T)
    diagonal = np.arange(4)
    gram[:, diagonal, diagonal] = np.where(absent, 1.0, gram[:, diagonal, diagonal] * (1.0 + 1e-12))
    right = np.where(absent, 0.0, columns @ y)
    values = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
    usable = np.isfinite(values).all(axis=1) & (values[:, 0] > 0.0)
    found[usable] = values[usable] * units
    return found


DRAGS: tuple[Drag, ...] = (
    Drag("none", "no damping at all", ("A0",)),
    Drag("linear", "a lone exponential (linear drag)", ("A0", "gamma")),
    Drag("quadratic", "a lone hyperbola (quadratic drag)", ("A0", "beta")),
    Drag("friction", "a straight fall (dry friction)", ("A0", "mu")),
    Drag("linear+quadratic", "linear and quadratic drag together", ("A0", "gamma", "beta")),
    Drag("linear+friction", "linear drag and dry friction together", ("A0", "gamma", "mu")),
    Drag("quadratic+friction", "quadratic drag and dry friction together", ("A0", "beta", "mu")),
    Drag(
        "linear+quadratic+friction",
        "linear and quadratic drag and dry friction together",
        ("A0", "gamma", "beta", "mu"),
    ),
)
