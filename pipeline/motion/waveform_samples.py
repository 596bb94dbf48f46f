"""Which samples a fit of the whole waveform takes: those within the noise of its own model, and no cut crest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.motion.waveform_model import Record, State
from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, UNUSABLE, Quality

__all__ = ["Chooser", "Rows"]

Rows = NDArray[np.bool_]

DEPENDENT = 1e-13  # share of the largest singular value, below which a step is not taken
ROUNDS = 20  # most, of choosing on a tangent
TANGENT = 1.1  # greatest ratio of the squares that a model leaves to those that its tangent predicts


class Chooser:
    """Chooses the samples of one record.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated : Demodulated
        For the flags and the noise of the windows.
    record : Record
        The same samples, as the fit takes them.
    clip_sigmas : float
        Residuals beyond this many standard deviations are false echoes.

    Notes
    -----
    Samples and fit depend on each other. They are settled on the model's tangent, where a round costs one product of
    matrices: the windows' values are near the end, so that the tangent errs by far less than the noise.
    """

    def __init__(self, conditioned: Conditioned, demodulated: Demodulated, record: Record, clip_sigmas: float) -> None:
        self._conditioned, self._record = conditioned, record
        self._noise_m, self._clip_sigmas = demodulated.noise_m, clip_sigmas
        usable = (conditioned.flags & UNUSABLE) == 0
        self.by_windows: Rows = usable & ((demodulated.flags & UNUSABLE) == 0)
        echo = (demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0
        # Samples that a window's narrow spread or a neighbour's spike put out may come back; those in clusters may not.
        run = np.convolve(echo, np.ones(3), "same") == 3
        cluster = np.convolve(run, np.ones(3), "same") > 0
        flagged = (conditioned.track.flags & UNUSABLE) != 0
        others = (demodulated.flags & UNUSABLE & ~np.uint8(Quality.FALSE_ECHO)) != 0
        self._candidates = (usable | (echo & ~flagged & ~others)) & ~cluster

    def settled(self, state: State, before: Rows) -> tuple[Rows, State]:
        """Return the samples (n,) that lie on the model fitted to them, and that fit, on the tangent about a state.

        Both as given where the state is so far from the end that the tangent does not predict what the model leaves.
        """
        record, rows = self._record, before
        position, slopes = state.evaluate(record.elapsed, record.tau)
        left, slope = record.y - position, np.concatenate([slopes, record.basis], axis=1)
        scale = np.maximum(np.linalg.norm(slope, axis=0), 1e-300)
        slope /= scale
        normal, right = slope.T @ slope, slope.T @ left
        for _ in range(ROUNDS):
            # Few samples are out: their part is taken off the whole record's normal equations.
            out = slope[~rows]
            inverse = np.linalg.pinv(normal - out.T @ out, rcond=DEPENDENT, hermitian=True)
            step = inverse @ (right - out.T @ left[~rows])
            predicted = left - slope @ step
            chosen = self.near(predicted, rows)
            if np.array_equal(chosen, rows):
                break
            rows = chosen
        step = step / scale
        moved = replace(state, values=state.values + step[: state.values.size])
        linear = record.basis @ step[state.values.size :]
        found = record.y - moved.position(record.elapsed, record.tau) - linear
        good = np.sum(found[rows] ** 2) <= TANGENT * np.sum(predicted[rows] ** 2)
        return (rows, moved) if good else (before, state)

    def near(self, left: F8, rows: Rows) -> Rows:
        """Return the samples within the noise of a model that leaves (n,), m."""
        spread = mad_sigma(left[self._candidates])
        near = self._candidates & ~self.on_plateau(self._record.y - left)
        if spread > 1.5 * self._noise_m:
            # What the model leaves is not noise alone: the verdict so far on each sample stands.
            return np.asarray(near & rows)
        return np.asarray(near & (np.abs(left) <= self._clip_sigmas * spread))

    def on_plateau(self, position: F8) -> Rows:
        """Return where a model (n,), m less the record's level, is too near a level at which distances are cut."""
        return self._conditioned.near_plateau(position + self._record.level, self._noise_m)
