"""Echoes: how many samples carry which flag, and where the false echoes lie."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.motion.phase import PhaseFit
from pipeline.track import U8, UNUSABLE, Quality, Track
from pipeline.windows.demodulate import Demodulated

__all__ = ["Clusters", "count_quality", "echoes_by_chance", "find_clusters"]

LEAST = 3  # false echoes that make a cluster
BRIDGED = 2  # good samples between two false echoes of one cluster, at most
CHANCE = 1e-3  # of a note on a record whose noise is normal
SPREAD = 1.2  # of a window's noise over the record's: of twelve samples one in a hundred windows has more
TURNING = math.pi / 4.0  # phase from a turning point within which half the period's time, but a fourth of its way, lies

COUNTED = {
    str(quality.name).lower(): int(quality)
    for quality in Quality
    if quality not in (Quality.GAP_BEFORE, Quality.MALFORMED)
}


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


def count_quality(flags: U8) -> dict[str, int]:
    """Return how many samples carry each flag, and how many were used.

    Examples
    --------
    >>> count_quality(np.array([0, 1, 2, 2], np.uint8))["false_echo"]
    2
    """
    counts = np.bincount(flags) if flags.any() else np.array([flags.size])
    held = [(value, count) for value, count in enumerate(counts.tolist()) if count]
    found = {name: sum(count for value, count in held if value & bit) for name, bit in COUNTED.items()}
    return {**found, "used": sum(count for value, count in held if not value & int(UNUSABLE))}


def echoes_by_chance(before: U8, demodulated: Demodulated, clip_sigmas: float) -> bool:
    """Return whether the false echoes are no more, and no farther off, than normal noise leaves beyond the clip.

    Parameters
    ----------
    before : (n,) uint8
        The flags before windows were fitted: false echoes among them are far off.
    demodulated : Demodulated
    clip_sigmas : float
        At which windows clip.

    Notes
    -----
    Of n samples of normal noise :math:`n\\alpha`, :math:`\\alpha = 2\\Phi(-c)`, lie beyond c standard deviations, with
    Poisson's distribution, and none beyond the quantile of :math:`10^{-3}/2n`. A window knows its own spread to a tenth
    only, so that as many as twice these are clipped.
    """
    from scipy.special import ndtr, ndtri, pdtrc

    echo = np.uint8(Quality.FALSE_ECHO)
    if np.any(before & echo):
        return False
    rows = np.flatnonzero(demodulated.flags & echo)
    n = int(np.count_nonzero((demodulated.flags & UNUSABLE) == 0)) + rows.size
    farthest = float(np.max(np.abs(demodulated.residual[rows]), initial=0.0))
    expected = 2.0 * n * 2.0 * float(ndtr(-clip_sigmas))
    return bool(
        farthest < -float(ndtri(0.5 * CHANCE / n)) * demodulated.noise_m * SPREAD
        and pdtrc(rows.size - 1, expected) > CHANCE
    )


def find_clusters(track: Track, demodulated: Demodulated, phase: PhaseFit) -> Clusters:
    """Count clusters of false echoes.

    Parameters
    ----------
    track : Track
    demodulated : Demodulated
        For its flags, and for how far off flagged samples lie.
    phase : PhaseFit

    Notes
    -----
    The shift is what least squares would make of the false echoes' residuals r, in first order:
    :math:`2\\sum r_i\\cos\\varphi_i/N`, the sum over false echoes and N all samples fitted.
    """
    rows = np.flatnonzero((demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0)
    if not rows.size:
        return Clusters(0, 0, 0, 0.0)
    angle = phase.total(track.t[rows])
    starts = np.concatenate([[0], np.flatnonzero(np.diff(rows) > BRIDGED + 1) + 1])
    sizes = np.diff(np.concatenate([starts, [rows.size]]))
    clusters = sizes >= LEAST
    middles = angle[(starts + sizes // 2)[clusters]]
    turning = np.abs(middles - math.pi * np.round(middles / math.pi)) <= TURNING
    fitted = int(np.count_nonzero((demodulated.flags & UNUSABLE) == 0)) + rows.size
    residual = demodulated.residual[rows]
    residual[~np.isfinite(residual)] = 0.0
    shift = 2.0 * float(residual @ np.cos(angle)) / fitted
    return Clusters(int(np.count_nonzero(clusters)), int(sizes[clusters].sum()), int(np.count_nonzero(turning)), shift)
