"""The free motion of a linearly damped bob at any strength of damping, as functions that a least-squares fit takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    free : (k, 5) bool
        Which parameters each row has.
    critical : bool
        Whether w is held at g^2 in every row.
    """

    def __init__(self, t: F8, free: NDArray[np.bool_], *, critical: bool = False) -> None:
        self.t, self.free, self.critical = t, free, critical

    def evaluate(self, rows: NDArray[np.int64], theta: F8) -> tuple[F8, F8]:  # noqa: ARG002 - rows are alike
        """Return values (k, n) and derivatives (k, 5, n)."""
        t = self.t
        offset, a, v = theta.T[:3, :, None]
        with np.errstate(over="ignore"):
            rate, stiffness = np.exp(theta.T[3:, :, None])
            square = np.zeros_like(rate) if self.critical else rate * rate - stiffness
        cosine, sine = basis(t, rate, square)
        near = np.abs(square) * t * t < 1e-4
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            closed = (t * cosine - sine) / (2.0 * square)
            # What the closed form tends to: e^(-gt) (t^3/6 + q t^5/60).
            sine_slope = np.where(near, sine * t * t * (1.0 / 6.0 - square * t * t * (1.0 / 90.0)), closed)
            b = v + rate * a
            swing = a * cosine + b * sine
            by_square = 0.5 * a * t * sine + b * sine_slope
            by_rate = a * sine - t * swing
            jacobian = np.empty((theta.shape[0], 5, t.size))
            jacobian[:, OFFSET] = 1.0
            jacobian[:, START], jacobian[:, VELOCITY] = cosine + rate * sine, sine
            # At constant q; otherwise q changes with g.
            jacobian[:, RATE] = rate * (by_rate if self.critical else by_rate + 2.0 * rate * by_square)
            jacobian[:, STIFFNESS] = 0.0 if self.critical else -stiffness * by_square
        return offset + swing, jacobian


class Exponentials:
    """:math:`y = o + \\sum_i p_i e^{-r_i t}`; parameters are (o, p1, ln r1, p2, ln r2, ...).

    Two rates far apart are found in this form, in which what the record knows well stands alone.

    Parameters
    ----------
    t : (n,) float64, s
    rows : int
        Fits at once.
    count : int
        Of exponentials.
    """

    def __init__(self, t: F8, rows: int, count: int) -> None:
        self.t, self.count = t, count
        self.free = np.ones((rows, 1 + 2 * count), np.bool_)

    def evaluate(self, rows: NDArray[np.int64], theta: F8) -> tuple[F8, F8]:  # noqa: ARG002 - rows are alike
        """Return values (k, n) and derivatives (k, p, n)."""
        jacobian = np.ones((theta.shape[0], theta.shape[1], self.t.size))
        value = np.broadcast_to(theta[:, :1], (theta.shape[0], self.t.size)).copy()
        with np.errstate(over="ignore", invalid="ignore"):
            for k in range(self.count):
                part, rate = theta[:, 1 + 2 * k, None], np.exp(theta[:, 2 + 2 * k, None])
                fall = np.exp(-rate * self.t)
                jacobian[:, 1 + 2 * k], jacobian[:, 2 + 2 * k] = fall, -part * rate * self.t * fall
                value += part * fall
        return value, jacobian


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
