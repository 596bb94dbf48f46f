"""Windows: a record sliced into whole periods, the linear fit of all windows together, and the tuning of its basis."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import minimise
from pipeline.numerics.levels import FALSE_ALARM, normal_quantile
from pipeline.numerics.robust import median
from pipeline.samples.condition import Samples
from pipeline.track import F8

# Minimum determinant of the normal matrix per sample: 1/4 for a full period, and 0.003 as measured for samples within
# 0.29 of a period, where rest position and amplitude can hardly be distinguished.
LEAST_DETERMINANT = 0.003
# Minimum number of samples, twice that of the parameters. With three degrees of freedom the noise appears half as large
# as it is with a probability of 14 % (chi-square).
LEAST_SAMPLES = 6
# Further degrees of the smooth curves, for a frequency that falls with the amplitude as that of a wide pendulum does.
# One is taken if the mean squared residual falls below this factor of the lower degree's, which noise leaves at 1, and
# if the curve follows the phases to within this angle, rad. Up to 90 degrees are then right, as measured by `pytest
# tests/unit/pipeline/test_edges.py -k pendulum`.
FURTHER, LESS, FOLLOWED = (5, 8, 12), 0.5, 0.3
# Maximum detuning or decay, as a fraction of the frequency; beyond it the fit has failed. With 0.1, wrong windows bend
# the curves of one in 25 recordings, as measured by `python -m tests.golden`.
GREATEST = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class WindowSamples:
    """Samples laid out as (windows, longest window), padded with unusable ones."""

    rows: NDArray[np.int64]  # (w, l) index of each sample in the track
    # (w, l) true for measured samples at a time within reach of the window, usable or not; False for padding.
    placed: NDArray[np.bool_]
    usable: F8  # (w, l), 1 for samples that may be fitted, else 0
    y: F8  # (w, l) m, distance less ``level``; 0 for samples that are not placed
    tau: F8  # (w, l) s, time from the window's centre; 0 for samples that are not placed
    centre: F8  # (w,) s
    level: float  # m, level subtracted from all distances to avoid cancellation in sums
    # m, length that is negligible beside the motion; it replaces zero in divisions by a spread or an amplitude.
    tiny: float
    moved: F8 | float = 0.0  # (w, l) m, subtracted from y: the change of the rest position from the window's centre

    @classmethod
    def sliced(cls, samples: Samples, bounds: NDArray[np.int64]) -> WindowSamples:
        """Slice samples at sample indices (w + 1,)."""
        track, used = samples.track, samples.used
        lengths = np.diff(bounds)
        slots = np.arange(int(lengths.max()))
        inside = slots[None, :] < lengths[:, None]
        rows = np.minimum(bounds[:-1, None] + slots[None, :], bounds[-1] - 1)
        usable = used[rows] & inside
        t, y = track.t[rows], track.y[rows]
        level = median(track.y[used])
        tiny = 1e-12 * float(np.max(np.abs(track.y[used] - level))) + 1e-150
        centre = np.where(usable, t, 0.0).sum(axis=1) / np.maximum(usable.sum(axis=1), 1)
        # The middle of the whole window, not of its usable samples, so that centres are evenly spaced.
        middle = 0.5 * (track.t[bounds[:-1]] + track.t[bounds[1:] - 1])
        reach = float(np.ptp(track.t[used])) / lengths.size
        centre = np.where(np.abs(middle - centre) <= reach, middle, centre)
        tau = t - centre[:, None]
        placed = inside & np.isfinite(y) & (np.abs(tau) <= 2.0 * reach) | usable
        return cls(
            rows=rows,
            placed=placed,
            usable=usable.astype(np.float64),
            y=np.where(placed, y - level, 0.0),
            tau=np.where(placed, tau, 0.0),
            centre=centre,
            level=level,
            tiny=tiny,
        )

    def basis(self, angular_frequency: F8, decay: F8) -> F8:
        """Return (w, 4, l): rest position, decaying cosine, negative decaying sine, and the distances last."""
        rows = np.empty((self.y.shape[0], 4, self.y.shape[1]))
        angle = angular_frequency[:, None] * self.tau
        rows[:, 0] = 1.0
        np.cos(angle, out=rows[:, 1])
        np.negative(np.sin(angle, out=angle), out=rows[:, 2])
        rows[:, 3] = self.y
        return self.decaying(rows, decay) if decay.any() else rows

    def decaying(self, basis: F8, decay: F8) -> F8:
        """Multiply a basis without decay, in place, by the windows' decays (w,), 1/s, and return it."""
        basis[:, 1:3] *= np.exp(-decay[:, None] * self.tau)[:, None, :]
        return basis


