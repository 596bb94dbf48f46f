"""Kinks: where amplitude or phase of a free oscillation change too little to be seen from one period to the next.

A touch of a hundredth of the velocity hides among the windows' scatter, but not in all windows before it against all
after it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.segments import Break, Segments, Span
from pipeline.track import F8

__all__ = ["Params", "find_kink"]

LINE = np.array([-0.3, -0.05, 0.2, 0.45, 0.7])  # weights that continue a line through five windows by half of one
NEAR = 6.0  # standard deviations of a window by which the jump may differ from near, four of what such lines are off
DEGREE = 4  # of the polynomials that logarithm of the amplitude and phase are smooth by


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_kink`.

    Parameters
    ----------
    gain : float
        Fall of chi-square, over what is left for each degree of freedom, from which on a jump counts.
    least : float
        The least jump, in amplitudes or radians.
    apart : int
        Fewest windows before and after it.
    scatter : float
        Chi-square for each degree of freedom below which nothing is looked for.
    """

    gain: float = 45.0
    least: float = 0.004
    apart: int = 5
    scatter: float = 1.35


def find_kink(demodulated: Demodulated, params: Params | None = None) -> Segments | None:
    """Return the longer side of a jump of amplitude and phase; None where both run smoothly.

    Parameters
    ----------
    demodulated : Demodulated
    params : Params, optional

    Notes
    -----
    Logarithm of the amplitude and phase are fitted by polynomials of degree 4 in time. A column that is 0 before a
    window and 1 from there on lowers chi-square by :math:`(h^T r)^2/(h^T h - |Q^T h|^2)`, for every window at once
    by sums from the end.
    """
    params = params or Params()
    t, size, phase = demodulated.t, demodulated.amplitude, demodulated.phase
    u_size = np.sqrt(demodulated.covariance[:, 0, 0])
    last = int(np.argmax(np.append(size <= 10.0 * u_size, True)))  # behind it the amplitude is lost
    if last < 2 * params.apart + DEGREE + 4:
        return None
    t, size, phase = t[:last], size[:last], phase[:last]
    both = np.array([np.log(size), phase - demodulated.angular_frequency * (t - t[0])])
    # Of a computed record nothing is uncertain but its digits.
    u = np.maximum([u_size[:last] / size, np.sqrt(demodulated.covariance[:last, 1, 1])], 1e-12)
    powers = np.vander(2.0 * (t - t[0]) / (t[-1] - t[0]) - 1.0, DEGREE + 1)
    free = 2 * (last - DEGREE - 1)
    q, _ = np.linalg.qr(powers)
    if float((((both - (both @ q) @ q.T) / u) ** 2).sum()) < params.scatter * free:
        return None
    parts = [_jumps(y / s, powers / s[:, None], 1.0 / s) for y, s in zip(both, u, strict=True)]
    left = sum(chi2 for chi2, _, _ in parts)
    gain = parts[0][1] + parts[1][1]
    gain[: params.apart] = gain[last - params.apart :] = 0.0
    k = int(np.argmax(gain))
    amplitude, angle = (float(heights[k]) for _, _, heights in parts)
    rest = max((left - gain[k]) / (free - 3), 1.0)
    if gain[k] < params.gain * rest or math.hypot(amplitude, angle) < params.least:
        return None
    # What goes to and fro faster than the polynomials lowers chi-square by a jump as well, but is none from near.
    off = _near(both[0], k) - amplitude, _near(both[1], k) - angle
    if math.hypot(*off) > max(0.5 * math.hypot(amplitude, angle), NEAR * float(np.hypot(*u[:, k]))):
        return None
    return _longer(demodulated, k, amplitude, angle)


def _near(y: F8, k: int) -> float:
    """The jump before window k by straight lines through the windows on either side of it."""
    before, after = LINE @ y[k - LINE.size : k], LINE[::-1] @ y[k : k + LINE.size]
    return float(after - before)


def _jumps(y: F8, design: F8, weight: F8) -> tuple[float, F8, F8]:
    """Chi-square of the smooth fit, and for a jump at each window the fall of it and the jump's height."""
    q, _ = np.linalg.qr(design)
    residual = y - q @ (q.T @ y)
    along = np.cumsum((weight * residual)[::-1])[::-1]
    shared = np.cumsum((weight[:, None] * q)[::-1], axis=0)[::-1]
    own = np.cumsum((weight**2)[::-1])[::-1] - np.sum(shared**2, axis=1)
    own = np.maximum(own, 1e-9 * float(np.sum(weight**2)))
    return float(residual @ residual), along**2 / own, along / own


def _longer(demodulated: Demodulated, k: int, amplitude: float, angle: float) -> Segments:
    """The longer side of a jump before window k, without the windows that may hold some of it."""
    t = demodulated.t
    half = 0.5 * float(np.median(np.diff(t)))
    at_s = 0.5 * float(t[k - 1] + t[k])
    kind = "phase_jump" if abs(amplitude) < abs(angle) / 3.0 else "touched"
    jump = Break(kind, at_s, half, math.expm1(amplitude), angle)
    first_s, last_s = float(t[0]) - half, float(t[-1]) + half
    if at_s - first_s >= last_s - at_s:
        return Segments(-math.inf, float(t[k - 2]) + half, (Span("free", float(t[k]) + half, last_s),), (jump,))
    return Segments(float(t[k + 1]) - half, math.inf, (Span("free", first_s, float(t[k - 1]) - half),), (jump,))
