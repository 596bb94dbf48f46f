"""Stopping: the time at which a bob comes to rest and stays at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.numerics.robust import median
from pipeline.samples.condition import Samples
from pipeline.track import F8

# Samples over which a bob is judged to be moving or at rest: half of them deviate by two standard deviations of noise
# with a probability of 2e-11.
BLOCK = 25


def moving_part(samples: Samples, share: float) -> Samples | None:
    """Return the record up to the bob's stop; None if the bob moves for a stated share of the samples, or never.

    If friction stops a bob early, the noise of the long rest hides the oscillation in the record's spectrum.
    """
    if (stop := stop_row(samples)) is None:
        return None
    rows = np.flatnonzero(samples.used)
    if not np.count_nonzero(rows < stop) < share * rows.size:
        return None
    track = samples.track
    moving = replace(track, t=track.t[:stop], y=track.y[:stop], flags=track.flags[:stop], velocity=None)
    return replace(samples, track=moving, flags=samples.flags[:stop])


def stop_row(samples: Samples) -> int | None:
    """Return the index of the first sample at rest; None if the bob moves to the end, or never."""
    rows = np.flatnonzero(samples.used)
    count = rows.size // BLOCK
    noise = max(samples.noise, samples.quantum or 0.0)
    if count < 8 or not noise > 0.0:
        return None
    y, blocks = samples.track.y, rows[: count * BLOCK].reshape(-1, BLOCK)
    end = median(y[blocks[-max(count // 10, 2) :]].ravel())
    # With a quantised sensor, distances are whole steps: the margin lets two steps pass as two despite rounding.
    least = (2.0 + 1e-6) * noise
    # Most bobs still move at the end of their record, and the last blocks show it.
    if _away(y[blocks[-4:]], end).max() > least:
        return None
    moving = np.flatnonzero(_away(y[blocks], end) > least)
    # A few blocks raised by strong noise are no motion: of the blocks before the stop, a minimum share must move.
    if moving.size < 3 or moving.size < 0.3 * (moving[-1] + 1):
        return None
    return int(blocks[int(moving[-1]) + 2, 0])


def _away(blocks: F8, end: float) -> F8:
    """Return the median distance of each block's samples from the record's final value, m."""
    # The middle value of an odd number; the library's median takes ten times as long for a few blocks.
    return np.asarray(np.partition(np.abs(blocks - end), BLOCK // 2, axis=1)[:, BLOCK // 2])
