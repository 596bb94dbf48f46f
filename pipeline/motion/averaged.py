"""The motion averaged over cycles: rest position, amplitude by a law, and phase, fitted to windows or to samples.

The motion is :math:`y = r + A(t; \\theta)\\cos(\\varphi + \\omega\\tau + \\sum_n\\kappa_n B_n(t) - \\ell(t))`, with
:math:`\\tau` from the middle of the record, where frequency and phase are uncorrelated, and the integrals :math:`B_n`
of the terms by which the frequency changes. The windows give points of amplitude, phase and rest position, which
determine the three parts independently of each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import Law
from pipeline.damping.select import Damping
from pipeline.modes.mode import Modes
from pipeline.motion.fitted import Method, Oscillation, Phase, RestPosition, Waveform, delay, wrapped
from pipeline.motion.frequency import TABLE_POINTS, Phases, TimeTable, amplitude_table, find_bend, turns
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_CURVE, VERY_STRONG
from pipeline.numerics.regression import Line, Scatter, chi2_quantile, correlation_length, scatter, smooth_curve
from pipeline.track import F8
from pipeline.windows.demodulate import ROUNDING, Windows

# Nodes of the quadrature of the decay rate over amplitudes, exact up to the power 15 (the same book, (1984)).
NODES = 8
# Maximum lag in rad by averaging (Bogoliubov and Mitropolsky (1961)): that of friction which halves the amplitude
# within one radian.
MOST_LAG = 0.75


@dataclass(frozen=True, slots=True, eq=False)
class Averaged:
    """The model of samples: parameters of the law, of the phase, and coefficients of the rest position."""

    law: Law
    t0: float  # the law's amplitude is constant before this time, s
    last: float  # and after this
    middle: float
    reach: float  # largest distance of a sample from the middle, s
    degree: int  # of the polynomial of the rest position
    tables: tuple[TimeTable, ...]  # of the change of the frequency
    lag: TimeTable | None

    def split(self, values: F8) -> tuple[F8, F8, F8]:
        """Return the parameters of law, phase and rest position."""
        first = len(self.law.parameters)
        second = first + 2 + len(self.tables)
        return values[:first], values[first:second], values[second:]

    def rest(self, t: F8) -> F8:
        """Return the columns (n, degree + 1) of the rest position."""
        return np.asarray(np.polynomial.legendre.legvander((t - self.middle) / self.reach, self.degree))

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the positions (n,) at t, and a function that gives their derivatives (n, p)."""
        theta, turning, still = self.split(values)
        amplitude, by_theta = self.law.curve(np.clip(t, self.t0, self.last) - self.t0, theta)
        columns, rest = turns(t, self.middle, self.tables), self.rest(t)
        angle = columns @ turning - delay(t, self.lag)
        cosine = np.cos(angle)

        def slopes() -> F8:
            rows = np.empty((values.size, t.size))
            first, second = theta.size, theta.size + turning.size
            np.multiply(by_theta.T, cosine, out=rows[:first])
            np.multiply(columns.T, -amplitude * np.sin(angle), out=rows[first:second])
            rows[second:] = rest.T
            return rows.T

        return amplitude * cosine + rest @ still, slopes


def fit_windows(windows: Windows, modes: Modes, damping: Damping) -> Oscillation:
    """Fit phase and rest position to the windows, whose amplitudes gave the laws."""
    track = modes.samples.track
    phase = fit_phase(windows, damping, float(np.max(track.t[windows.used])))
    return assembled(windows, modes, damping, phase, fit_rest(windows, track.unit), "windows")


