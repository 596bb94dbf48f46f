"""The period of a pendulum against its amplitude, which is known if the scene states its length."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.motion.fitted import Oscillation, delay
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_CURVE, NEGLIGIBLE, ROUNDS, VERY_STRONG
from pipeline.numerics.regression import scatter, solve_weighted
from pipeline.track import F8
from pipeline.windows.demodulate import ROUNDING, Windows

# Largest angle of the table, rad, where a swing takes twice as long as a small one, and its numbers of angles and of
# points in a quarter of a swing. The frequency differs by at most 1.7e-6 from that of 2801 angles and 256 points, as
# measured.
LARGEST_ANGLE, ANGLES, QUARTER_POINTS = 2.8, 281, 64


@dataclass(frozen=True, slots=True, eq=False)
class SwingTable:
    """Amplitudes of the fundamental of what is recorded of a swing, and its frequency over that of very small ones."""

    recorded: F8  # for a position over the length, for an angular velocity over the frequency of the swing
    frequency: F8

    @classmethod
    def of(cls, unit: str) -> SwingTable:
        """Return the table for an angle and an angular velocity, or for a position.

        With :math:`k = \\sin(\\theta_0/2)` the angle is :math:`\\sin(\\theta/2) = k\\,\\mathrm{sn}(\\omega_0 t + K)`,
        its frequency :math:`\\pi\\omega_0/2K`, and the position :math:`l\\sin\\theta`. The fundamental of an angular
        velocity is that of the angle times the frequency.
        """
        from scipy.special import ellipj, ellipk

        m = np.sin(0.5 * np.linspace(0.0, LARGEST_ANGLE, ANGLES)) ** 2
        quarter = ellipk(m)
        turn = (np.arange(QUARTER_POINTS) + 0.5) / QUARTER_POINTS
        sine, _, _, _ = ellipj(quarter[:, None] * (1.0 - turn), m[:, None])
        half = np.arcsin(np.sqrt(m)[:, None] * sine)
        values = np.sin(2.0 * half) if unit == "m" else 2.0 * half
        fundamental = values @ np.cos(0.5 * math.pi * turn) * 2.0 / QUARTER_POINTS
        rising = np.append(np.diff(fundamental) > 0.0, True)
        end = int(np.argmin(rising)) if not rising.all() else ANGLES
        return cls(fundamental[:end], 0.5 * math.pi / quarter[:end])


def with_law_of_pendulum(motion: Oscillation, length: Estimate, unit: str) -> Oscillation:
    """Return the motion with the frequency of very small swings by the law of a pendulum of a length.

    The phase is :math:`\\varphi + \\omega_0\\int p\\,dt`, in which p is the frequency over that of very small swings.
    If a term in A^2 beside it fits much better, the difference enters u; if that term is more than a tenth of the law,
    this is no simple pendulum, and the motion is returned as it is.
    """
    windows, phase = motion.windows, motion.phase
    if motion.method == "equation" or unit not in ("m", "rad", "rad/s") or windows.t.size < FEWEST_FOR_CURVE:
        return motion
    table = SwingTable.of(unit)
    total = windows.phase + delay(windows.t, phase.lag)
    found = _at_rest(windows, total, table, length.value if unit == "m" else 1.0, unit)
    if found is None:
        return motion
    u = found.u
    if unit == "m":
        longer = _at_rest(windows, total, table, length.value + length.u, unit)
        u = math.hypot(u, 0.0 if longer is None else longer.value - found.value)
    return replace(motion, phase=replace(phase, small_swings=Estimate(found.value, u, "rad/s"), of_pendulum=True))


def _at_rest(windows: Windows, total: F8, table: SwingTable, length_m: float, unit: str) -> Estimate | None:
    """Return the angular frequency of very small swings from the phases; None if they contradict the law."""
    from scipy.integrate import cumulative_trapezoid

    size, omega = np.abs(windows.amplitude) / length_m, windows.angular_frequency
    noise = np.maximum(np.sqrt(windows.covariance[:, 1, 1]), ROUNDING)
    square = cumulative_trapezoid(size**2, windows.t, initial=0.0)
    # The amplitude of an angular velocity depends on the frequency at rest.
    for _ in range(ROUNDS if unit == "rad/s" else 1):
        if unit == "rad/s":
            # The recorded amplitude is that of the angle times the frequency, which falls with it.
            trial = table.recorded * table.frequency * omega
            angles = np.interp(size, trial[: int(np.argmax(trial)) + 1], table.recorded[: int(np.argmax(trial)) + 1])
        else:
            angles = size
        if float(np.max(angles)) >= table.recorded[-1]:
            return None
        relative = np.interp(angles, table.recorded, table.frequency)
        turned = cumulative_trapezoid(relative, windows.t, initial=0.0)
        columns = np.stack([np.ones(turned.size), turned - turned[turned.size // 2]], axis=1)
        spread = scatter(windows.t, solve_weighted(columns, total, noise).residual, noise)
        kept = spread.kept
        line = solve_weighted(columns[kept], total[kept], spread.u[kept])
        omega = float(line.values[1])
    more = solve_weighted(np.column_stack([columns, square])[kept], total[kept], spread.u[kept])
    count = float(np.count_nonzero(kept))
    widened, apart = line.widening(spread.correlation), 0.0
    if (line.chi2 - more.chi2) / spread.correlation - math.log(count / spread.correlation) > VERY_STRONG:
        bend, law = float(more.values[2]) * float(np.max(size)) ** 2, omega * (1.0 - float(np.min(relative)))
        if abs(bend) > NEGLIGIBLE * law:
            return None
        apart = float(more.values[1]) - omega
    return Estimate(omega, math.hypot(math.sqrt(widened * float(line.covariance[1, 1])), apart), "rad/s")
