"""A free power of the amplitude: the honest alternative where the drag coefficient varies with amplitude."""

from __future__ import annotations

import numpy as np

from pipeline.track import F8

__all__ = ["Power"]


class Power:
    """Drag that goes as a power of the amplitude: :math:`dA/dt = -c A^n`.

    Notes
    -----
    With :math:`m = 1 - n`, the starting rate :math:`k = c A_0^{-m}` and :math:`x = k t`,
    :math:`A = A_0 (1 - m x)^{1/m}`, which goes over into :math:`A_0 e^{-x}`. n = 0 is friction, which stops the motion,
    1 linear and 2 quadratic drag; vortices shed by an edge give 5/3.
    """

    name = "power"
    words = "a free power of the amplitude"
    parameters: tuple[str, ...] = ("A0", "c", "n")
    units: tuple[str, ...] = ("m", "m^(1-n)/s", "")
    cases: tuple[str, ...] = ("none", "linear", "quadratic", "friction")

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return the closed form; 0 after the motion has stopped, infinite beyond a growing one's pole."""
        start = theta[0]
        m, x, rest = _parts(np.asarray(t, np.float64), theta)
        with np.errstate(over="ignore", under="ignore"):
            return np.asarray(start * np.exp(-x * _logarithm(m * x, rest)))

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return the derivatives by A0, c and n."""
        at = np.asarray(t, np.float64)
        start, c, _ = theta
        m, x, rest = _parts(at, theta)
        amplitude = self.amplitude(at, theta)
        with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
            # d ln A / dx = -1/(1 - m x); x depends on A0, c and n through c t A0^(n-1).
            fall = -amplitude / rest
            rate = np.exp(-m * np.log(start)) * at
            by_start = amplitude / start + fall * x * (-m / start)
            by_c = fall * rate
            by_n = fall * x * np.log(start) + amplitude * x * x * _logarithm_slope(m * x)
        jacobian = np.stack([by_start, by_c, by_n], axis=1)
        jacobian[rest <= 0.0] = 0.0 if m > 0 and c > 0 else np.inf
        return jacobian

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return c A^n; nothing where there is no amplitude left."""
        left = amplitude > 0.0
        with np.errstate(over="ignore"):
            return np.asarray(np.where(left, theta[1] * np.where(left, amplitude, 1.0) ** theta[2], 0.0))

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return the power whose integral follows the points best, of a few that are tried."""
        level = float(np.max(amplitude))
        if amplitude.size < 3 or not t[-1] > t[0] or not level > 0.0:
            return np.array([max(float(np.median(amplitude)), 1e-300), 0.0, 1.0])
        y = np.maximum(amplitude / level, 0.0)
        step = np.diff(t)
        best, found = np.inf, np.array([level, 0.0, 1.0])
        for n in (0.0, 0.5, 1.0, 1.5, 2.0, 3.0):
            power = y**n
            integral = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * step)]) + power[0] * t[0]
            centred = integral - integral.mean()
            c = -float(centred @ y) / float(centred @ centred) if centred @ centred > 0 else 0.0
            residual = y - y.mean() + c * centred
            if (misfit := float(residual @ residual)) < best:
                best = misfit
                start = max(float(y.mean() + c * integral.mean()), 1e-3)
                found = np.array([start * level, c * level ** (1.0 - n), n])
        return found

    def rescaled(self, theta: F8, length_m: float) -> F8:
        """Return theta with lengths divided by ``length_m``: c carries their power 1 - n."""
        start, c, n = theta
        return np.array([start / length_m, c * length_m ** (n - 1.0), n])


def _parts(t: F8, theta: F8) -> tuple[float, F8, F8]:
    """1 - n, the starting rate times t, and 1 - m x, which reaches zero at the end of the motion or at a pole."""
    start, c, n = theta
    m = 1.0 - float(n)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        x = np.asarray(c * np.exp(-m * np.log(start)) * t)
    return m, x, 1.0 - m * x


def _logarithm(z: F8, rest: F8) -> F8:
    """-ln(1 - z)/z, 1 at z = 0, and so large that exp(-x times it) is 0 or infinite where 1 - z is not positive."""
    safe = np.where((np.abs(z) > 1e-8) & (rest > 0.0), z, 0.5)
    closed = np.where(np.abs(z) > 1e-8, -np.log1p(-safe) / safe, 1.0 + 0.5 * z)
    return np.asarray(np.where(rest > 0.0, closed, np.inf))


def _logarithm_slope(z: F8) -> F8:
    """Derivative of -ln(1 - z)/z, a series where it would cancel."""
    small = np.abs(z) < 1e-2
    safe = np.where(small | (z >= 1.0), 0.5, z)
    closed = (np.log1p(-safe) + safe / (1.0 - safe)) / safe**2
    series = np.polynomial.polynomial.polyval(np.where(small, z, 0.0), [k / (k + 1.0) for k in range(1, 10)])
    return np.asarray(np.where(small, series, closed))
