"""The flow of the linear oscillator in forms that hold from no damping through critical to any."""

from __future__ import annotations

import math

import numpy as np

from pipeline.dynamics.equation import Real
from pipeline.track import F8

__all__ = ["Entries", "flow", "flows", "underdamped"]

Entries = tuple[float, float, float, float]
"""The matrix (a, b; c, d) that takes displacement and velocity through a time."""


def flow(omega: float, gamma: float, t: float) -> Entries:
    """Return the matrix of :math:`\\ddot y = -\\omega^2 y - 2\\gamma\\dot y` over a time, s.

    Notes
    -----
    :math:`e^{-\\gamma t}(C + \\gamma S,\\ S;\\ -\\omega^2 S,\\ C - \\gamma S)` with
    :math:`S = \\sin(\\omega_d t)/\\omega_d` below critical damping. Above it,
    :math:`\\kappa = \\sqrt{(\\gamma-\\omega)(\\gamma+\\omega)}`, the fast rate :math:`\\gamma + \\kappa` and the slow
    rate :math:`\\omega^2/(\\gamma+\\kappa)`: no difference of near numbers, no product of a huge and a tiny one.

    Examples
    --------
    >>> flow(2.0, 2.0, 0.5)[1] == 0.5 * math.exp(-1.0)
    True
    """
    if gamma < omega:
        damped = math.sqrt((omega - gamma) * (omega + gamma))
        shrink = math.exp(-gamma * t)
        cosine, b = shrink * math.cos(damped * t), shrink * math.sin(damped * t) / damped
        return cosine + gamma * b, b, -omega * omega * b, cosine - gamma * b
    kappa = math.sqrt((gamma - omega) * (gamma + omega))
    fast = gamma + kappa
    slow = omega * (omega / fast)
    late, soon = math.exp(-slow * t), math.exp(-fast * t)
    b = late * (t if kappa == 0.0 else -math.expm1(-2.0 * kappa * t) / (2.0 * kappa))
    middle = 0.5 * (late + soon)
    d = (fast * soon - slow * late) / (2.0 * kappa) if kappa > 0.5 * gamma else middle - gamma * b
    return middle + gamma * b, b, -omega * omega * b, d


def flows(omega: Real, gamma: Real, t: Real) -> tuple[F8, F8, F8, F8]:
    """Return the entries of :func:`flow` for arrays that broadcast."""
    if type(omega) is float and type(gamma) is float:
        apart = math.sqrt(abs((gamma - omega) * (gamma + omega)))
        return (underdamped if gamma < omega else _overdamped)(omega, gamma, apart, np.asarray(t))
    omega, gamma, t = (np.asarray(x, np.float64) for x in (omega, gamma, t))
    under = gamma < omega
    between = np.sqrt(np.abs((gamma - omega) * (gamma + omega)))
    if under.all():
        return underdamped(omega, gamma, between, t)
    if not under.any():
        return _overdamped(omega, gamma, between, t)
    # Each branch sees only values that it can hold.
    below = underdamped(omega, np.where(under, gamma, 0.0), np.where(under, between, omega), t)
    above = _overdamped(omega, np.where(under, omega, gamma), np.where(under, 0.0, between), t)
    a, b, c, d = (np.where(under, one, other) for one, other in zip(below, above, strict=True))
    return a, b, c, d


def underdamped(omega: Real, gamma: Real, damped: Real, t: F8) -> tuple[F8, F8, F8, F8]:
    """Return the entries of :func:`flows` below critical damping; ``damped`` is the root of omega^2 - gamma^2, 1/s."""
    shrink = np.exp(-gamma * t)
    cosine, b = shrink * np.cos(damped * t), shrink * np.sin(damped * t) / damped
    return cosine + gamma * b, b, -omega * omega * b, cosine - gamma * b


def _overdamped(omega: Real, gamma: Real, kappa: Real, t: F8) -> tuple[F8, F8, F8, F8]:
    fast = gamma + kappa
    slow = omega * (omega / fast)
    late, soon = np.exp(-slow * t), np.exp(-fast * t)
    safe = np.where(kappa > 0, kappa, 1.0)
    b = late * np.where(kappa > 0, -np.expm1(-2.0 * kappa * t) / (2.0 * safe), t)
    middle = 0.5 * (late + soon)
    apart = kappa > 0.5 * gamma
    d = np.where(apart, (fast * soon - slow * late) / (2.0 * safe), middle - gamma * b)
    return middle + gamma * b, b, -omega * omega * b, d