def assembled(
    windows: Windows, modes: Modes, damping: Damping, phase: Phase, rest: RestPosition, method: Method
) -> Oscillation:
    """Return the fitted oscillation with its waveform: rest position, amplitude and phase at every sample."""
    track = modes.samples.track
    used = windows.used
    # A law is valid only where it was fitted: before the first and after the last sample used it is held constant.
    last, best = float(np.max(track.t[used])), damping.best
    amplitude = best.amplitude(np.clip(track.t, damping.t0, last) - damping.t0)
    angle = phase.total(track.t)
    position = rest.at(track.t) + amplitude * np.cos(angle)
    residual = track.y - position
    rms = math.sqrt(float(np.mean(residual[used] ** 2)))
    whole = position if modes.subtracted is None else position + modes.subtracted
    waveform = Waveform(whole, partial(_velocity, best, phase, amplitude, track.t, angle), residual, rms)
    return Oscillation(windows, modes, damping, phase, rest, waveform, method)


def _velocity(best: LawFit, phase: Phase, amplitude: F8, t: F8, angle: F8) -> F8:
    growth = best.law.rate(amplitude, best.joint.values)
    return np.asarray(growth * np.cos(angle) - amplitude * phase.rate(amplitude, t) * np.sin(angle))


def fit_phase(windows: Windows, damping: Damping, last: float) -> Phase:
    """Fit a constant frequency to the windows' phases and test it against those that change.

    The reported frequency is the record's mean, whether or not the frequency varies. If the residuals of the straight
    line are not white, its covariance is widened, so that the interval covers a curvature of the phase. The delay of a
    period's fitted sinusoid (:func:`lag_of`) follows from the damping law and is removed first.
    """
    t, t0 = windows.t, damping.t0
    noise = np.maximum(np.sqrt(windows.covariance[:, 1, 1]), ROUNDING)
    if t.size < 2:
        return _single(windows, t0, float(noise[0]))
    lag = lag_of(damping.best, t0, windows)
    phase = windows.phase + delay(t, lag)
    spread = scatter(t, phase - windows.angular_frequency * (t - t[0]), noise)
    kept = spread.kept
    u = spread.u[kept]
    middle = float(np.average(t[kept], weights=1.0 / u**2))
    phases = Phases(t, phase, spread, t0, middle)
    bend, small, best = None, None, damping.best
    model = straight = phases.fit()
    if u.size >= FEWEST_FOR_CURVE:
        amplitude = amplitude_table(best.law, best.joint.values, t0, last)
        bent = find_bend(phases, straight, amplitude, decays=len(best.law.parameters) > 1)
        bend, model, small = bent or (None, straight, None)
    widened, length = _widening(straight, u, spread)
    covariance = straight.covariance * widened
    first = np.array([t0])
    tables = () if bend is None else bend.tables
    at_start = float((turns(first, middle, tables) @ model.values - delay(first, lag))[0])
    start, free = turns(first, middle, ())[0], max(u.size - model.values.size, 1)
    return Phase(
        t0=t0,
        angular_frequency=Estimate(float(straight.values[1]), math.sqrt(covariance[1, 1]), "rad/s"),
        phase=Estimate(wrapped(at_start), math.sqrt(float(start @ covariance @ start)), "rad"),
        reduced_chi2=model.chi2 / free,
        correlation=length,
        residual=phase - turns(t, middle, ()) @ straight.values,
        coefficients=model.values,
        middle=middle,
        bend=bend,
        lag=lag,
        small_swings=small,
        spread=spread,
    )


def _single(windows: Windows, t0: float, noise: float) -> Phase:
    """Return the phase of a single window: its frequency is that of the spectrum, uncertain by half a line width."""
    t, omega, own = float(windows.t[0]), windows.angular_frequency, float(windows.phase[0])
    return Phase(
        t0=t0,
        angular_frequency=Estimate(omega, math.pi / max(2.0 * (t - t0), 1e-9), "rad/s"),
        phase=Estimate(wrapped(own + omega * (t0 - t)), math.hypot(noise, 0.5 * math.pi), "rad"),
        reduced_chi2=math.nan,
        correlation=1.0,
        residual=np.zeros(1),
        coefficients=np.array([own, omega]),
        middle=t,
    )


def _widening(line: Line, u: F8, spread: Scatter) -> tuple[float, float]:
    """Return the factor that widens the straight line's covariance, and the correlation length used for it."""
    free = line.residual.size - 2
    if free < 1:
        return 1.0, 1.0
    length = max(correlation_length(line.residual / u), spread.correlation)
    too_large = line.chi2 > chi2_quantile(1.0 - FALSE_ALARM, free)
    return length * (line.chi2 / free if too_large else 1.0), length


