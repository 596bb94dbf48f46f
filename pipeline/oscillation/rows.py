"""Rows that are not one after another in time: lost, doubled, of two records in turn; told from the distances."""

from __future__ import annotations

import numpy as np

from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import FOURTH_DIFFERENCE_GAIN, Conditioned, fourth_difference_noise
from pipeline.track import F8, Track

__all__ = ["MAINS_HZ", "are_interleaved", "count_doubled", "count_lost", "hum_in_turn"]

MAINS_HZ = (50.0, 60.0, 100.0, 120.0)

SIGMAS = 8.0  # of the noise that a step between rows must have to be told from two steps
ALIKE = 0.7  # correlation of what alternates, from row to row
LEAST = 64  # rows
LEAST_SHARE = 0.015  # of the rows
MANY = 0.1  # of the rows: so many that the steps around are often two at once themselves
SLOW = 0.25  # of the fastest steps: below, near a turning point, a lost row is no more than noise
HUM_NEAR, HUM_SIZE = 0.01, 0.25  # of the rate off half of it, and of the motion's rms, that alternating hum may be
REGULAR = 0.9  # of the gaps between repeated rows that are alike where a sensor is slower than the record
SMOOTHER = 0.75  # of what fourth differences are, that they may be without the repeated rows
UNLIKE = 5.0  # times the noise between two distances that are not alike by chance
FINE = 0.02  # of the noise, of steps that are no more than digits
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
    off = _in_turn(y)
    power = float(off @ off) / off.size
    return power > 0.0 and all(float(off[lag:] @ off[:-lag]) > ALIKE * power * (off.size - lag) for lag in (3, 5, 7, 9))


def hum_in_turn(track: Track) -> float | None:
    """Return by how much the rows of an alternating record alternate if mains hum does that, in its unit; else None.

    Notes
    -----
    A mains frequency that the sampling folds to within a hundredth of half the rate changes its sign from row to row,
    and is small beside the motion that both halves of the rows show.
    """
    half_hz = 0.5 * track.rate_hz
    folded = (abs(mains - track.rate_hz * round(mains / track.rate_hz)) for mains in MAINS_HZ)
    if all(abs(line - half_hz) > HUM_NEAR * track.rate_hz for line in folded):
        return None
    y = track.y[np.isfinite(track.y)]
    size = 0.5 * float(np.sqrt(np.mean(_in_turn(y) ** 2)))
    return size if size < HUM_SIZE * float(np.std(y)) else None


def _in_turn(y: F8) -> F8:
    """What every row is off the mean of its neighbours, with the sign changed from row to row."""
    off: F8 = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    off[::2] *= -1.0
    return off


def count_doubled(conditioned: Conditioned) -> int:
    """Return how many rows repeat the one before while times were counted on; 0 where they may be new ones.

    Notes
    -----
    Looked for where the motion goes by several steps of the sensor and of the noise from row to row, so that no two
    distances are alike. Rows at equal gaps are those of a sensor slower than the record, whose times are right.
    Without the repeated rows, those left must scatter less from neighbour to neighbour.
    """
    track, used = conditioned.track, conditioned.used
    y = track.y[used]
    step = np.diff(y)
    again = np.flatnonzero(step == 0.0)
    if y.size < LEAST or again.size < max(5.0, LEAST_SHARE * y.size):
        return 0
    gaps = np.diff(again)
    mean = float(np.mean(gaps))
    if float(np.mean((gaps >= np.floor(mean)) & (gaps <= np.ceil(mean)))) > REGULAR:
        return 0
    noise_m, quantum_m = fourth_difference_noise(np.delete(y, again + 1)), conditioned.quantum_m or 0.0
    around = np.abs(np.median([step[:-4], step[1:-3], step[3:-1], step[4:]], axis=0))
    # Fine steps under noise are hardly ever alike by chance, however slow the motion.
    least = 0.0 if quantum_m < FINE * noise_m else max(UNLIKE * noise_m, 3.0 * quantum_m)
    clear = around > max(least, 0.5 * float(np.quantile(around, 0.9)))
    repeated = clear & (step[2:-2] == 0.0)
    count = np.count_nonzero(repeated)
    if count < max(5.0, LEAST_SHARE * np.count_nonzero(clear)):
        return 0
    fresh = np.delete(y, np.flatnonzero(repeated) + 3)
    if float(np.mean(np.abs(np.diff(fresh, 4)))) > SMOOTHER * float(np.mean(np.abs(np.diff(y, 4)))):
        return 0
    return round(count / np.count_nonzero(clear) * y.size)


def count_lost(conditioned: Conditioned) -> int:
    """Return how many rows were lost while times were counted on; 0 where that cannot be told from noise.

    Notes
    -----
    Where a row is missing the distance makes two steps at once: twice the median of the two before and the two after.
    Where every fifth row and more is missing, that median is often of two steps itself, and the lesser of the middle
    two of the four is taken. Where times jitter, or values are held, as many steps are too short. The noise is that
    near the turning points, where a lost row moves little.
    """
    track, used = conditioned.track, conditioned.used
    step: F8 = np.diff(track.y)
    sound = used[1:] & used[:-1] & (np.abs(np.diff(track.t) * track.rate_hz - 1.0) < 0.2)
    if step.size < LEAST:
        return 0
    four = np.sort([step[:-4], step[1:-3], step[3:-1], step[4:]], axis=0)
    whole = np.logical_and.reduce([sound[k : sound.size - 4 + k] for k in range(5)])
    if not whole.any():
        return 0
    median, lesser = 0.5 * (four[1] + four[2]), np.where(four.sum(axis=0) > 0.0, four[1], four[2])
    fast = float(np.quantile(np.abs(median[whole]), 0.9))
    slow = np.diff(step, 3)[:-1][whole & (np.abs(median) < SLOW * fast)]
    noise_m = float(mad_sigma(slow) / FOURTH_DIFFERENCE_GAIN) if slow.size >= LEAST else conditioned.noise_m
    for around, least, times in ((lesser, MANY, 3), (median, LEAST_SHARE, 5)):
        clear = whole & (np.abs(around) > np.maximum(SIGMAS * noise_m, 0.5 * fast))
        ratio = step[2:-2][clear] / around[clear]
        # Only in the fast part of a period are two steps told from one.
        many = np.where(ratio < MOST, np.rint(np.maximum(ratio - 0.1, 1.0)) - 1.0, 0.0)
        lost, short = np.count_nonzero(many), np.count_nonzero(ratio < 0.4)
        if lost >= max(5, least * ratio.size) and lost > times * short:
            return round(float(many.mean()) * track.y.size)
    return 0
