"""Stopping: where a bob comes to rest and stays at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.numerics.robust import median
from pipeline.samples.condition import Conditioned
from pipeline.track import F8

__all__ = ["moving_part", "stop_row"]

BLOCK = 25  # samples over which a bob is seen to move or not


def moving_part(conditioned: Conditioned, share: float) -> Conditioned | None:
    """Return the record up to where its bob stops; None where it moves for a share of the samples, or never.

    A bob that friction stops early leaves a record in whose spectrum the oscillation drowns.

    Parameters
    ----------
    conditioned : Conditioned
    share : float
        Of the samples used.
    """
    if (stop := stop_row(conditioned)) is None:
        return None
    rows = np.flatnonzero(conditioned.used)
    if not np.count_nonzero(rows < stop) < share * rows.size:
        return None
    track = conditioned.track
    cut = replace(track, t=track.t[:stop], y=track.y[:stop], flags=track.flags[:stop], velocity=None)
    return replace(conditioned, track=cut, flags=conditioned.flags[:stop])


def stop_row(conditioned: Conditioned) -> int | None:
    """Return the index of the sample from which on the bob rests; None where it moves to the end, or never.

    Parameters
    ----------
    conditioned : Conditioned
    """
    rows = np.flatnonzero(conditioned.used)
    count = rows.size // BLOCK
    noise = max(conditioned.noise_m, conditioned.quantum_m or 0.0)
    if count < 8 or not noise > 0.0:
        return None
    y, blocks = conditioned.track.y, rows[: count * BLOCK].reshape(-1, BLOCK)
    end = median(y[blocks[-max(count // 10, 2) :]].ravel())
    # Of a sensor that counts, distances are whole steps: two of them are two in every unit, however that rounds.
    least = (2.0 + 1e-6) * noise
    # Most bobs move at the end of their record, and the last blocks say so.
    if _away(y[blocks[-4:]], end).max() > least:
        return None
    moving = np.flatnonzero(_away(y[blocks], end) > least)
    # A few blocks that deep noise lifts are no motion: of those before the stop a share must stand off.
    if moving.size < 3 or moving.size < 0.3 * (moving[-1] + 1):
        return None
    return int(blocks[int(moving[-1]) + 2, 0])


def _away(blocks: F8, end: float) -> F8:
    """Median distance of each block's samples from where the record ends, m."""
    # The middle one of an odd number; the library's median takes ten times as long for a few blocks.
    return np.asarray(np.partition(np.abs(blocks - end), BLOCK // 2, axis=1)[:, BLOCK // 2])