def lag_of(fit: LawFit, t0: float, windows: Windows) -> TimeTable | None:
    """Return the delays in rad that drag causes in a period's fitted sinusoid; None if they are constant.

    Drag acts mainly while the bob is fast. A period is therefore not exactly sinusoidal, and the first harmonic of its
    exact waveform lags behind a phase that advances at a constant rate. To first order, averaging gives the lag
    :math:`\\frac{n + 3}{2(n + 1)}\\frac{r}{\\omega A} = (\\frac12 + \\frac1{n + 1})\\frac{r}{\\omega A}` for a force
    :math:`\\propto v^n`. For any sum of powers it is therefore

    .. math:: \\frac{1}{\\omega A}\\Bigl(\\frac{r(A)}{2} + \\frac1A\\int_0^A r(a)\\,da\\Bigr).

    For friction the lag is :math:`3\\delta/\\pi A`, where :math:`2\\delta` is the loss of amplitude per half-cycle.
    Near the stop the formula fails; the lag is limited to its value where half of the amplitude is lost per radian.
    """
    t = np.linspace(t0, max(float(np.max(windows.t)), t0 + 1e-9), TABLE_POINTS)
    amplitude = np.abs(fit.amplitude(t - t0))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    below = amplitude[:, None] * 0.5 * (nodes + 1.0)
    theta = fit.joint.values
    with np.errstate(all="ignore"):
        rate = -fit.law.rate(amplitude, theta)
        mean = -0.5 * fit.law.rate(below.ravel(), theta).reshape(below.shape) @ weights
        lag = (0.5 * rate + mean) / (windows.angular_frequency * amplitude)
    lag = np.clip(np.where(np.isfinite(lag), lag, 0.0), -MOST_LAG, MOST_LAG)
    return (t, lag) if float(np.ptp(lag)) > 1e-12 else None


def fit_rest(windows: Windows, unit: str) -> RestPosition:
    """Fit a constant and a polynomial to the windows' rest positions, and decide by BIC whether they drift."""
    t, offset = windows.t, windows.offset
    u = np.maximum(np.sqrt(windows.covariance[:, 2, 2]), 1e-15 * float(np.max(np.abs(offset))) + 1e-100)
    spread = scatter(t, offset, u)
    curve, gain = smooth_curve(t, offset, spread)
    weight = 1.0 / spread.u[spread.kept]
    mean = float(np.average(offset[spread.kept], weights=weight**2))
    left = (offset[spread.kept] - mean) * weight
    widened = max(spread.correlation, correlation_length(left)) * max(1.0, float(left @ left) / max(left.size - 1, 1))
    estimate = Estimate(mean, math.sqrt(widened / float(weight @ weight)), unit)
    half_s = 0.5 * np.diff(t[[0, -1]]) / max(t.size - 1, 1)
    ends = np.concatenate([t[:1] - half_s, t[-1:] + half_s])
    return RestPosition(estimate, curve.convert(domain=ends), float(np.ptp(curve(t))), gain > VERY_STRONG, spread)


def typical_miss(fitted: Oscillation) -> float:
    """Return the median difference of windows from the fitted oscillation, over their amplitudes, weighted by these.

    Amplitude and phase of a window form a phasor, which is compared with the one that the fit predicts.
    """
    windows, phase = fitted.windows, fitted.phase
    expected = fitted.damping.best.amplitude(windows.t - phase.t0) * np.exp(1j * phase.total(windows.t))
    own = windows.amplitude * np.exp(1j * windows.phase)
    size = np.abs(own)
    missed = np.abs(own - expected) / np.maximum(size, 1e-12 * float(size.max()))
    order = np.argsort(missed)
    middle = int(np.searchsorted(np.cumsum(size[order]), 0.5 * float(size.sum())))
    return float(missed[order][middle])
