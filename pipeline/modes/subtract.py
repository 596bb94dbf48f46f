"""Subtraction of the modes beside the main oscillation where they would do harm."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.modes.mode import Modes
from pipeline.modes.search import find_modes
from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.samples.condition import Samples
from pipeline.windows.demodulate import Windows, demodulate


def separate(samples: Samples, windows: Windows, *, sought: bool = True) -> tuple[Windows, Modes]:
    """Search for modes, and demodulate again without them.

    A mode of amplitude B at a distance :math:`\\Delta f` from the main frequency leaves up to
    :math:`B/(\\pi\\,\\Delta f\\,T)` in the amplitude of a record of length T. If this is less than a tenth of the
    amplitude's standard uncertainty for every mode, the modes are reported but not subtracted.
    """
    modes = find_modes(samples, windows) if sought else Modes(samples)
    leak = _leak(modes)
    if not modes.members or not leak > NEGLIGIBLE * _u_amplitude(windows):
        return windows, replace(modes, leak=leak)
    subtracted = modes.position(samples.track.t)
    windows = demodulate(samples.less(subtracted), windows.cycles)
    # Windows fitted without the modes separate false echoes from the main oscillation better.
    if (cleaner := find_modes(samples, windows, subtracted)).members:
        modes, subtracted = cleaner, cleaner.position(samples.track.t)
    windows = demodulate(samples.less(subtracted), windows.cycles)
    return windows, replace(modes, samples=samples.less(subtracted), subtracted=subtracted, leak=leak)


def _u_amplitude(windows: Windows) -> float:
    return 1.0 / math.sqrt(float(np.sum(1.0 / np.maximum(windows.covariance[:, 0, 0], 1e-300))))


def _leak(modes: Modes) -> float:
    """Return the maximum bias that any mode would cause in the amplitude of the main oscillation, m."""
    if modes.carrier is None:
        return 0.0
    carrier = modes.carrier
    main, seconds = carrier.angular_frequency / (2.0 * math.pi), float(carrier.t[-1] - carrier.t[0])
    return max(
        (mode.amplitude / (math.pi * abs(mode.frequency_hz - main) * seconds) for mode in modes.members),
        default=0.0,
    )
