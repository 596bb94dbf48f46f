"""The averaged amplitude law dA/dt = -(mu + gamma A + beta A^2): its solution, and the time when friction ends it."""

from __future__ import annotations

import math

import numpy as np

from pipeline.damping.laws.drag import amplitudes
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["amplitude", "stopping_time"]


def amplitude(start: float, gamma: float, beta: float, mu: float, t: F8) -> F8:
    """Return the solution A(t) of dA/dt = -(mu + gamma A + beta A^2), which is 0 after the motion has stopped.

    Parameters
    ----------
    start : float, m
        Amplitude at t = 0.
    gamma, beta, mu : float
        Coefficients in 1/s, 1/(m s) and m/s.
    t : (n,) float64, s

    Returns
    -------
    (n,) float64, m
        Amplitudes from the closed form of :mod:`pipeline.damping.laws.drag`.

    Raises
    ------
    DynamicsError
        If products of the coefficients overflow.

    Examples
    --------
    >>> amplitude(0.05, 0.0, 0.0, 0.01, np.array([0.0, 2.0, 6.0]))
    array([0.05, 0.03, 0.  ])
    """
    with np.errstate(all="ignore"):
        found = amplitudes(np.asarray(t, np.float64), np.array([[start, mu, gamma, beta]], np.float64))[0]
    if np.any(np.isnan(found)):
        raise DynamicsError("the amplitude's coefficients leave the range of numbers; take smaller ones")
    return np.asarray(found)


def stopping_time(start: float, gamma: float, beta: float, mu: float) -> float:
    """Return the time at which the amplitude reaches 0 in s; inf if it never does, as without friction.

    Notes
    -----
    The numerator of the closed form is 0 where :math:`\\tanh(\\kappa t)/\\kappa = A_0/(\\mu + \\gamma A_0/2)` with
    :math:`\\kappa^2 = \\gamma^2/4 - \\beta\\mu`. If :math:`\\kappa^2` is negative, tan replaces tanh.

    Examples
    --------
    >>> stopping_time(0.05, 0.0, 0.0, 0.01)
    5.0
    """
    pull = mu + 0.5 * gamma * start
    # A negative decay rate, as of a method that adds energy, can exceed friction; then the motion never stops.
    if not (mu > 0.0 and pull > 0.0 and mu + (gamma + beta * start) * start > 0.0):
        return math.inf
    square = 0.25 * gamma * gamma - mu * beta
    kappa, time = math.sqrt(abs(square)), start / pull
    if square > 0.0:  # kappa < gamma / 2 keeps the argument below 1
        time = math.atanh(min(kappa * time, 1.0 - 1e-16)) / kappa
    elif square < 0.0:
        time = math.atan(kappa * time) / kappa
    return math.inf if math.isnan(time) or math.isnan(square) else time
