"""Windows: a record cut into periods, and the linear fit of all of them at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.oscillation.condition import Conditioned
from pipeline.track import F8

__all__ = ["Solution", "Windows", "basis_of", "ranked", "solve", "solved"]


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Samples laid out as (windows, longest window), padded with unusable ones.

    Parameters
    ----------
    rows : (w, l) int64
        Index of each sample in the track.
    inside : (w, l) bool
        False for padding.
    usable : (w, l) float64
        1 for samples that may be fitted, else 0.
    y : (w, l) float64, m
        Distance less ``level``; 0 where not usable.
    tau : (w, l) float64, s
        Time from the window's centre; 0 where not usable.
    centre : (w,) float64, s
    level : float, m
        Taken off all distances, so that sums do not cancel.
    tiny : float, m
        What is nothing beside the motion: stands for zero where something is divided by a spread or an amplitude.
    """

    rows: NDArray[np.int64]
    inside: NDArray[np.bool_]
    usable: F8
    y: F8
    tau: F8
    centre: F8
    level: float
    tiny: float

    @classmethod
    def cut(cls, conditioned: Conditioned, bounds: NDArray[np.int64]) -> Windows:
        """Cut a conditioned track at sample indices (w + 1,)."""
        track = conditioned.track
        lengths = np.diff(bounds)
        slots = np.arange(int(lengths.max()))
        inside = slots[None, :] < lengths[:, None]
        rows = np.minimum(bounds[:-1, None] + slots[None, :], bounds[-1] - 1)
        usable = conditioned.used[rows] & inside
        level = float(np.median(track.y[conditioned.used]))
        y = np.where(usable, track.y[rows] - level, 0.0)
        tiny = 1e-12 * float(np.max(np.abs(y))) + 1e-150
        t = np.where(usable, track.t[rows], 0.0)
        counts = np.maximum(usable.sum(axis=1), 1)
        centre = t.sum(axis=1) / counts
        # The middle of the window, not of its usable samples, so that centres stay one period apart.
        ends = track.t[[bounds[:-1], bounds[1:] - 1]]
        middle = 0.5 * (ends[0] + ends[1])
        reach = np.ptp(track.t[conditioned.used])
        centre = np.where(np.abs(middle - centre) <= reach / max(len(lengths), 1), middle, centre)
        return cls(
            rows, inside, usable.astype(np.float64), y, np.where(usable, t - centre[:, None], 0.0), centre, level, tiny
        )

    def take(self, some: NDArray[np.int64]) -> Windows:
        """Return some of the windows."""
        return Windows(
            self.rows[some],
            self.inside[some],
            self.usable[some],
            self.y[some],
            self.tau[some],
            self.centre[some],
            self.level,
            self.tiny,
        )


def basis_of(windows: Windows, angular_frequency: F8, decay: F8) -> F8:
    """Return (w, 4, l): rest position, decaying cosine and minus sine, and below them the distances themselves.

    Parameters
    ----------
    windows : Windows
    angular_frequency, decay : (w,) float64, rad/s, 1/s
        Of each window.
    """
    rows = np.empty((windows.y.shape[0], 4, windows.y.shape[1]))
    angle = angular_frequency[:, None] * windows.tau
    rows[:, 0] = 1.0
    np.cos(angle, out=rows[:, 1])
    np.sin(angle, out=rows[:, 2])
    if decay.any():
        fall = np.exp(-decay[:, None] * windows.tau)
        rows[:, 1] *= fall
        rows[:, 2] *= -fall
    else:
        np.negative(rows[:, 2], out=rows[:, 2])
    rows[:, 3] = windows.y
    return rows


# Determinant of the normal matrix per sample: 1/4 for a full period, less where the samples crowd into a part
# of it, so that rest position and amplitude cannot be told apart.
LEAST_DETERMINANT = 0.003


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The fit of every window.

    Parameters
    ----------
    coefficients : (w, 3) float64, m
        Rest position less level, a, b.
    inverse : (w, 3, 3) float64
        Of the normal matrix.
    residual : (w, l) float64, m
    good : (w,) bool
        Enough samples, well spread over the period.
    """

    coefficients: F8
    inverse: F8
    residual: F8
    good: NDArray[np.bool_]

    def replaced(self, rows: NDArray[np.int64], other: Solution, which: NDArray[np.bool_]) -> Solution:
        """Return this solution with some windows taken from another."""
        parts = (self.coefficients.copy(), self.inverse.copy(), self.residual.copy(), self.good.copy())
        for mine, theirs in zip(parts, (other.coefficients, other.inverse, other.residual, other.good), strict=True):
            mine[rows] = theirs[which]
        return Solution(*parts)


def solve(windows: Windows, basis: F8, weights: F8) -> Solution:
    """Fit every window by weighted least squares.

    Parameters
    ----------
    windows : Windows
    basis : (w, 4, l) float64
    weights : (w, l) float64
    """
    sums = (basis[:, :3] * weights[:, None, :]) @ basis.transpose(0, 2, 1)
    upper, right = sums[:, (0, 0, 1, 1, 2), (1, 2, 1, 2, 2)].T, sums[:, :, 3].T
    coefficients, inverse, good = solved(sums[:, 0, 0], upper, right)
    offset, a, b = coefficients.T[:, :, None]
    residual = windows.y - offset - a * basis[:, 1] - b * basis[:, 2]
    return Solution(coefficients, inverse, residual, good)


def solved(count: F8, upper: F8, right: F8) -> tuple[F8, F8, NDArray[np.bool_]]:
    """Return coefficients (w, 3), inverses (w, 3, 3) of the normal matrices, and which of them are good (w,).

    Parameters
    ----------
    count : (w,) float64
        Sums of the weights, the first entry of each normal matrix.
    upper : (5, w) float64
        The rest of its upper triangle, row by row.
    right : (3, w) float64
    """
    count = np.maximum(count, 1e-300)
    # Divided by the count: 1, m, n, p, q, r are the upper triangle row by row.
    m, n, p, q, r = upper / count
    adjugate = np.empty((3, 3, count.size))
    adjugate[0, 0], adjugate[1, 1], adjugate[2, 2] = p * r - q * q, r - n * n, p - m * m
    adjugate[0, 1] = adjugate[1, 0] = q * n - m * r
    adjugate[0, 2] = adjugate[2, 0] = m * q - n * p
    adjugate[1, 2] = adjugate[2, 1] = m * n - q
    determinant = adjugate[0, 0] + m * adjugate[0, 1] + n * adjugate[0, 2]
    good = (count >= 6.0) & (determinant > LEAST_DETERMINANT)
    adjugate /= np.where(good, determinant, np.inf)
    coefficients = np.einsum("ijw,jw->wi", adjugate, right / count)
    return coefficients, adjugate.transpose(2, 0, 1) / count[:, None, None], good


def ranked(size: F8, usable: F8, share: float) -> F8:
    """Return a quantile over the usable samples of each row (usable is 0 or 1); 0 for a row without any."""
    ordered = np.sort(np.where(usable > 0, size, np.inf), axis=1)
    counts = usable.sum(axis=1)
    rank = np.maximum(np.ceil(share * counts).astype(np.int64) - 1, 0)
    return np.where(counts > 0, ordered[np.arange(len(ordered)), rank], 0.0)
