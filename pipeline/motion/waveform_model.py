"""The whole record as one function of few parameters, as a least-squares fit takes it, and the samples it takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.laws import Law
from pipeline.motion.phase import PhaseFit
from pipeline.motion.waveform import Rest
from pipeline.numerics import least_squares
from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Conditioned
from pipeline.track import F8, UNUSABLE, Quality
from pipeline.windows.demodulate import Demodulated, model_error

__all__ = ["Chooser", "Record", "Rows", "State", "WaveformModel"]

Rows = NDArray[np.bool_]

DEPENDENT = 1e-13  # share of the largest eigenvalue, below which columns say the same
ROUNDS = 20  # most, of choosing samples on a tangent
TANGENT = 1.1  # greatest ratio of the squares that a model leaves to those that its tangent predicts


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
        Of the polynomial that the rest position follows; 0 where it is constant.
    reach : float, s
        Greatest distance from the middle; scales the polynomial.
    basis : (n, k) float64
        Columns about orthonormal that span what enters linearly: the polynomials of a rest position that drifts, and
        further ones such as a sideways mode's.
    turn : (k', k) float64
        The basis is those columns times this.
    """

    elapsed: F8
    tau: F8
    y: F8
    level: float
    order: int
    reach: float
    basis: F8
    turn: F8

    @classmethod
    def of(
        cls, conditioned: Conditioned, demodulated: Demodulated, phase: PhaseFit, rest: Rest, extra: F8 | None
    ) -> Record:
        """Centre a record; ``extra`` (n, k) float64 are columns that enter linearly besides the rest position."""
        track = conditioned.track
        known = np.isfinite(track.y) & np.isfinite(track.t)
        t = np.where(np.isfinite(track.t), track.t, phase.middle)
        tau, last = t - phase.middle, float(np.max(track.t[conditioned.used]))
        level, reach = rest.mean.value, float(np.max(np.abs(tau)))
        order = min(6, demodulated.t.size // 4 - 1) if rest.drifts else 0
        columns = [] if order == 0 else [_polynomials(tau / reach, order)]
        columns += [] if extra is None else [np.asarray(extra, np.float64)]
        basis, turn = _orthonormal(np.concatenate(columns, axis=1) if columns else np.empty((len(track), 0)))
        elapsed = np.clip(t, phase.t0, last) - phase.t0
        return cls(elapsed, tau, np.where(known, track.y, level) - level, level, order, reach, basis, turn)

    def curve(self, tau: F8, linear: F8) -> F8:
        """Return the drifting rest position at times from the middle (m,), m, for coefficients (k,) of the basis."""
        coefficients = (self.turn @ linear)[: self.order + 1]
        return np.asarray(self.level + _polynomials(tau / self.reach, self.order) @ coefficients)


def _polynomials(x: F8, order: int) -> F8:
    return np.asarray(np.polynomial.legendre.legvander(x, order))


def _orthonormal(columns: F8) -> tuple[F8, F8]:
    """Return orthonormal columns that span the same, to rounding, and the matrix that makes them.

    By eigenvectors of the normal matrix, 0.5 ms for 28 columns of 12,000 rows; the singular values take 20 ms.
    """
    normal = columns.T @ columns
    scale = _lengths(normal)
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    kept = values > DEPENDENT * np.max(values, initial=0.0)
    turn = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return columns @ turn, turn


def _lengths(normal: F8) -> F8:
    """Return the lengths (k,) of the columns whose products are given, (k, k); next to nothing where they are zero."""
    return np.asarray(np.maximum(np.sqrt(np.diag(normal)), 1e-300))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The model's parameters.

    Parameters
    ----------
    law : Law
    values : (q,) float64
        The law's; phase in the middle (rad) and angular frequency (rad/s); with ``area`` the backbone
        (rad/(s m^p)) of :math:`\\omega(A) = \\omega_0 + \\kappa A^p`; and the rest position less the record's level, m,
        where it is constant.
    constant : bool
        Whether the rest position is.
    area : tuple of (g,) float64, or None
        Times from the middle and the integral of A^p, m^p s; with a backbone only.
    exponent : float
        p.
    lag : tuple of (g,) float64, or None
        Times from the middle, s, and by how much the sinusoid of a period is late there, rad. It is that of the
        windows' law: what the parameters change of it is of second order.
    """

    law: Law
    values: F8
    constant: bool
    area: tuple[F8, F8] | None = None
    exponent: float = 2.0
    lag: tuple[F8, F8] | None = None

    @property
    def theta(self) -> F8:
        """The law's parameters."""
        return self.values[: len(self.law.parameters)]

    @property
    def turning(self) -> F8:
        """Phase, angular frequency and backbone."""
        first = len(self.law.parameters)
        return self.values[first : first + 2 + (self.area is not None)]

    @property
    def names(self) -> tuple[str, ...]:
        """What each value is."""
        turning = ("phase", "angular_frequency", "backbone")[: self.turning.size]
        return (*self.law.parameters, *turning, *(("rest",) if self.constant else ()))

    def with_law(self, law: Law, theta: F8) -> State:
        """Return the same motion with another law."""
        return replace(self, law=law, values=np.concatenate([theta, self.values[self.theta.size :]]))

    def angle(self, tau: F8) -> F8:
        """Return the total phase at times from the middle, rad."""
        steady = self.steady_angle(tau)
        return steady if self.lag is None else np.asarray(steady - np.interp(tau, *self.lag))

    def steady_angle(self, tau: F8) -> F8:
        """Return the total phase without the lag, rad."""
        angle = self.turning[0] + self.turning[1] * tau
        return np.asarray(angle if self.area is None else angle + self.turning[2] * np.interp(tau, *self.area))

    def amplitude(self, elapsed: F8) -> F8:
        """Return the amplitude (m,), m."""
        return self.law.curve(elapsed, self.theta)[0]

    def position(self, elapsed: F8, tau: F8) -> F8:
        """Return the distances (m,) at times from the first sample and the middle, less level and linear columns, m."""
        swing = self.amplitude(elapsed) * np.cos(self.angle(tau))
        return np.asarray(swing + self.values[-1] if self.constant else swing)

    def evaluate(self, elapsed: F8, tau: F8) -> tuple[F8, F8]:
        """Return the distances as :meth:`position` does and their derivatives by the values, (m, q)."""
        amplitude, slopes = self.law.curve(elapsed, self.theta)
        angle = self.angle(tau)
        cosine = np.cos(angle)
        first = self.theta.size
        rows = np.empty((self.values.size, tau.size))
        np.multiply(slopes.T, cosine, out=rows[:first])
        np.multiply(-amplitude, np.sin(angle), out=rows[first])
        np.multiply(rows[first], tau, out=rows[first + 1])
        if self.area is not None:
            np.multiply(rows[first], np.interp(tau, *self.area), out=rows[first + 2])
        position = amplitude * cosine
        if self.constant:
            rows[-1] = 1.0
            position += self.values[-1]
        return position, rows.T


class WaveformModel:
    """Residuals of some samples and their derivatives, with what enters linearly projected out.

    Parameters
    ----------
    record : Record
    state : State
        Says what the parameters are.
    rows : (n,) bool
        The samples.

    Attributes
    ----------
    residuals, jacobian : callable
        (q,) to (m,), m: model less distance; and to its derivatives (m, q).

    Notes
    -----
    For a projector :math:`P = 1 - B(B^TB)^{-1}B^T` that does not depend on the parameters, the residuals are
    :math:`P(f - y)` and their derivatives :math:`P\\,\\partial f`: variable projection [1]_ without its second term.

    References
    ----------
    .. [1] G. Golub, V. Pereyra, "Separable nonlinear least squares", Inverse Problems 19 (2003) R1,
       doi:10.1088/0266-5611/19/2/201.
    """

    def __init__(self, record: Record, state: State, rows: Rows) -> None:
        index = np.flatnonzero(rows)
        self._state, self._y = state, record.y[index]
        self._elapsed, self._tau, self._basis = record.elapsed[index], record.tau[index], record.basis[index]
        self._inverse = np.linalg.pinv(self._basis.T @ self._basis, hermitian=True)
        # A search asks three times for the derivatives at its start and twice for those at its end.
        self.residuals, self.jacobian = least_squares.evaluated_once(self._evaluate)

    def linear(self, values: F8) -> F8:
        """Return the coefficients (k,) of the basis."""
        left = replace(self._state, values=values).position(self._elapsed, self._tau) - self._y
        return np.asarray(-self._inverse @ (self._basis.T @ left))

    def _evaluate(self, values: F8) -> tuple[F8, F8]:
        position, slopes = replace(self._state, values=values).evaluate(self._elapsed, self._tau)
        rows = np.concatenate([(position - self._y)[None], slopes.T])
        if self._basis.size:
            rows -= ((rows @ self._basis) @ self._inverse) @ self._basis.T
        return rows[0], rows[1:].T


class Chooser:
    """Chooses the samples of one record: those within the noise of its model, and no cut crest.

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
        errors = model_error(demodulated.amplitude, demodulated.decay, demodulated.angular_frequency)
        self._least_m = float(np.median(errors))
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

        Both as given where the state is so far from the end that the tangent does not predict what the model leaves,
        or where the law has a pole within the record, so that there is no tangent.
        """
        record, rows = self._record, before
        with np.errstate(invalid="ignore", over="ignore"):  # a pole gives infinities, which are looked for
            position, slopes = state.evaluate(record.elapsed, record.tau)
        if not (np.isfinite(position).all() and np.isfinite(slopes).all()):
            return before, state
        left, slope = record.y - position, np.concatenate([slopes, record.basis], axis=1)
        normal, right = slope.T @ slope, slope.T @ left
        scale = _lengths(normal)
        units = np.outer(scale, scale)
        for _ in range(ROUNDS):
            # Few samples are out: their part is taken off the whole record's normal equations.
            out = slope[~rows]
            inverse = np.linalg.pinv((normal - out.T @ out) / units, rcond=DEPENDENT, hermitian=True)
            step = inverse @ ((right - out.T @ left[~rows]) / scale) / scale
            predicted = left - slope @ step
            chosen = self.near(predicted, rows)
            if np.array_equal(chosen, rows):
                break
            rows = chosen
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
        return np.asarray(near & (np.abs(left) <= self._clip_sigmas * max(spread, self._least_m)))

    def on_plateau(self, position: F8) -> Rows:
        """Return where a model (n,), m less the record's level, is too near a level at which distances are cut."""
        return self._conditioned.near_plateau(position + self._record.level, self._noise_m)
