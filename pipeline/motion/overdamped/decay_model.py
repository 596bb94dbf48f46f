"""The free motion of a linearly damped bob at any strength of damping, as functions that a least-squares fit takes."""

from __future__ import annotations

import numpy as np

from pipeline.track import F8

__all__ = ["Decay", "Exponentials", "basis"]

OFFSET, START, VELOCITY, RATE, STIFFNESS = range(5)


class Decay:
    """Solutions of :math:`\\ddot x + 2g\\dot x + w x = 0` about a rest position o, from x = a at speed v.

    Parameters are (o, a, v, ln g, ln w), so that g and w stay positive and the valley that strong damping makes, where
    only w/2g is known, is straight. With :math:`q = s^2 = g^2 - w` the motion is
    :math:`e^{-gt}(a\\cosh st + (v + ga)\\sinh(st)/s)`: it oscillates for q < 0, is critically damped for q = 0 and
    has the two rates :math:`g \\mp \\sqrt q` for q > 0.

    Parameters
    ----------
    t : (n,) float64, s
    critical : bool
        Whether w is g^2; parameters are then the first four.
    """

    def __init__(self, t: F8, *, critical: bool = False) -> None:
        self.t, self.critical = t, critical

    def evaluate(self, theta: F8) -> tuple[F8, F8]:
        """Return values (n,) and derivatives (n, p)."""
        t = self.t
        offset, a, v = theta[:3].tolist()
        with np.errstate(over="ignore"):
            rate = float(np.exp(theta[RATE]))
            stiffness = rate * rate if self.critical else float(np.exp(theta[STIFFNESS]))
        square = rate * rate - stiffness
        cosine, sine = (row[0] for row in basis(t, np.array([[rate]]), np.array([[square]])))
        b = v + rate * a
        swing = a * cosine + b * sine
        by_rate = a * sine - t * swing
        jacobian = np.empty((theta.size, t.size))
        jacobian[OFFSET] = 1.0
        jacobian[START], jacobian[VELOCITY] = cosine + rate * sine, sine
        if self.critical:
            jacobian[RATE] = rate * by_rate
            return offset + swing, jacobian.T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            closed = (t * cosine - sine) / (2.0 * square) if square else sine
            # What the closed form tends to: e^(-gt) (t^3/6 + q t^5/60).
            near = np.abs(square) * t * t < 1e-4
            sine_slope = np.where(near, sine * t * t * (1.0 / 6.0 - square * t * t * (1.0 / 90.0)), closed)
            by_square = 0.5 * a * t * sine + b * sine_slope
            # At constant q the rate would do this; otherwise q changes with it.
            jacobian[RATE] = rate * (by_rate + 2.0 * rate * by_square)
            jacobian[STIFFNESS] = -stiffness * by_square
        return offset + swing, jacobian.T


class Exponentials:
    """:math:`y = o + \\sum_i p_i e^{-r_i t}`; parameters are (o, p1, ln r1, p2, ln r2, ...).

    Two rates far apart are found in this form, in which what the record knows well stands alone.

    Parameters
    ----------
    t : (n,) float64, s
    """

    def __init__(self, t: F8) -> None:
        self.t = t

    def evaluate(self, theta: F8) -> tuple[F8, F8]:
        """Return values (n,) and derivatives (n, p)."""
        jacobian = np.ones((theta.size, self.t.size))
        value = np.full(self.t.size, theta[0])
        with np.errstate(over="ignore", invalid="ignore"):
            for k in range(1, theta.size, 2):
                part, rate = theta[k], np.exp(theta[k + 1])
                fall = np.exp(-rate * self.t)
                jacobian[k], jacobian[k + 1] = fall, -part * rate * self.t * fall
                value += part * fall
        return value, jacobian.T


def basis(t: F8, rate: F8, square: F8) -> tuple[F8, F8]:
    """Return :math:`e^{-gt}\\cosh st` and :math:`e^{-gt}\\sinh(st)/s`, (k, n); rate and square are (k, 1).

    Notes
    -----
    For positive squares both are sums of two falling exponentials, so that nothing overflows; for negative ones cosine
    and sine stand in; the sine's limit for small arguments is :math:`t e^{-gt}`.
    """
    root = np.sqrt(np.abs(square))
    over = square > 0.0
    real = np.where(over, root, 0.0)
    angle = root * t
    with np.errstate(over="ignore"):
        slow, fast = np.exp(-(rate - real) * t), np.exp(-(rate + real) * t)
        fall = np.exp(-rate * t)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        cosine = np.where(over, 0.5 * (slow + fast), fall * np.cos(angle))
        sine = np.where(over, 0.5 * (slow - fast), fall * np.sin(angle)) / root
    small = angle < 1e-4
    return cosine, np.where(small, fall * t * (1.0 + square * t * t / 6.0), sine)
