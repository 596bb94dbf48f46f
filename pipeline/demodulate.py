"""Demodulate: amplitude, phase, rest position and noise against time, window by window, with covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.condition import MAD_TO_SIGMA, Conditioned
from pipeline.cycles import Cycles
from pipeline.errors import AnalysisError
from pipeline.track import F8, U8, Quality

__all__ = ["Demodulated", "Params", "demodulate"]

THIRD_TO_SIGMA = 0.3853204664075677  # 0.3-quantile of |x| for a standard normal x


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`demodulate`.

    Parameters
    ----------
    clip_sigmas : float
        Residuals beyond this many standard deviations are false echoes and leave the fit.
    rounds : int
        Reweighted fits of windows that hold false echoes, before the final ones.
    """

    clip_sigmas: float = 4.0
    rounds: int = 4


@dataclass(frozen=True, slots=True, eq=False)
class Demodulated:
    """The oscillation in windows of one period: what every later stage works on.

    In window j the motion is :math:`o_j + A_j e^{-g\\tau}\\cos(\\omega\\tau + \\varphi_j)`, with :math:`\\tau`
    counted from the window's centre.

    Parameters
    ----------
    t : (w,) float64, s
        Centres of the windows.
    amplitude, phase, offset : (w,) float64, m, rad, m
        The phase is unwrapped, as the total phase of the oscillation at the centre.
    noise : (w,) float64, m
        Standard deviation of the samples about the fit, each window by itself.
    covariance : (w, 3, 3) float64
        Of (amplitude, phase, offset); windows share no sample, so they are independent of each other.
    count : (w,) int64
        Samples that the fit used.
    angular_frequency : float, rad/s
        Of the basis.
    decay : (w,) float64, 1/s
        g of the basis.
    residual : (n,) float64, m
        Every sample less its window's fit; NaN outside all windows and where unmeasured.
    flags : (n,) uint8
        The conditioned flags and the false echoes found here.
    lost : int
        Windows with too few usable samples, which carry no point.
    """

    t: F8
    amplitude: F8
    phase: F8
    offset: F8
    noise: F8
    covariance: F8
    count: NDArray[np.int64]
    angular_frequency: float
    decay: F8
    residual: F8
    flags: U8
    lost: int

    @property
    def noise_m(self) -> float:
        """Standard deviation of one sample over the whole record, m."""
        dof = np.maximum(self.count - 3, 1)
        return float(math.sqrt(np.sum(dof * self.noise**2) / np.sum(dof)))