@dataclass(frozen=True, slots=True, eq=False)
class WindowFits:
    """The fit of every window."""

    coefficients: F8  # (w, 3) m, rest position less level, and the coefficients a and b
    normal: F8  # (w, 3, 3) normal matrices: weighted sums of products of the basis functions
    residual: F8  # (w, l) m, residuals of all placed samples, fitted or not
    good: NDArray[np.bool_]  # (w,) true for windows with enough samples, well spread over the period
    weights: F8  # (w, l) weights of the samples in the fit

    @property
    def inverse(self) -> F8:
        """(w, 3, 3): inverse of the normal matrix; 0 where the window is not good."""
        inverse = np.zeros_like(self.normal)
        inverse[self.good] = np.linalg.inv(self.normal[self.good])
        return inverse

    @property
    def pair_variance(self) -> F8:
        """(w,): sum of the variances of a and b for samples of variance 1; 0 where the window is not good."""
        return np.asarray(np.trace(self.inverse[:, 1:, 1:], axis1=1, axis2=2))

    def put(
        self, rows: NDArray[np.int64], other: WindowFits, which: slice | NDArray[np.bool_] = slice(None)
    ) -> WindowFits:
        """Return these fits with some windows' replaced by selected ones of another solution."""
        changed = {each.name: getattr(self, each.name).copy() for each in fields(self)}
        for name, values in changed.items():
            values[rows] = getattr(other, name)[which]
        return WindowFits(**changed)


def solve(basis: F8, weights: F8) -> WindowFits:
    """Fit every window by weighted least squares, as a regression on two centred and nearly orthogonal columns.

    This takes a third of the time that ``numpy.linalg`` needs for determinants and inverses of 160 normal matrices.
    """
    sums = (basis[:, :3] * weights[:, None, :]) @ basis.transpose(0, 2, 1)
    count = np.maximum(sums[:, 0, 0], 1e-300)
    (_, c, s, y), (_, cc, cs, cy), (_, _, ss, sy) = sums.transpose(1, 2, 0) / count
    cc, cs, ss, cy, sy = cc - c * c, cs - c * s, ss - s * s, cy - c * y, sy - s * y
    determinant = cc * ss - cs * cs  # determinant of the normal matrix per sample
    good = (count >= LEAST_SAMPLES) & (determinant > LEAST_DETERMINANT)
    scale = good / np.where(good, determinant, 1.0)
    a, b = (ss * cy - cs * sy) * scale, (cc * sy - cs * cy) * scale
    coefficients = np.empty((len(sums), 3))
    coefficients[:, 0], coefficients[:, 1], coefficients[:, 2] = good * (y - a * c - b * s), a, b
    residual = basis[:, 3] - (coefficients[:, None, :] @ basis[:, :3])[:, 0]
    return WindowFits(coefficients, sums[:, :, :3], residual, good, weights)


def refit(basis: F8, solution: WindowFits, weights: F8) -> WindowFits:
    """Return a solution for new weights; windows with unchanged weights are not fitted again."""
    changed = np.flatnonzero((weights != solution.weights).any(axis=1))
    return solution.put(changed, solve(basis[changed], weights[changed])) if changed.size else solution


