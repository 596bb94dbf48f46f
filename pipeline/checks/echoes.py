"""Echoes: the number of samples with each flag, and the position of the false echoes."""

from __future__ import annotations

import numpy as np

from pipeline.motion.fitted import Phase
from pipeline.numerics.levels import FALSE_ALARM, normal_quantile
from pipeline.track import U8, UNUSABLE, Quality, Track
from pipeline.windows.demodulate import CLIP_SIGMAS, Windows

# Minimum number of false echoes in a cluster, and maximum distance between neighbours. Independent echoes on one sample
# in a thousand form a cluster at a given one with a probability of 1e-5.
CLUSTER = 3
COUNTED = {
    str(quality.name).lower(): np.uint8(quality)
    for quality in Quality
    if quality not in (Quality.GAP_BEFORE, Quality.MALFORMED)
}


def count_quality(flags: U8) -> dict[str, int]:
    """Return the number of samples with each flag, and the number of samples used.

    >>> count_quality(np.array([0, 1, 2, 2], np.uint8))["false_echo"]
    2
    """
    found = {name: int(np.count_nonzero(flags & bit)) for name, bit in COUNTED.items()}
    return {**found, "used": int(np.count_nonzero((flags & UNUSABLE) == 0))}


def echoes_by_chance(before: U8, windows: Windows) -> bool:
    """Return whether normal noise explains both the number and the size of the false echoes.

    The number of n samples of normal noise beyond c standard deviations has a Poisson distribution with the mean
    :math:`n\\alpha`, :math:`\\alpha = 2\\Phi(-c)`. No sample lies beyond the quantile of :math:`10^{-3}/2n`. The noise
    of a window is known only to a tenth, so up to twice as many samples are clipped.
    """
    from scipy.special import ndtr, pdtrc

    echo = np.uint8(Quality.FALSE_ECHO)
    if np.any(before & echo):
        return False
    rows = np.flatnonzero(windows.flags & echo)
    n = int(np.count_nonzero(windows.used)) + rows.size
    farthest = float(np.max(np.abs(windows.residual[rows]), initial=0.0))
    expected = 2.0 * n * 2.0 * float(ndtr(-CLIP_SIGMAS))
    return bool(
        farthest < normal_quantile(1.0 - FALSE_ALARM / n) * windows.noise
        and pdtrc(rows.size - 1, expected) > FALSE_ALARM
    )


def find_clusters(track: Track, windows: Windows, phase: Phase) -> dict[str, float]:
    """Return the number of clusters of false echoes, of echoes in them, and of clusters nearer to a turning point.

    By chance half of them are. ``shift_m`` is the increase of the mean amplitude if all false echoes were used. Without
    clusters nothing is returned.

    The shift is the first-order change of a least-squares fit by the residuals r of the false echoes:
    :math:`2\\sum r_i\\cos\\varphi_i/N`. The sum is over the false echoes; N is the number of samples fitted, including
    them.
    """
    rows = np.flatnonzero((windows.flags & np.uint8(Quality.FALSE_ECHO)) != 0)
    starts = np.append(0, np.flatnonzero(np.diff(rows) > CLUSTER) + 1)
    sizes = np.diff(np.append(starts, rows.size))
    clusters = sizes >= CLUSTER
    if not clusters.any():
        return {}
    angle = phase.total(track.t[rows])
    middles = angle[(starts + sizes // 2)[clusters]]
    fitted = int(np.count_nonzero(windows.used)) + rows.size
    residual = windows.residual[rows]
    residual[~np.isfinite(residual)] = 0.0
    return {
        "clusters": int(np.count_nonzero(clusters)),
        "in_clusters": int(sizes[clusters].sum()),
        "turning": int(np.count_nonzero(np.cos(2.0 * middles) >= 0.0)),
        "shift_m": 2.0 * float(residual @ np.cos(angle)) / fitted,
    }
