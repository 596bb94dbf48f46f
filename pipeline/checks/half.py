"""Half: whether the line that was analysed has twice the frequency of the motion."""

from __future__ import annotations

import math

import numpy as np

from pipeline.checks.residual import Outcome, Residual
from pipeline.checks.shape import HIGHEST, harmonics
from pipeline.numerics.levels import IMPROBABLE, NEGLIGIBLE, SIGNIFICANT
from pipeline.track import C16, F8

# Harmonics of the motion that make pulses, with the line at twice its frequency; by chance each has the probability of
# :data:`IMPROBABLE`.
PULSES = 3
# How far the mean moves over the amplitude of the line at twice the frequency, and the harmonic of that line over
# it, which follow from three formulas. A radial acceleration is g (1 + A^2/4 - 3/4 A^2 cos 2 phi), a height
# l A^2/4 (1 + cos 2 phi), the magnitude of a sine
# 2/pi + 4/(3 pi) cos 2 phi - 4/(15 pi) cos 4 phi + ...
RADIAL, HEIGHT, MAGNITUDE, CUSPS = 1.0 / 3.0, 1.0, 1.5, -0.2


def half_frequency(residual: Residual) -> Outcome | None:
    """Test for values that go through two cycles in each cycle of the motion.

    A line at half of the main frequency, locked to its phase, is that of the motion if the mean moves as that of a
    radial acceleration or of a pendulum's height, or if further harmonics make the values pulses, as of a magnet that
    passes a sensor twice. A sideways swing at half of the frequency does neither. The magnitude of a sine has no such
    line, but cusps.
    """
    if not residual.enough or residual.turn > math.pi:  # so few samples show no harmonics
        return None
    level, moves, u_moves = _mean_by_amplitude(residual)
    values = residual.values + residual.fitted.modes.independent(residual.samples.track.t[residual.rows])
    found: dict[str, float | None] = {}
    locked = _locked(residual, values)
    if locked[1]:
        pulses = 1 + np.count_nonzero(locked[3:])
        if any(abs(abs(moves) - x) < NEGLIGIBLE * x + SIGNIFICANT * u_moves < x for x in (RADIAL, HEIGHT)):
            found["moves"] = moves
        elif pulses >= PULSES and np.linalg.norm(locked[3:]) > NEGLIGIBLE * residual.amplitude:
            found["pulses"] = float(pulses)
    elif any(abs(ratio - MAGNITUDE) < NEGLIGIBLE * MAGNITUDE for ratio in (level, moves)):
        second = complex(locked[4]) / residual.amplitude
        if abs(second - CUSPS) < 0.5 * abs(CUSPS):
            found["cusps"] = second.real
    if not found:
        return None
    motion_s = 4.0 * math.pi / residual.fitted.phase.angular_frequency.value
    return Outcome("half_frequency", {**found, "motion_s": motion_s})


def _mean_by_amplitude(residual: Residual) -> tuple[float, float, float]:
    """Return the mean over the amplitude, and by how much it moves with the amplitude, with its u."""
    windows = residual.fitted.windows
    size, offset = np.abs(windows.amplitude), windows.offset
    away = size - size.mean()
    squares = max(float(away @ away), 1e-300)
    slope = float(away @ offset) / squares
    left = offset - offset.mean() - slope * away
    u = math.sqrt(float(left @ left) / max(size.size - 2, 1) / squares)
    return float(offset.mean() / size.mean()), slope, u


def _locked(residual: Residual, values: F8) -> C16:
    """Return the mean amplitudes of the harmonics of half of the main frequency by order; 0 if one is not locked.

    As in :func:`pipeline.checks.shape.folded_shape`, the parts of the run must agree on it. A line beside half of the
    frequency turns from part to part.
    """
    orders = np.arange(1, min(HIGHEST, int(math.pi / residual.turn)) + 1)
    relative = None if residual.relative is None else np.sqrt(residual.relative)
    mean, chance = harmonics(values, 0.5 * residual.phase, residual.noise, orders, relative)
    if relative is not None:
        mean *= [np.mean(relative**order) for order in orders.tolist()]
    locked = np.zeros(HIGHEST + 1, np.complex128)
    locked[orders] = np.where(chance < IMPROBABLE, mean, 0.0)
    return locked