def demodulate(conditioned: Conditioned, cycles: Cycles, params: Params | None = None) -> Demodulated:
    """Fit rest position, amplitude and phase in every window, robustly.

    Parameters
    ----------
    conditioned : Conditioned
    cycles : Cycles
    params : Params, optional

    Returns
    -------
    Demodulated

    Raises
    ------
    AnalysisError
        If no window holds enough usable samples.

    Notes
    -----
    Every window is a linear least-squares problem in :math:`(o, a, b)` of
    :math:`o + e^{-g\\tau}(a\\cos\\omega\\tau - b\\sin\\omega\\tau)`, all solved at once. False echoes come in clusters
    that move with the bob, a fifth of a period long and more, so the first fit of a window may be pulled by them:
    weights of Cauchy's form with a scale that shrinks from round to round let go of them, windows that disagree with
    their neighbours start again from these, then residuals beyond ``clip_sigmas`` leave the fit for good. Without
    :math:`g`, which a second pass knows for each window, the conjugate line would bias the amplitude by
    :math:`g/2\\omega` of itself.
    """
    params = params or Params()
    windows = _Windows.cut(conditioned, cycles.bounds)
    omega = 2.0 * math.pi * cycles.frequency_hz
    decay = np.zeros(len(windows.y))
    basis = _basis(windows, omega, decay)
    solution = _robust_start(windows, basis, conditioned.noise_m, params)
    solution = _rescue(windows, basis, solution, omega, params)
    solution, weights = _clip(windows, basis, solution, params)
    omega, decay = _retune(windows, solution, omega, decay)
    # Once more in a basis that turns and decays as the record does.
    basis = _basis(windows, omega, decay)
    solution, weights = _clip(windows, basis, _solve(windows, basis, weights), params)
    return _finish(conditioned, windows, solution, weights, omega, decay)


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """Samples laid out as (windows, longest window), padded with unusable ones."""

    rows: NDArray[np.int64]
    inside: NDArray[np.bool_]
    usable: F8
    y: F8
    tau: F8
    centre: F8
    level: float

    @classmethod
    def cut(cls, conditioned: Conditioned, bounds: NDArray[np.int64]) -> _Windows:
        track = conditioned.track
        lengths = np.diff(bounds)
        slots = np.arange(int(lengths.max()))
        inside = slots[None, :] < lengths[:, None]
        rows = np.minimum(bounds[:-1, None] + slots[None, :], bounds[-1] - 1)
        usable = conditioned.used[rows] & inside
        level = float(np.median(track.y[conditioned.used]))
        y = np.where(usable, track.y[rows] - level, 0.0)
        t = np.where(usable, track.t[rows], 0.0)
        counts = np.maximum(usable.sum(axis=1), 1)
        centre = t.sum(axis=1) / counts
        # The middle of the window, not of its usable samples, so that centres stay one period apart.
        ends = track.t[[bounds[:-1], bounds[1:] - 1]]
        middle = 0.5 * (ends[0] + ends[1])
        reach = np.ptp(track.t[conditioned.used])
        centre = np.where(np.abs(middle - centre) <= reach / max(len(lengths), 1), middle, centre)
        return cls(
            rows, inside, usable.astype(np.float64), y, np.where(usable, t - centre[:, None], 0.0), centre, level
        )

    def take(self, some: NDArray[np.int64]) -> _Windows:
        """Return some of the windows."""
        return _Windows(
            self.rows[some],
            self.inside[some],
            self.usable[some],
            self.y[some],
            self.tau[some],
            self.centre[some],
            self.level,
        )


def _basis(windows: _Windows, omega: float, decay: F8) -> F8:
    """(w, 4, l): rest position, decaying cosine and minus sine, and below them the distances themselves."""
    rows = np.empty((windows.y.shape[0], 4, windows.y.shape[1]))
    angle = omega * windows.tau
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
class _Solution:
    coefficients: F8  # (w, 3): offset, a, b
    inverse: F8  # (w, 3, 3): of the normal matrix
    residual: F8  # (w, l)
    good: NDArray[np.bool_]  # (w,): enough samples, well spread over the period

    def replaced(self, rows: NDArray[np.int64], other: _Solution, which: NDArray[np.bool_]) -> _Solution:
        """Return this solution with some windows taken from another."""
        parts = (self.coefficients.copy(), self.inverse.copy(), self.residual.copy(), self.good.copy())
        for mine, theirs in zip(parts, (other.coefficients, other.inverse, other.residual, other.good), strict=True):
            mine[rows] = theirs[which]
        return _Solution(*parts)


def _solve(windows: _Windows, basis: F8, weights: F8) -> _Solution:
    sums = (basis[:, :3] * weights[:, None, :]) @ basis.transpose(0, 2, 1)
    count = np.maximum(sums[:, 0, 0], 1e-300)
    # Divided by the count: 1, m, n, p, q, r are the upper triangle row by row.
    (m, n, p, q, r), right = _halves(sums / count[:, None, None])
    adjugate = np.array(
        [
            [p * r - q * q, q * n - m * r, m * q - n * p],
            [q * n - m * r, r - n * n, m * n - q],
            [m * q - n * p, m * n - q, p - m * m],
        ]
    )
    determinant = adjugate[0, 0] + m * adjugate[0, 1] + n * adjugate[0, 2]
    good = (count >= 6.0) & (determinant > LEAST_DETERMINANT)
    adjugate /= np.where(good, determinant, np.inf)
    coefficients = np.einsum("ijw,jw->wi", adjugate, right)
    inverse = adjugate.transpose(2, 0, 1) / count[:, None, None]
    offset, a, b = coefficients.T[:, :, None]
    residual = windows.y - offset - a * basis[:, 1] - b * basis[:, 2]
    return _Solution(coefficients, inverse, residual, good)


