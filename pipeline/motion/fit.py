"""One fit of any model of the motion to samples: rows, least squares, false echoes, and the covariance.

A model gives the position at any time and its derivatives by named parameters. Every fit of the motion to samples goes
through :func:`fit` and leaves out false echoes by :func:`clipped`, whether the model is an average over cycles, the
equation of motion, a relaxation or two modes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pipeline.numerics import least_squares
from pipeline.numerics.least_squares import EPS, Fit
from pipeline.numerics.levels import FEWEST_FOR_CURVE, MISFIT, ROUNDS
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.robust import mad_sigma
from pipeline.track import F8, U8, Bools, Quality
from pipeline.windows.demodulate import CLIP_SIGMAS

# Maximum share of the samples that may still enter or leave the fit in the last round. At the limit of 4 sigmas, and
# with signs by chance, they move an estimate by 4 sqrt(1e-4) = 0.04 of its standard uncertainty.
FEW_CHANGES = 1e-4


# Maximum ratio of the noise to that of the fourth differences of neighbours: for a mean of k samples the formula
# sqrt(7 k / 4) follows from their coefficients; here k is 8.
SMOOTHED = math.sqrt(14.0)


def allowed(noise: float, scatter: float) -> float:
    """Return the largest residual that is no misfit, from the noise of neighbours and the scatter about a free curve.

    Neighbours differ by less than the noise if the sensor averages its samples, but not by any factor.
    """
    return MISFIT * min(max(noise, scatter), SMOOTHED * noise)


class Model(Protocol):
    """A motion with parameters."""

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the positions (n,) at t, and a function that gives their derivatives (n, p) by them."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Samples as rows of a fit.

    ``columns`` (n, k) enter linearly and are projected out: with the projector :math:`P` on what they do not span, the
    residuals are :math:`P(f - y)/u` and their derivatives :math:`P\\,\\partial f/u`, which is variable projection
    without its second term (G. Golub, V. Pereyra, Inverse Problems 19 (2003) R1).
    """

    t: F8
    y: F8
    candidates: Bools  # samples that may be used
    used: Bools
    u: float = 1.0  # standard uncertainty of a sample
    columns: F8 | None = None
    near_plateau: Callable[[F8], Bools] | None = None  # whether a model (n,) is too close to a clipping level

    def on_plateau(self, position: F8) -> Bools:
        """Return where noise decides whether a sample is clipped, for a model of all samples."""
        return np.zeros(self.t.size, np.bool_) if self.near_plateau is None else self.near_plateau(position)

    def marked(self, flags: U8, among: Bools, position: F8) -> U8:
        """Return flags with those samples among some that are not used marked as clipped or as false echoes."""
        flags, out, crest = flags.copy(), among & ~self.used, self.on_plateau(position)
        flags[out & crest] |= np.uint8(Quality.CLIPPED)
        flags[out & ~crest] |= np.uint8(Quality.FALSE_ECHO)
        return flags

    def residuals(self, model: Model) -> Callable[[F8], tuple[F8, Callable[[], F8]]]:
        """Return a function of the parameters that gives the residuals over u and their derivatives."""
        t, y = self.t[self.used], self.y[self.used]
        base = None if self.columns is None else self.columns[self.used] @ self._turn()

        def beyond(values: F8) -> F8:
            return values if base is None else values - base @ (base.T @ values)

        def at(values: F8) -> tuple[F8, Callable[[], F8]]:
            position, slopes = model.at(t, values)
            return beyond(position - y) / self.u, lambda: beyond(slopes()) / self.u

        return at

    def left(self, model: Model, values: F8) -> F8:
        """Return what the model and the columns leave of all samples, (n,)."""
        left = self.y - model.at(self.t, values)[0]
        if self.columns is None:
            return np.asarray(left)
        turn = self._turn()
        return np.asarray(left - self.columns @ (turn @ (turn.T @ (self.columns[self.used].T @ left[self.used]))))

    def _turn(self) -> F8:
        """Return the matrix that makes the columns of the samples used orthonormal, less those that depend on others.

        The eigenvectors of the normal matrix take 0.5 ms for 28 columns of 12,000 rows; a decomposition takes 20 ms.
        """
        assert self.columns is not None
        part = self.columns[self.used]
        normal = part.T @ part
        scale = np.maximum(np.sqrt(np.diag(normal)), 1e-300)
        values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
        kept = values > values.size * EPS * values[-1]  # the rule of numpy.linalg.matrix_rank
        return np.asarray(vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None])


def fit(model: Model, rows: Rows, start: F8) -> Fit:
    """Fit a model to the rows that are used."""
    at = least_squares.remembering(rows.residuals(model))
    return least_squares.minimise(lambda x: at(x)[0], start, lambda x: at(x)[1]())


def clipped(
    model: Model, rows: Rows, start: F8, *, least: float, noise: float = math.inf, rounds: int = ROUNDS
) -> tuple[Fit, Rows]:
    """Fit until the set of false echoes is stable; return the last fit and its rows.

    Residuals below ``least_m`` times :data:`CLIP_SIGMAS` are never false echoes. If the residuals contain more than
    noise, no more samples are excluded and none returns. The fit has not converged if hardly any sample lies on the
    model.
    """
    for left_rounds in range(rounds, 0, -1):
        found = fit(model, rows, start)
        left = rows.left(model, found.values)
        spread = mad_sigma(left[rows.candidates])
        candidates = rows.candidates & ~rows.on_plateau(rows.y - left)
        near = rows.used if spread > MISFIT * noise else np.abs(left) <= CLIP_SIGMAS * max(spread, least)
        chosen = candidates & near
        if (count := int(np.count_nonzero(chosen))) < 2 * start.size:
            few = replace(found, converged=False, tried=f"only {count} samples lie on the model")
            return few, replace(rows, used=chosen)
        if left_rounds == 1 or np.count_nonzero(chosen != rows.used) <= FEW_CHANGES * chosen.size:
            break
        rows, start = replace(rows, used=chosen), found.values
    return found, rows


def covariance_of(found: Fit, model: Model, rows: Rows, noise: float, periods: int) -> F8:
    """Return the covariance (p, p) of a fit's parameters for residuals of standard deviation ``noise``, over u.

    If residuals are not white it is that of the score summed over whole periods, including the correlation between
    neighbouring periods, where it exceeds the white covariance significantly. Over few periods, correlated samples
    count as fewer.
    """
    inverse, u = found.covariance, np.sqrt(np.diag(found.covariance)) * noise
    factors = np.ones(u.size)
    starts = np.arange(0, rows.t.size, max(round(rows.t.size / max(periods, 1)), 1), dtype=np.int64)
    if starts.size < FEWEST_FOR_CURVE:
        return np.asarray(inverse * noise**2 * correlation_length(found.residual))
    if np.all(u > 0):
        scores = np.zeros((rows.t.size, u.size))
        scores[rows.used] = rows.residuals(model)(found.values)[1]() * found.residual[:, None]
        for k, pull in enumerate((np.add.reduceat(scores, starts, axis=0) @ inverse / u).T):
            squares = pull**2
            ratio = float(squares.sum())
            independent = ratio**2 / max(float(squares @ squares), 1e-300)
            significant = ratio > 1.0 + 3.3 * math.sqrt(2.0 / max(independent, 1.0))
            factors[k] = math.sqrt((ratio if significant else 1.0) * correlation_length(pull))
    return np.asarray(inverse * noise**2 * np.outer(factors, factors))
