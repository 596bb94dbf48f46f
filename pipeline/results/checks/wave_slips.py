"""Whole-wave slips: false echoes that lie one wave of the ultrasound off the motion, as cheap modules make them.

A comparator at a fixed threshold hears the echo's first wave that exceeds it, or the next: 25 us at 40 kHz. Such
samples are false echoes, found as all others are; what tells them is that they stand at one distance, on either side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.quantity import amount
from pipeline.oscillation.demodulate import Demodulated
from pipeline.results.checks.finding import Finding
from pipeline.track import Quality, Track

__all__ = ["WaveSlips", "find_wave_slips", "judge_wave_slips"]

WAVE_S = 25e-6  # of 40 kHz
SPEED_M_PER_S = 344.0  # of sound in a room, where nobody says which made the distances
SPREAD = 0.03  # of a wave, by which a transducer's frequency and the air differ from that
MOST_NOISE = 1.0 / 8.0  # of a wave: noise beyond it reaches from one to the next
WIDEST = 0.35  # of a wave, half the width in which a slip is told
LEAST = 3
CLUSTERED = 2.0  # by how much echoes in clusters of many may exceed what as many single ones leave
HEAVY = 0.1  # of all samples


@dataclass(frozen=True, slots=True, eq=False)
class WaveSlips:
    """Samples one wave off the motion.

    Parameters
    ----------
    rows : (k,) int64
        Which; none where they do not stand out of the other false echoes.
    nearer : int
        Of them those that lie nearer than the motion.
    wave_m : float
        One wave, there and back, as distance, m.
    """

    rows: NDArray[np.int64]
    nearer: int
    wave_m: float


def find_wave_slips(track: Track, demodulated: Demodulated) -> WaveSlips:
    """Return the false echoes that are whole-wave slips.

    Parameters
    ----------
    track : Track
    demodulated : Demodulated
        For its flags, noise, and how far off flagged samples lie.

    Notes
    -----
    A slip lies within four standard deviations of the noise and 3 % of a wave, at most 0.35 of it, of
    :math:`c\\,\\tau/2` beside the motion, with :math:`\\tau` = 25 us. Slips are told where three at least lie there,
    and more by three standard deviations of the count than twice what the other false echoes within two waves, spread
    evenly, would leave there. Counted are moments, not samples: an object that the bob passes gives many in a row,
    wherever it stands. Noise of more than an eighth of a wave hides slips.
    """
    wave_m = 0.5 * WAVE_S * (track.speed_of_sound_m_per_s or SPEED_M_PER_S)
    noise_m = demodulated.noise_m
    none = WaveSlips(np.empty(0, np.int64), 0, wave_m)
    if track.unit != "m" or noise_m > MOST_NOISE * wave_m:
        return none
    rows = np.flatnonzero((demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0)
    off = demodulated.residual[rows] / wave_m
    width = min(4.0 * noise_m / wave_m + SPREAD, WIDEST)
    slipped = np.abs(np.abs(off) - 1.0) <= width
    by_chance = _moments(rows[(np.abs(off) <= 2.0) & ~slipped]) * 2.0 * width / (2.0 - 2.0 * width)
    found = _moments(rows[slipped])
    if found < LEAST or found <= CLUSTERED * by_chance + 3.0 * np.sqrt(by_chance):
        return none
    return WaveSlips(rows[slipped], int(np.count_nonzero(off[slipped] < 0.0)), wave_m)


def _moments(rows: NDArray[np.int64]) -> int:
    """Return the number of samples (k,), those that follow one another counted once."""
    return int(np.count_nonzero(np.diff(rows) > 1)) + min(rows.size, 1)


def judge_wave_slips(slips: WaveSlips, samples: int, unit: str) -> Iterator[Finding]:
    """Yield what is said of slips in a record of so many samples."""
    count = slips.rows.size
    if not count:
        return
    share = count / samples
    yield Finding(
        "wave_slips",
        "warning" if share > HEAVY else "info",
        f"{count} of {samples} samples ({share:.1%}) lie one wave of 40 kHz ({amount(slips.wave_m, unit, '.1f')}) off "
        f"the motion, {slips.nearer} of them nearer: the sensor heard a wave of the echo too early or too late; they "
        "were left out of the fit",
    )
