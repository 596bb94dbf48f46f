"""The model of the whole record for a least-squares fit, and the choice of the samples to be fitted."""

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

Rows = NDArray[np.bool_]

DEPENDENT = 1e-13  # eigenvalue, relative to the largest, below which columns count as linearly dependent
ROUNDS = 20  # maximum number of rounds of choosing samples with the linearised model
TANGENT = 1.1  # maximum ratio of a model's residual sum of squares to that predicted by its linearisation


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """The samples of one record with time measured from its middle.

    Parameters
    ----------
    elapsed : (n,) float64, s
        Time since the first sample used, limited to the range of the samples used, where the law was fitted.
    tau : (n,) float64, s
        Time from the middle of the record.
    y : (n,) float64, m
        Distance minus ``level``; 0 where no distance was measured.
    level : float, m
        Level subtracted from all distances to avoid cancellation in sums.
    order : int
        Degree of the polynomial that the rest position follows; 0 if it is constant.
    reach : float, s
        Maximum of the absolute ``tau``; it scales the argument of the polynomial.
    basis : (n, k) float64
        Nearly orthonormal columns that span all linear terms: the polynomials of a drifting rest position, and
        further columns such as those of a sideways mode.
    turn : (k', k) float64
        Matrix by which the k' original columns are multiplied to give the basis.
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
        """Centre a record; ``extra`` (n, k) float64 are linear columns in addition to the rest position."""
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
        """Return the drifting rest position in m at times ``tau`` (m,), for coefficients (k,) of the basis."""
        coefficients = (self.turn @ linear)[: self.order + 1]
        return np.asarray(self.level + _polynomials(tau / self.reach, self.order) @ coefficients)


def _polynomials(x: F8, order: int) -> F8:
    return np.asarray(np.polynomial.legendre.legvander(x, order))


def _orthonormal(columns: F8) -> tuple[F8, F8]:
    """Return orthonormal columns with the same span to within rounding, and the matrix that transforms to them.

    The eigenvectors of the normal matrix take 0.5 ms for 28 columns of 12,000 rows; a singular value decomposition
    takes 20 ms.
    """
    normal = columns.T @ columns
    scale = _lengths(normal)
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    kept = values > DEPENDENT * np.max(values, initial=0.0)
    turn = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return columns @ turn, turn


def _lengths(normal: F8) -> F8:
    """Return the lengths (k,) of columns from their normal matrix (k, k); 1e-300 for zero columns."""
    return np.asarray(np.maximum(np.sqrt(np.diag(normal)), 1e-300))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The model's parameters.

    Parameters
    ----------
    law : Law
    values : (q,) float64
        The law's parameters, the phase in the middle (rad) and the angular frequency (rad/s). With ``area`` the
        backbone (rad/(s m^2)) of :math:`\\omega(A) = \\omega_0 + \\kappa A^2` follows. If the rest position is
        constant, it comes last, minus the record's level (m).
    constant : bool
        Whether the rest position is constant.
    area : tuple of (g,) float64, or None
        Times from the middle (s) and the integral of A^2 (m^2 s); only with a backbone.
    lag : tuple of (g,) float64, or None
        Times from the middle (s) and the delays of a period's fitted sinusoid at these times (rad). They are fixed at
        those of the windows' law, because their change with the parameters is of second order.
    """

    law: Law
    values: F8
    constant: bool
    area: tuple[F8, F8] | None = None
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
        """Name of each value."""
        turning = ("phase", "angular_frequency", "backbone")[: self.turning.size]
        return (*self.law.parameters, *turning, *(("rest",) if self.constant else ()))

    def with_law(self, law: Law, theta: F8) -> State:
        """Return the same motion with another law."""
        return replace(self, law=law, values=np.concatenate([theta, self.values[self.theta.size :]]))

    def angle(self, tau: F8) -> F8:
        """Return the total phase in rad at times ``tau`` from the middle."""
        steady = self.steady_angle(tau)
        return steady if self.lag is None else np.asarray(steady - np.interp(tau, *self.lag))

    def steady_angle(self, tau: F8) -> F8:
        """Return the total phase without the lag in rad."""
        angle = self.turning[0] + self.turning[1] * tau
        return np.asarray(angle if self.area is None else angle + self.turning[2] * np.interp(tau, *self.area))

    def amplitude(self, elapsed: F8) -> F8:
        """Return the amplitude in m at times ``elapsed`` (m,)."""
        return self.law.curve(elapsed, self.theta)[0]

    def position(self, elapsed: F8, tau: F8) -> F8:
        """Return the distances (m,) in m without level and linear columns, at given values of both time scales."""
        swing = self.amplitude(elapsed) * np.cos(self.angle(tau))
        return np.asarray(swing + self.values[-1] if self.constant else swing)

    def evaluate(self, elapsed: F8, tau: F8) -> tuple[F8, F8]:
        """Return the distances of :meth:`position` and their derivatives (m, q) by the values."""
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
    """Residuals of selected samples and their derivatives, with the linear columns projected out.

    Parameters
    ----------
    record : Record
    state : State
        Defines the parameters.
    rows : (n,) bool
        True for the selected samples.

    Attributes
    ----------
    residuals, jacobian : callable
        Functions of the values (q,): the residuals, model minus distance (m,) in m, and their derivatives (m, q).

    Notes
    -----
    The projector :math:`P = 1 - B(B^TB)^{-1}B^T` does not depend on the parameters. The residuals are therefore
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
        # A search evaluates the derivatives three times at its start and twice at its end.
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
    """Chooses the samples of one record that lie within the noise of its model and not on a clipped crest.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated : Demodulated
        Provides the flags and the noise of the windows.
    record : Record
        The same samples in the form that the fit uses.
    clip_sigmas : float
        Samples whose residuals exceed this many standard deviations are false echoes.

    Notes
    -----
    Samples and fit depend on each other. They are iterated with the linearised model, where a round costs one matrix
    product. The windows' values are close to the solution, so that the error of linearisation is far below the noise.
    """

    def __init__(self, conditioned: Conditioned, demodulated: Demodulated, record: Record, clip_sigmas: float) -> None:
        self._conditioned, self._record = conditioned, record
        self._noise_m, self._clip_sigmas = demodulated.noise_m, clip_sigmas
        errors = model_error(demodulated.amplitude, demodulated.decay, demodulated.angular_frequency)
        self._least_m = float(np.median(errors))
        usable = (conditioned.flags & UNUSABLE) == 0
        self.by_windows: Rows = usable & ((demodulated.flags & UNUSABLE) == 0)
        echo = (demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0
        # Samples excluded by a window's narrow spread or a neighbouring spike may return; those in clusters may not.
        run = np.convolve(echo, np.ones(3), "same") == 3
        cluster = np.convolve(run, np.ones(3), "same") > 0
        flagged = (conditioned.track.flags & UNUSABLE) != 0
        others = (demodulated.flags & UNUSABLE & ~np.uint8(Quality.FALSE_ECHO)) != 0
        self._candidates = (usable | (echo & ~flagged & ~others)) & ~cluster

    def settled(self, state: State, before: Rows) -> tuple[Rows, State]:
        """Return the samples (n,) that lie on the model fitted to them, and the fitted state, by linearisation.

        Both arguments are returned unchanged if the linearisation does not predict the model's residuals, because the
        state is too far from the solution, or if the law has a pole within the record.
        """
        record, rows = self._record, before
        with np.errstate(invalid="ignore", over="ignore"):  # a pole gives infinities, which are detected below
            position, slopes = state.evaluate(record.elapsed, record.tau)
        if not (np.isfinite(position).all() and np.isfinite(slopes).all()):
            return before, state
        left, slope = record.y - position, np.concatenate([slopes, record.basis], axis=1)
        normal, right = slope.T @ slope, slope.T @ left
        scale = _lengths(normal)
        units = np.outer(scale, scale)
        for _ in range(ROUNDS):
            # As few samples are excluded, their part is subtracted from the normal equations of the whole record.
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
        """Return the samples within the noise of a model with residuals ``left`` (n,) in m."""
        spread = mad_sigma(left[self._candidates])
        near = self._candidates
        if spread > 1.5 * self._noise_m:
            # The residuals contain more than noise, so that samples excluded so far remain excluded.
            return np.asarray(near & rows)
        return np.asarray(near & (np.abs(left) <= self._clip_sigmas * max(spread, self._least_m)))
