"""Laws of damping: how the amplitude of a free oscillation falls with time.

Each law solves :math:`dA/dt = -(\\gamma A + \\beta A^2)` with some of its coefficients zero (friction's constant term
joins with its own laws). The closed forms and their derivatives are written so that no coefficient has to differ from
zero. A law is one small class and one line in :data:`LAWS`; ``tests/conformance/test_laws.py`` holds each to its
differential equation, to its Jacobian and to its guess.

References
----------
.. [1] K. Lelas, R. Pezer, "On the amplitude decay of damped oscillators", arXiv:2502.07458.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pipeline.track import F8

__all__ = ["LAWS", "Law"]


class Law(Protocol):
    """A damping law.

    ``words`` name it in a sentence; ``theta`` lists its parameters in the order of ``parameters``, the amplitude at
    t = 0 first.
    """

    name: str
    words: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return (n,) float64, m, at times t (n,) in s."""
        ...

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return (n, p) float64: derivatives of the amplitude by each parameter."""
        ...

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return -dA/dt, (n,) float64, m/s, at amplitudes (n,) in m."""
        ...

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return start values (p,) from points."""
        ...


def decayed_time(t: F8, gamma: float) -> F8:
    """Return :math:`(1 - e^{-\\gamma t})/\\gamma`, which is t where gamma is 0.

    Examples
    --------
    >>> decayed_time(np.array([2.0]), 0.0)
    array([2.])
    """
    return np.asarray(t if gamma == 0.0 else -np.expm1(-gamma * t) / gamma)


def _decayed_time_slope(t: F8, gamma: float) -> F8:
    """Derivative of :func:`decayed_time` by gamma; a series where the closed form would cancel."""
    x = gamma * t
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, x)
    closed = (safe * np.exp(-safe) + np.expm1(-safe)) / safe**2
    return np.asarray(t**2 * np.where(small, -0.5 + x / 3.0 - x**2 / 8.0, closed))


class Constant:
    """No damping that the record could show: :math:`A = A_0`."""

    name = "none"
    words = "no damping at all"
    parameters: tuple[str, ...] = ("A0",)
    units: tuple[str, ...] = ("m",)

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return A0 at every time."""
        return np.full(t.size, theta[0])

    def jacobian(self, t: F8, theta: F8) -> F8:  # noqa: ARG002 - every law has the same signature
        """Return ones."""
        return np.ones((t.size, 1))

    def rate(self, amplitude: F8, theta: F8) -> F8:  # noqa: ARG002
        """Return zero."""
        return np.zeros_like(amplitude)

    def guess(self, t: F8, amplitude: F8) -> F8:  # noqa: ARG002
        """Return the median."""
        return np.array([np.median(amplitude)])


class Linear:
    """Viscous drag: :math:`A = A_0 e^{-\\gamma t}`."""

    name = "linear"
    words = "a lone exponential (linear drag)"
    parameters: tuple[str, ...] = ("A0", "gamma")
    units: tuple[str, ...] = ("m", "1/s")

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return the exponential."""
        return np.asarray(theta[0] * np.exp(-theta[1] * t))

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return the derivatives by A0 and gamma."""
        decay = np.exp(-theta[1] * t)
        return np.stack([decay, -theta[0] * t * decay], axis=1)

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return gamma A."""
        return np.asarray(theta[1] * amplitude)

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return a straight line's through the logarithms."""
        slope, level = _line(t, np.log(np.maximum(amplitude, 1e-3 * np.max(amplitude))))
        return np.array([np.exp(level), -slope])


class Quadratic:
    """Drag that goes as speed squared: :math:`A = A_0 / (1 + \\beta A_0 t)`."""

    name = "quadratic"
    words = "a lone hyperbola (quadratic drag)"
    parameters: tuple[str, ...] = ("A0", "beta")
    units: tuple[str, ...] = ("m", "1/(m s)")

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return the hyperbola."""
        return np.asarray(theta[0] / (1.0 + theta[1] * theta[0] * t))

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return the derivatives by A0 and beta."""
        below = 1.0 + theta[1] * theta[0] * t
        return np.stack([1.0 / below**2, -((theta[0] / below) ** 2) * t], axis=1)

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return beta A^2."""
        return np.asarray(theta[1] * amplitude**2)

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return a straight line's through the reciprocals."""
        slope, level = _line(t, 1.0 / np.maximum(amplitude, 1e-3 * np.max(amplitude)))
        start = 1.0 / level if level > 0 else float(np.max(amplitude))
        return np.array([start, slope])


class LinearQuadratic:
    """Both: :math:`A = A_0 e^{-\\gamma t} / (1 + \\beta A_0 (1 - e^{-\\gamma t})/\\gamma)`."""

    name = "linear+quadratic"
    words = "linear and quadratic drag together"
    parameters: tuple[str, ...] = ("A0", "gamma", "beta")
    units: tuple[str, ...] = ("m", "1/s", "1/(m s)")

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return the closed form."""
        start, gamma, beta = theta
        return np.asarray(start * np.exp(-gamma * t) / (1.0 + beta * start * decayed_time(t, gamma)))

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return the derivatives by A0, gamma and beta."""
        start, gamma, beta = theta
        reach = decayed_time(t, gamma)
        below = 1.0 + beta * start * reach
        amplitude = start * np.exp(-gamma * t) / below
        by_gamma = -amplitude * (t + beta * start * _decayed_time_slope(t, gamma) / below)
        return np.stack([amplitude / (start * below), by_gamma, -amplitude * start * reach / below], axis=1)

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return gamma A + beta A^2."""
        return np.asarray(theta[1] * amplitude + theta[2] * amplitude**2)

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return half of either drag, from their own guesses."""
        start, gamma = Linear().guess(t, amplitude)
        _, beta = Quadratic().guess(t, amplitude)
        return np.array([start, 0.5 * gamma, 0.5 * beta])


def _line(t: F8, y: F8) -> tuple[float, float]:
    """Slope and level at t = 0 of a least-squares line; level alone for one point."""
    middle = float(t.mean())
    centred = t - middle
    power = float(centred @ centred)
    slope = float(centred @ y) / power if power > 0 else 0.0
    return slope, float(y.mean()) - slope * middle


LAWS: dict[str, Law] = {law.name: law for law in (Constant(), Linear(), Quadratic(), LinearQuadratic())}
