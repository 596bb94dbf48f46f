"""The period of a pendulum against its amplitude, which is known if the scene states its length."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.motion.fitted import Oscillation, delay
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_CURVE, NEGLIGIBLE, ROUNDS, VERY_STRONG
from pipeline.numerics.regression import scatter, solve_weighted
from pipeline.track import F8
from pipeline.windows.demodulate import ROUNDING, Windows

# Roots of q, as in :func:`swings`, up to swings of 167 degrees; frequencies between them err by 1e-8, as measured.
ROOTS_OF_Q = np.linspace(0.0, 0.5, 5001)


def swings(power: int) -> tuple[F8, F8]:
    """Return amplitudes (k,) of what is recorded of swings, and their frequencies over that of very small ones.

    With :math:`q = e^{-\\pi K'/K}` of its elliptic functions, a swing has the frequency
    :math:`p = \\vartheta_3(q)^{-2}` and its angle the fundamental :math:`a = 8\\sqrt q/(1 + q)`. The fundamental of an
    angular velocity is :math:`p a` times the frequency of very small swings, and that of a position :math:`p^2 a` times
    the length: ``power`` is that of p (NIST Digital Library of Mathematical Functions, 20.2.3 and 22.11).
    """
    q = ROOTS_OF_Q**2
    frequency = (1.0 + 2.0 * (q + q**4 + q**9)) ** -2
    recorded = frequency**power * 8.0 * ROOTS_OF_Q / (1.0 + q)
    rising = slice(int(np.argmax(recorded)) + 1)
    return recorded[rising], frequency[rising]


def with_law_of_pendulum(motion: Oscillation, length: Estimate, unit: str) -> Oscillation:
    """Return the motion with the frequency of very small swings by the law of a pendulum of a length.

    The phase is :math:`\\varphi + \\omega_0\\int p\\,dt`, in which p is the frequency over that of very small swings.
    If a term in A^2 beside it fits much better, the difference enters u; if that term is more than a tenth of the law,
    this is no simple pendulum, and the motion is returned as it is.
    """
    windows, phase = motion.windows, motion.phase
    if motion.method == "equation" or unit not in ("m", "rad", "rad/s") or windows.t.size < FEWEST_FOR_CURVE:
        return motion
    total = windows.phase + delay(windows.t, phase.lag)
    found = _at_rest(windows, total, length.value, unit)
    if found is None:
        return motion
    u = found.u
    if unit == "m":
        longer = _at_rest(windows, total, length.value + length.u, unit)
        u = math.hypot(u, 0.0 if longer is None else longer.value - found.value)
    return replace(motion, phase=replace(phase, small_swings=Estimate(found.value, u, "rad/s"), of_pendulum=True))


def _at_rest(windows: Windows, total: F8, length_m: float, unit: str) -> Estimate | None:
    """Return the angular frequency of very small swings from the phases; None if they contradict the law."""
    from scipy.integrate import cumulative_trapezoid

    size, omega = np.abs(windows.amplitude), windows.angular_frequency
    noise = np.maximum(np.sqrt(windows.covariance[:, 1, 1]), ROUNDING)
    square = cumulative_trapezoid(size**2, windows.t, initial=0.0)
    recorded, frequency = swings(("rad", "rad/s", "m").index(unit))
    # The amplitude of an angular velocity depends on the frequency at rest.
    for _ in range(ROUNDS if unit == "rad/s" else 1):
        swing = size / {"rad": 1.0, "rad/s": omega, "m": length_m}[unit]
        relative = np.interp(swing, recorded, frequency)
        turned = cumulative_trapezoid(relative, windows.t, initial=0.0)
        columns = np.stack([np.ones(turned.size), turned - turned[turned.size // 2]], axis=1)
        spread = scatter(windows.t, solve_weighted(columns, total, noise).residual, noise)
        kept = spread.kept
        line = solve_weighted(columns[kept], total[kept], spread.u[kept])
        omega = float(line.values[1])
    if float(np.max(swing)) >= recorded[-1]:
        return None
    more = solve_weighted(np.column_stack([columns, square])[kept], total[kept], spread.u[kept])
    count = float(np.count_nonzero(kept))
    widened, apart = line.widening(spread.correlation), 0.0
    if (line.chi2 - more.chi2) / spread.correlation - math.log(count / spread.correlation) > VERY_STRONG:
        bend, law = float(more.values[2]) * float(np.max(size)) ** 2, omega * (1.0 - float(np.min(relative)))
        if abs(bend) > NEGLIGIBLE * law:
            return None
        apart = float(more.values[1]) - omega
    return Estimate(omega, math.hypot(math.sqrt(widened * float(line.covariance[1, 1])), apart), "rad/s")