def _halves(sums: F8) -> tuple[F8, F8]:
    """Upper triangle of the normal matrices less its first entry (5, w), and right-hand sides (3, w)."""
    return sums[:, (0, 0, 1, 1, 2), (1, 2, 1, 2, 2)].T, sums[:, :, 3].T


def _robust_start(windows: _Windows, basis: F8, noise_m: float, params: Params) -> _Solution:
    """Fit every window, those that scatter more than the rest with weights that let go of clusters of echoes."""
    solution = _solve(windows, basis, windows.usable)
    spread = MAD_TO_SIGMA * _ranked(np.abs(solution.residual), windows.usable, 0.5)
    odd = np.flatnonzero(
        spread > 1.3 * max(noise_m, float(np.median(spread[solution.good] if solution.good.any() else 0.0)))
    )
    if not odd.size:
        return solution
    some, part = windows.take(odd), basis[odd]
    size, spread = np.abs(solution.residual[odd]), spread[odd]
    for _ in range(params.rounds):
        ratio = size / np.maximum(spread, noise_m + 1e-300)[:, None]
        trial = _solve(some, part, some.usable / (1.0 + ratio**2) ** 2)
        size = np.abs(trial.residual)
        spread = MAD_TO_SIGMA * _ranked(size, some.usable, 0.5)
    return solution.replaced(odd, trial, np.ones(odd.size, np.bool_))


def _rescue(windows: _Windows, basis: F8, solution: _Solution, omega: float, params: Params) -> _Solution:
    """Fit windows that disagree with their neighbours again, starting from what the neighbours predict.

    Where false echoes hold half of a window its own fit may have settled on them; the amplitude, phase and rest
    position of the windows around it tell which half to believe.
    """
    n = len(windows.y)
    if n < 5:
        return solution
    z = solution.coefficients[:, 1] + 1j * solution.coefficients[:, 2]
    # Turned back to one instant, so that medians are taken of slow quantities.
    turning = np.exp(1j * omega * (windows.centre - windows.centre[0]))
    steady = z / turning
    around = _neighbours(n)
    expected = np.empty_like(solution.coefficients)
    expected[:, 0] = np.median(solution.coefficients[around, 0], axis=1)
    smooth = (np.median(steady.real[around], axis=1) + 1j * np.median(steady.imag[around], axis=1)) * turning
    expected[:, 1], expected[:, 2] = smooth.real, smooth.imag
    away = np.abs(solution.coefficients - expected).max(axis=1)
    level = _level(windows, solution)
    bound = params.clip_sigmas * level
    before = np.sum((np.abs(solution.residual) <= bound) * windows.usable, axis=1)
    few = before < 0.7 * windows.usable.sum(axis=1)
    odd = np.flatnonzero((away > 5.0 * MAD_TO_SIGMA * float(np.median(away))) | few | ~solution.good)
    if not odd.size:
        return solution
    some, part = windows.take(odd), basis[odd]
    size = np.abs(some.y - (expected[odd, None, :] @ part[:, :3])[:, 0, :])
    for _ in range(params.rounds):
        # A third of the samples is believed at first, so that echoes may hold more than half of a window.
        spread = np.maximum(_ranked(size, some.usable, 0.3) / THIRD_TO_SIGMA, level)
        trial = _solve(some, part, some.usable / (1.0 + (size / spread[:, None]) ** 2) ** 2)
        size = np.abs(trial.residual)
    after = np.sum((size <= bound) * some.usable, axis=1)
    better = trial.good & ((after > before[odd]) | ~solution.good[odd])
    return solution.replaced(odd[better], trial, better)


