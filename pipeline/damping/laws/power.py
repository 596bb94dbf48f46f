"""Drag by a free power of the amplitude: the alternative if the drag coefficient varies with the amplitude."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.damping.laws.drag import Drag
from pipeline.numerics.least_squares import central_differences
from pipeline.track import F8
from pipeline.units import Unit

_MIXED = Drag("guess", "", (1, 2))


class Power:
    """Drag proportional to a power of the amplitude: :math:`dA/dt = -c A^n`.

    With :math:`m = 1 - n`, the rate at the start :math:`k = c A_0^{-m}` and :math:`x = k t`, the amplitude is
    :math:`A = A_0 (1 - m x)^{1/m}`, which tends to :math:`A_0 e^{-x}` as m tends to 0. n = 0 is friction, which stops
    the motion, n = 1 linear and n = 2 quadratic drag; vortices shed by an edge give n = 5/3.
    """

    name = "power"
    words = "drag by a free power of the amplitude"
    parameters: Mapping[str, Unit] = {"A0": Unit(1), "c": Unit(1, -1, less="n"), "n": Unit()}
    cases: tuple[str, ...] = ("none", "linear", "quadratic", "friction")

    def curve(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return the closed form; 0 after the motion has stopped, infinite beyond a pole of a growing one.

        The derivatives are central differences.
        """
        amplitude = _amplitude(t, theta)
        with np.errstate(invalid="ignore"):  # infinities differ beyond a pole
            slopes = central_differences(lambda at: _amplitude(t, at), theta)
        slopes[amplitude == 0.0] = 0.0
        return amplitude, slopes

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return -c A^n, or 0 if the amplitude is not positive."""
        left = amplitude > 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.where(left, -theta[1] * np.where(left, amplitude, 1.0) ** theta[2], 0.0))

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return start values: the local power of linear and quadratic drag together at the mean amplitude."""
        level = max(float(amplitude.mean()), 1e-3 * float(amplitude.max()), 1e-300)
        start, gamma, beta = _MIXED.guess(t, amplitude).tolist()
        rate = gamma + beta * level
        if not rate > 0.0:
            return np.array([start, 0.0, 1.0])
        n = min(max((gamma + 2.0 * beta * level) / rate, 0.0), 3.0)
        return np.array([start, rate * level ** (1.0 - n), n])


def _amplitude(t: F8, theta: F8) -> F8:
    start, c, n = theta.tolist()
    with np.errstate(all="ignore"):
        # NaN where A0 is not positive: a fit may pass through such values.
        x = (c * np.float64(start) ** (n - 1.0)) * t if start > 0.0 else np.full(t.size, np.nan)
        z = (1.0 - n) * x
        exponent = np.log1p(-z) / (1.0 - n) if abs(1.0 - n) > 1e-300 else -x
        amplitude = start * np.exp(np.where(np.abs(z) < 1e-8, -x * (1.0 + 0.5 * z), exponent))
    amplitude[z >= 1.0] = 0.0 if n < 1.0 and c > 0 else np.inf
    return np.asarray(amplitude)
