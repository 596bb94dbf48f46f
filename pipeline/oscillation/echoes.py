"""Echoes: clusters of false echoes, where in the motion they lie, and what they would have done to the amplitude."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, UNUSABLE, Quality

__all__ = ["Clusters", "find_clusters"]

LEAST = 3  # false echoes that make a cluster
BRIDGED = 2  # good samples between two false echoes of one cluster, at most
TURNING = math.pi / 4.0  # phase from a turning point within which half the period's time, but a fourth of its way, lies


@dataclass(frozen=True, slots=True)
class Clusters:
    """False echoes that come together.

    Parameters
    ----------
    count : int
    samples : int
        False echoes in them.
    turning : int
        Clusters whose middle lies within an eighth of a period of a turning point; by chance it is half of them.
    shift_m : float
        By how much the mean amplitude would come out larger, were all false echoes left in, m.
    """

    count: int
    samples: int
    turning: int
    shift_m: float


def find_clusters(demodulated: Demodulated, phase: Callable[[NDArray[np.int64]], F8]) -> Clusters:
    """Count clusters of false echoes.

    Parameters
    ----------
    demodulated : Demodulated
        For its flags, and for how far off flagged samples lie.
    phase : callable
        Gives the phase of the oscillation at some rows (k,) int64 of the record, (k,) float64, rad.

    Notes
    -----
    The shift is what least squares would make of the false echoes' residuals r, in first order:
    :math:`2\\sum r_i\\cos\\varphi_i/N`, the sum over false echoes and N all samples fitted.
    """
    echo = (demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0
    rows = np.flatnonzero(echo)
    if not rows.size:
        return Clusters(0, 0, 0, 0.0)
    angle = phase(rows)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(rows) > BRIDGED + 1) + 1])
    sizes = np.diff(np.concatenate([starts, [rows.size]]))
    clusters = sizes >= LEAST
    middles = angle[(starts + sizes // 2)[clusters]]
    turning = np.abs(middles - math.pi * np.round(middles / math.pi)) <= TURNING
    fitted = np.count_nonzero((demodulated.flags & UNUSABLE) == 0) + rows.size
    residual = demodulated.residual[rows]
    residual[~np.isfinite(residual)] = 0.0
    shift = 2.0 * float(residual @ np.cos(angle)) / fitted
    return Clusters(int(np.count_nonzero(clusters)), int(sizes[clusters].sum()), int(np.count_nonzero(turning)), shift)
