"""Rounding: what steps of the distances larger than their noise do to the amplitudes and rest positions of windows.

Rounding to steps q changes the mean reading at :math:`x` with noise :math:`\\sigma` by
:math:`\\sum_n (-1)^n\\frac{q}{\\pi n}\\sin(2\\pi nx/q)\\,e^{-2(\\pi n\\sigma/q)^2}` (B. Widrow, I. Kollar,
"Quantization Noise", 2008). For :math:`x = c + a\\cos\\varphi` a share :math:`J_0(2\\pi na/q)\\sin(2\\pi nc/q)` of each
sine goes into the rest position, and :math:`2J_1(2\\pi na/q)\\cos(2\\pi nc/q)` into the amplitude. No noise averages
this out, since it is the same in every period.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.track import F8
from pipeline.windows.demodulate import Windows


def rounding_errors(amplitude: F8, quantum: float | None, noise: float) -> NDArray[np.complex128]:
    """Return the errors (n,) of the rest position at amplitudes (n,); those of the amplitude are twice as large.

    The Bessel functions are taken as :math:`\\sqrt{2/\\pi z}\\cos(z - \\ldots)`, which holds from about one radian on.
    Its phase and that of the rest position between two steps are unknown, because the amplitude and the rest position
    have these errors. So a quarter of the squared magnitude is the variance; the phase of the complex errors tells how
    they change together while the motion decays. The n-th sine has :math:`n^{-3}` of the variance of the first, all
    together :math:`\\zeta(3) = 1.1^2` of it.
    """
    if not quantum:
        return np.zeros(amplitude.size, complex)
    noise = math.sqrt(max(noise**2 - quantum**2 / 12.0, 0.0))  # without that of rounding itself
    turns = 2.0 * math.pi / quantum
    z = np.maximum(turns * np.abs(amplitude), 1.0)
    size = 1.1 * 2.0 / turns * math.exp(-0.5 * (turns * noise) ** 2)
    return np.asarray(size * np.sqrt(2.0 / (math.pi * z)) * np.exp(1j * z))


def rounded(windows: Windows, quantum: float | None) -> Windows:
    """Return windows whose uncertainties include the rounding, so that it decides neither a law nor a drift."""
    errors = rounding_errors(windows.amplitude, quantum, windows.noise)
    variance = 0.25 * np.abs(errors) ** 2
    covariance = windows.covariance.copy()
    covariance[:, 0, 0] += 4.0 * variance
    covariance[:, 2, 2] += variance
    return replace(windows, covariance=covariance)