def _neighbours(n: int) -> NDArray[np.int64]:
    """(n, 6 or fewer): the nearest other windows of each, one-sided at the record's ends."""
    reach = min(7, n)
    first = np.clip(np.arange(n) - reach // 2, 0, n - reach)
    block = first[:, None] + np.arange(reach)
    others: NDArray[np.int64] = block[block != np.arange(n)[:, None]].reshape(n, reach - 1)
    return others


def _level(windows: _Windows, solution: _Solution) -> float:
    """Spread of the samples about their windows' fits, typical of the record."""
    spread = MAD_TO_SIGMA * _ranked(np.abs(solution.residual), windows.usable, 0.5)
    return max(float(np.median(spread[solution.good])), 1e-300) if solution.good.any() else 1e-300


def _ranked(size: F8, usable: F8, share: float) -> F8:
    """Quantile over the usable samples of each row (usable is 0 or 1); 0 for a row without any."""
    ordered = np.sort(np.where(usable > 0, size, np.inf), axis=1)
    counts = usable.sum(axis=1)
    rank = np.maximum(np.ceil(share * counts).astype(np.int64) - 1, 0)
    return np.where(counts > 0, ordered[np.arange(len(ordered)), rank], 0.0)


def _clip(windows: _Windows, basis: F8, solution: _Solution, params: Params) -> tuple[_Solution, F8]:
    """Take residuals beyond the clip out and fit again."""
    size = np.abs(solution.residual)
    spread = MAD_TO_SIGMA * _ranked(size, windows.usable, 0.5)
    level = max(float(np.median(spread[solution.good])) if solution.good.any() else 0.0, 1e-300)
    # One window's spread says little, and a cluster of echoes widens it: it is held near the record's.
    bound = params.clip_sigmas * np.clip(spread, 0.5 * level, 2.0 * level)
    weights = np.where(size <= bound[:, None], windows.usable, 0.0)
    return _solve(windows, basis, weights), weights


def _retune(windows: _Windows, solution: _Solution, omega: float, decay: F8) -> tuple[float, F8]:
    """Frequency of the record and logarithmic decay in each window, as phases and amplitudes show them."""
    good = solution.good
    count = int(np.count_nonzero(good))
    if count < 3:
        return _retune_short(windows, omega, decay)
    z = solution.coefficients[good, 1] + 1j * solution.coefficients[good, 2]
    t, weight = windows.centre[good], np.maximum(np.abs(z), 1e-300)
    phase = _unwrap(np.angle(z), t, omega) - omega * t
    centred = t - np.average(t, weights=weight**2)
    slope = np.sum(weight**2 * centred * phase) / np.sum(weight**2 * centred**2)
    # The decay of drag varies along the record; a cubic through the logarithms follows it.
    span = float(np.ptp(t))
    x = 2.0 * (t - t[0]) / span - 1.0
    degree = min(3, max(1, count // 6))
    curve = np.polynomial.Chebyshev(np.polynomial.chebyshev.chebfit(x, np.log(weight), degree, w=weight))
    everywhere = 2.0 * (windows.centre - t[0]) / span - 1.0
    rate = -curve.deriv()(np.clip(everywhere, -1.0, 1.0)) * 2.0 / span
    return omega + float(slope), np.clip(rate, -0.05 * omega, 0.05 * omega)


def _retune_short(windows: _Windows, omega: float, decay: F8, rounds: int = 12) -> tuple[float, F8]:
    """The same for a record of one or two windows: Gauss-Newton on all its samples together.

    The spectrum of so few periods places the frequency to a tenth of itself only, too far off for one window's phase.
    """
    inside = windows.usable > 0
    t = (windows.tau + windows.centre[:, None])[inside]
    y = windows.y[inside]
    tau = t - t.mean()
    rate = 0.0
    for _ in range(rounds):
        fall = np.exp(-rate * tau)
        cosine, sine = fall * np.cos(omega * tau), fall * np.sin(omega * tau)
        linear = np.stack([np.ones_like(tau), cosine, -sine], axis=1)
        _, a, b = np.linalg.lstsq(linear, y, rcond=None)[0]
        by_omega, by_rate = -tau * (a * sine + b * cosine), -tau * (a * cosine - b * sine)
        full = np.concatenate([linear, by_omega[:, None], by_rate[:, None]], axis=1)
        step = np.linalg.lstsq(full, y, rcond=None)[0]
        # A fifth of itself a round at most: the start is off, not wrong.
        omega += float(np.clip(step[3], -0.2 * omega, 0.2 * omega))
        rate = float(np.clip(rate + step[4], -0.2 * omega, 0.2 * omega))
        if abs(step[3]) < 1e-9 * omega:
            break
    return omega, np.full_like(decay, rate)


def _unwrap(angle: F8, t: F8, omega: float) -> F8:
    """Total phase: the angle plus the turns that ``omega`` says lie between the windows."""
    rotating = omega * (t - t[0])
    return np.asarray(np.unwrap(angle - rotating) + rotating)


def _finish(
    conditioned: Conditioned, windows: _Windows, solution: _Solution, weights: F8, omega: float, decay: F8
) -> Demodulated:
    good = solution.good
    if not good.any():
        raise AnalysisError(
            "no period of the record holds enough usable samples for a fit; see the counts of flagged samples"
        )
    counts = (weights > 0).sum(axis=1)
    squares = np.sum(weights * solution.residual**2, axis=1)
    noise = np.sqrt(squares / np.maximum(counts - 3, 1))
    pooled = math.sqrt(np.sum(squares[good]) / max(np.sum(counts[good] - 3), 1))
    # A window's own noise is known to a tenth only: it is drawn towards the record's.
    prior = 30.0
    shrunk = (prior * pooled**2 + counts * noise**2) / (prior + counts)
    offset, a, b = solution.coefficients[good].T
    amplitude = np.hypot(a, b)
    safe = np.maximum(amplitude, 1e-300)
    jacobian = np.zeros((amplitude.size, 3, 3))
    jacobian[:, 0, 1], jacobian[:, 0, 2] = a / safe, b / safe
    jacobian[:, 1, 1], jacobian[:, 1, 2] = -b / safe**2, a / safe**2
    jacobian[:, 2, 0] = 1.0
    covariance = jacobian @ (solution.inverse[good] * shrunk[good, None, None]) @ jacobian.transpose(0, 2, 1)
    flags = conditioned.flags.copy()
    inside = windows.inside & good[:, None]
    echoes = inside & (windows.usable > 0) & (weights == 0)
    flags[windows.rows[echoes]] |= np.uint8(Quality.FALSE_ECHO)
    residual = _residual_of_all(conditioned, windows, solution, omega)
    t = windows.centre[good]
    return Demodulated(
        t,
        amplitude,
        _unwrap(np.arctan2(b, a), t, omega),
        offset + windows.level,
        noise[good],
        covariance,
        counts[good],
        omega,
        decay[good],
        residual,
        flags,
        int(np.count_nonzero(~good)),
    )


def _residual_of_all(conditioned: Conditioned, windows: _Windows, solution: _Solution, omega: float) -> F8:
    """Residuals of flagged samples too, so that a report can show what was left out."""
    residual = np.full(len(conditioned.track), np.nan)
    known = windows.inside & (windows.usable > 0) & solution.good[:, None]
    residual[windows.rows[known]] = solution.residual[known]
    track = conditioned.track
    window = np.searchsorted(windows.rows[:, 0], np.arange(len(track)), side="right") - 1
    left = np.flatnonzero(np.isnan(residual) & np.isfinite(track.y) & np.isfinite(track.t) & (window >= 0))
    left = left[solution.good[window[left]]]
    if left.size:
        w = window[left]
        tau = track.t[left] - windows.centre[w]
        offset, a, b = solution.coefficients[w].T
        residual[left] = track.y[left] - windows.level - offset - a * np.cos(omega * tau) + b * np.sin(omega * tau)
    return residual