def quantile(size: F8, usable: F8, share: float) -> F8:
    """Return a quantile over the usable samples of each row (usable is 0 or 1); 0 for a row without any."""
    ordered = np.sort(np.where(usable > 0, size, np.inf), axis=1)
    counts = usable.sum(axis=1)
    rank = np.maximum(np.ceil(share * counts).astype(np.int64) - 1, 0)
    return np.where(counts > 0, ordered[np.arange(len(ordered)), rank], 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """Frequency and decay of the basis."""

    angular_frequency: float  # rad/s, angular frequency of the whole record
    turning: F8  # (w,) rad/s, angular frequency of each window
    decay: F8  # (w,) 1/s, logarithmic decay rate in each window
    # phase, amplitude: (w,), values, at every window's centre, of smooth curves through the windows whose phase is
    # significant.
    phase: F8 | None = None
    amplitude: F8 | None = None

    @classmethod
    def constant(cls, angular_frequency: float, windows: int, decay: float = 0.0) -> Tuning:
        """Return a tuning with one frequency and one decay for all windows."""
        return cls(angular_frequency, np.full(windows, angular_frequency), np.full(windows, decay))


def retune(windows: WindowSamples, solution: WindowFits, omega: float, *, degree: int = 3) -> Tuning:
    """Return the tuning that follows from the phases and amplitudes of a fit."""
    if np.count_nonzero(solution.good) < 3:
        return _retune_short(windows, omega)
    z = solution.coefficients[:, 1] + 1j * solution.coefficients[:, 2]
    size = np.abs(z)
    good = solution.good & (size > normal_quantile(1.0 - FALSE_ALARM) * _u_amplitude(windows, solution))
    if np.count_nonzero(good) < 3:
        good = solution.good
    t, weight = windows.centre[good], np.maximum(size[good], 1e-6 * np.max(size[good]) + windows.tiny)
    phase = unwrap(np.angle(z[good]), t, omega) - omega * (t - t[0])
    span = float(np.ptp(t))
    place = 2.0 * (windows.centre - t[0]) / span - 1.0
    inside = np.clip(place, -1.0, 1.0)
    seen = np.stack([np.log(weight), phase], axis=1) * weight[:, None]
    best, clear = math.inf, FOLLOWED**2 * float(weight @ weight) / t.size
    for trial in (degree, *(FURTHER if degree > 1 else ())):
        order = min(trial, max(1, t.size // 6))
        columns = np.polynomial.chebyshev.chebvander(inside, order)
        found = np.linalg.lstsq(columns[good] * weight[:, None], seen, rcond=None)[0]
        missed = columns[good] @ found[:, 1] * weight - seen[:, 1]
        left = float(missed @ missed) / max(t.size - order - 1, 1)
        if trial == degree or left < min(LESS * best, clear):
            best, powers, curves = left, columns, found
    degree = powers.shape[1] - 1
    level, smooth = (powers @ curves).T
    growth, turning = (powers[:, :degree] @ np.polynomial.chebyshev.chebder(curves)).T * (2.0 / span)
    # Outside the windows with a significant phase, both curves are continued as straight lines.
    beyond = 0.5 * span * (place - inside)
    mean = float(turning[good] @ weight**2 / (weight @ weight))
    bound = GREATEST * omega
    return Tuning(
        omega + mean,
        omega + mean + np.clip(turning - mean, -bound, bound),
        np.clip(-growth, -bound, bound),
        smooth + turning * beyond + omega * (windows.centre - t[0]),
        np.exp(level + np.minimum(growth, 0.0) * beyond),
    )


def _u_amplitude(windows: WindowSamples, solution: WindowFits) -> F8:
    """Return the standard uncertainty of each window's amplitude, m, for the record's typical noise."""
    counts = np.maximum(windows.usable.sum(axis=1), 4.0)
    squares = np.einsum("wl,wl,wl->w", windows.usable, solution.residual, solution.residual) / (counts - 3.0)
    return np.asarray(np.sqrt(0.5 * median(squares[solution.good]) * solution.pair_variance))


def _retune_short(windows: WindowSamples, omega: float) -> Tuning:
    """Return the tuning of a record with fewer than three good windows, from all its samples together.

    The spectrum of so few periods gives the frequency to a tenth only, which is too inaccurate for a window's phase.
    Frequency and decay are searched; rest position and amplitudes are solved for at each trial (variable projection).
    """
    inside = windows.usable > 0
    if np.count_nonzero(inside) <= 5:  # rest position, two amplitudes, frequency and decay
        return Tuning.constant(omega, len(windows.y))
    t, y = (windows.tau + windows.centre[:, None])[inside], windows.y[inside]
    tau = t - t.mean()

    def left(trial: F8) -> F8:
        angle, fall = omega * trial[0] * tau, np.exp(-np.clip(trial[1], -0.2, 0.2) * omega * tau)
        columns = np.stack([np.ones_like(tau), fall * np.cos(angle), fall * np.sin(angle)], axis=1)
        return np.asarray(y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0])

    fit = minimise(left, [1.0, 0.0])
    turning, decay = fit.values if 0.5 < fit.values[0] < 2.0 else (1.0, 0.0)
    return Tuning.constant(omega * float(turning), len(windows.y), omega * float(np.clip(decay, -0.2, 0.2)))


def unwrap(angle: F8, t: F8, omega: float) -> F8:
    """Return the total phase: the angle plus the full turns between the windows, as predicted by ``omega``."""
    rotating = omega * (t - t[0])
    return np.asarray(np.unwrap(angle - rotating) + rotating)
