"""Rows: records whose rows are not one after another in time, told from the distances alone."""

from __future__ import annotations

import numpy as np

from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import FOURTH_DIFFERENCE_GAIN, Conditioned
from pipeline.track import F8, Track

__all__ = ["are_interleaved", "count_lost"]

SIGMAS = 8.0  # of the noise that a step between rows must have to be told from two steps
ALIKE = 0.7  # correlation of what alternates, from row to row
LEAST = 64  # rows
LEAST_SHARE = 0.015  # of the rows
SLOW = 0.25  # of the fastest steps: below, near a turning point, a lost row is no more than noise
MOST = 5.0  # steps at once: more are no rows lost but something else


def are_interleaved(track: Track) -> bool:
    """Return whether the rows are of two records in turn.

    Notes
    -----
    What every row is off the mean of its neighbours, with the sign changed from row to row, is correlated over three
    to nine rows where two records alternate; of one record's white noise it is not.
    """
    y = track.y[np.isfinite(track.y)]
    if y.size < LEAST:
        return False
    off = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    off[::2] *= -1.0
    power = float(off @ off) / off.size
    return power > 0.0 and all(float(off[lag:] @ off[:-lag]) > ALIKE * power * (off.size - lag) for lag in (3, 5, 7, 9))


def count_lost(conditioned: Conditioned) -> int:
    """Return how many rows were lost while times were counted on; 0 where that cannot be told from noise.

    Notes
    -----
    Where a row is missing the distance makes two steps at once: twice the lesser of the middle two of the steps
    around, which is a single one unless three of the four are not. Where times jitter, or values are held, as many
    steps are too short. The noise is that near the turning points, where a lost row moves little.
    """
    track, used = conditioned.track, conditioned.used
    step: F8 = np.diff(track.y)
    sound = used[1:] & used[:-1] & (np.abs(np.diff(track.t) * track.rate_hz - 1.0) < 0.2)
    if step.size < LEAST:
        return 0
    four = np.sort([step[:-4], step[1:-3], step[3:-1], step[4:]], axis=0)
    around = np.where(four.sum(axis=0) > 0.0, four[1], four[2])
    whole = np.logical_and.reduce([sound[k : sound.size - 4 + k] for k in range(5)])
    if not whole.any():
        return 0
    size = np.abs(around)
    fast = float(np.quantile(size[whole], 0.9))
    slow = np.diff(step, 3)[:-1][whole & (size < SLOW * fast)]
    noise_m = float(mad_sigma(slow) / FOURTH_DIFFERENCE_GAIN) if slow.size >= LEAST else conditioned.noise_m
    clear = whole & (size > np.maximum(SIGMAS * noise_m, 0.5 * fast))
    ratio = step[2:-2][clear] / around[clear]
    many = np.where(ratio < MOST, np.rint(np.maximum(ratio - 0.1, 1.0)) - 1.0, 0.0)
    lost, short = np.count_nonzero(many), np.count_nonzero(ratio < 0.4)
    # Only in the fast part of a period are two steps told from one.
    if lost >= max(8, LEAST_SHARE * ratio.size) and lost > 3 * short:
        return round(float(many.mean()) * track.y.size)
    return 0
