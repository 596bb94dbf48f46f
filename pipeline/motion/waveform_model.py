"""The whole record as one function of few parameters, and its normal equations in chunks that fit into a cache."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.laws import Law
from pipeline.track import F8

__all__ = ["Normal", "Record", "State", "accumulate", "scores"]

TABLE = 1025
CHUNK = 16384  # samples; a dozen columns of them stay within a second-level cache


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """The samples of one record, its time centred.

    Parameters
    ----------
    elapsed : (n,) float64, s
        Since the first sample used, held within the samples used: a law holds where it was fitted.
    tau : (n,) float64, s
        From the middle of the record.
    y : (n,) float64, m
        Distance less ``level``; 0 where unmeasured.
    level : float, m
        Taken off all distances, so that sums do not cancel.
    order : int
        Of the polynomial that the rest position follows.
    reach : float, s
        Greatest distance from the middle; scales the polynomial.
    extra : (n, k) float64
        Further columns that enter linearly, such as a sideways mode's.
    """

    elapsed: F8
    tau: F8
    y: F8
    level: float
    order: int
    reach: float
    extra: F8

    @property
    def linear_count(self) -> int:
        """Number of columns that enter linearly."""
        return self.order + 1 + int(self.extra.shape[1])

    def linear(self, part: slice) -> F8:
        """Return (k, m): rest position's polynomials and extra columns of some samples."""
        tau = self.tau[part]
        rows = np.empty((self.linear_count, tau.size))
        rows[: self.order + 1] = self.rest(tau)
        rows[self.order + 1 :] = self.extra[part].T
        return rows

    def rest(self, tau: F8) -> F8:
        """Return (order + 1, m): the rest position's polynomials at times from the middle (m,), s."""
        if not self.order:
            return np.ones((1, tau.size))
        return np.asarray(np.polynomial.legendre.legvander(tau / self.reach, self.order).T)

    def parts(self) -> Iterator[slice]:
        """Yield slices that cover the record."""
        for start in range(0, self.tau.size, CHUNK):
            yield slice(start, min(start + CHUNK, self.tau.size))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Values of the model's parameters.

    Parameters
    ----------
    law : Law
    theta : (p,) float64
        The law's.
    turning : (2 or 3,) float64
        Phase in the middle (rad), angular frequency (rad/s) and, where there is one, the backbone
        (rad/(s m^p)) of :math:`\\omega(A) = \\omega_0 + \\kappa A^p`.
    linear : (k,) float64
        Coefficients of the linear columns, m.
    area : tuple of (g,) float64, or None
        Times from the middle and the integral of A^p, m^p s; with a backbone only.
    exponent : float
        p.
    """

    law: Law
    theta: F8
    turning: F8
    linear: F8
    area: tuple[F8, F8] | None = None
    exponent: float = 2.0

    @property
    def values(self) -> F8:
        """All parameters in one row."""
        return np.concatenate([self.theta, self.turning, self.linear])

    def moved(self, step: F8) -> State:
        """Return the state a step away."""
        p, q = self.theta.size, self.theta.size + self.turning.size
        return replace(
            self, theta=self.theta + step[:p], turning=self.turning + step[p:q], linear=self.linear + step[q:]
        )

    def angle(self, tau: F8) -> F8:
        """Return the total phase at times from the middle, rad."""
        angle = self.turning[0] + self.turning[1] * tau
        if self.area is not None:
            angle += self.turning[2] * np.interp(tau, *self.area)
        return np.asarray(angle)


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Normal equations at a state.

    Parameters
    ----------
    matrix : (q, q) float64
    right : (q,) float64
    squares : float
        Weighted sum of squared residuals, m^2.
    residual : (n,) float64, m
    """

    matrix: F8
    right: F8
    squares: float
    residual: F8


def accumulate(record: Record, state: State, weights: F8) -> Normal:
    """Return the normal equations, summed chunk by chunk.

    Parameters
    ----------
    record : Record
    state : State
    weights : (n,) float64
    """
    size = state.values.size
    matrix, right = np.zeros((size, size)), np.zeros(size)
    residual = np.empty(record.tau.size)
    squares = 0.0
    for part in record.parts():
        rows, residual[part] = _rows(record, state, part)
        weighted = rows * weights[part]
        matrix += weighted @ rows.T
        right += weighted @ residual[part]
        squares += float((weights[part] * residual[part]) @ residual[part])
    return Normal(matrix, right, squares, residual)


def scores(record: Record, state: State, weights: F8, starts: NDArray[np.int64]) -> F8:
    """Return (b, q): sums of derivative times residual over batches that begin at ``starts``."""
    summed = np.zeros((starts.size, state.values.size))
    for part in record.parts():
        rows, residual = _rows(record, state, part)
        first = int(np.searchsorted(starts, part.start, side="right")) - 1
        last = int(np.searchsorted(starts, part.stop, side="left"))
        local = np.maximum(starts[first:last] - part.start, 0)
        summed[first:last] += np.add.reduceat(rows * (weights[part] * residual), local, axis=1).T
    return summed


def _amplitudes(state: State, elapsed: F8) -> tuple[F8, F8]:
    """Amplitude (m,) and its derivatives (p, m); from a table where samples are many, for laws are slow and smooth.

    Straight lines between 1025 points of a chunk err by 1e-5 of the amplitude where it falls by e^10 in the chunk.
    """
    if elapsed.size < 4 * TABLE:
        amplitude, by = state.law.both(elapsed, state.theta)
        return amplitude, by.T
    grid = np.linspace(float(elapsed.min()), float(elapsed.max()), TABLE)
    amplitude, by = state.law.both(grid, state.theta)
    return np.interp(elapsed, grid, amplitude), np.stack([np.interp(elapsed, grid, column) for column in by.T])


def _rows(record: Record, state: State, part: slice) -> tuple[F8, F8]:
    """Derivatives of the model by every parameter (q, m), and what it leaves (m,)."""
    tau, elapsed = record.tau[part], record.elapsed[part]
    p, turns = state.theta.size, state.turning.size
    rows = np.empty((state.values.size, tau.size))
    angle = state.angle(tau)
    cosine, sine = np.cos(angle), np.sin(angle)
    amplitude, by = _amplitudes(state, elapsed)
    np.multiply(by, cosine, out=rows[:p])
    np.multiply(amplitude, -sine, out=rows[p])
    np.multiply(rows[p], tau, out=rows[p + 1])
    if state.area is not None:
        np.multiply(rows[p], np.interp(tau, *state.area), out=rows[p + 2])
    rows[p + turns :] = record.linear(part)
    return rows, record.y[part] - amplitude * cosine - state.linear @ rows[p + turns :]
