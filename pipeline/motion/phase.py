"""Phase: the oscillation's frequency, and whether it depends on amplitude."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.damping.law_fit import LawFit
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.quantity import Unit
from pipeline.numerics.regression import Line, Scatter, chi2_quantile, correlation_length, scatter, solve_weighted
from pipeline.track import F8
from pipeline.windows.demodulate import ROUNDING, Demodulated

BACKBONE = Unit(-2, -1, radian=1)  # of the coefficient by which the frequency depends on the squared amplitude
TABLE = 2049  # number of points in the tables of the lag and of the integral of the amplitude
MOST_LAG = 0.75  # maximum lag in rad, that of friction which halves the amplitude within one radian
NODES = 8  # nodes of the quadrature of the decay rate over amplitudes; exact for friction, linear and quadratic drag
# Minimum decrease of the BIC for the frequency to count as amplitude-dependent; 10 is "very strong" evidence.
EVIDENCE = 10.0
REJECTION = 1e-3  # probability that the chi-square test rejects residuals that are only noise


@dataclass(frozen=True, slots=True, eq=False)
class PhaseFit:
    """Total phase against time.

    Parameters
    ----------
    t0 : float
        Time of the first sample used, s.
    angular_frequency : Estimate
        Mean over the record, which is the slope of a straight line through the phases, rad/s.
    phase : Estimate
        Phase at ``t0``, wrapped into (-pi, pi], rad.
    backbone : Estimate or None
        :math:`\\kappa` of :math:`\\omega(A) = \\omega_0 + \\kappa A^2`, rad/(s m^2); None if it is not significant.
    reduced_chi2 : float
        Reduced chi-square of the selected model, from the noise of the windows' phases and their excess scatter.
    correlation : float
        Correlation length of the straight line's residuals, as a number of windows.
    residual : (w,) float64, rad
        Phases minus the straight line.
    coefficients : (2 or 3,) float64
        Coefficients of 1, of t - middle and, with a backbone, of its column.
    middle : float
        Weighted mean time of the record, s.
    damping : Damping
        Provides the amplitude that the backbone's column integrates.
    lag : tuple of (g,) float64, or None
        Times (in s) and the delays (in rad) of a period's fitted sinusoid at these times, see :func:`lag_of`; None if
        the delay is constant.
    squared_rate : float or None
        Decrease of the squared angular frequency that drag causes, 1/s^2. None stands for the mean over the windows,
        weighted by their squared amplitudes (:meth:`pipeline.damping.select.Damping.squared_rate`).
    """

    t0: float
    angular_frequency: Estimate
    phase: Estimate
    backbone: Estimate | None
    reduced_chi2: float
    correlation: float
    residual: F8
    coefficients: F8
    middle: float
    damping: Damping
    lag: tuple[F8, F8] | None = None
    squared_rate: float | None = None

    def total(self, t: F8) -> F8:
        """Return the model's total phase in rad at times t (n,) in s."""
        level, slope, *bend = self.coefficients.tolist()
        total = level + slope * (t - self.middle)
        if bend:
            total += bend[0] * _integral_at(t, self.middle, self.damping)
        return np.asarray(total if self.lag is None else total - np.interp(t, *self.lag))

    def rate(self, amplitude: F8) -> F8:
        """Return the model's angular frequency in rad/s at amplitudes (n,) in m."""
        omega = np.full(amplitude.size, self.coefficients[1])
        if self.coefficients.size == 3:
            omega += self.coefficients[2] * amplitude**2
        return omega


def fit_phase(demodulated: Demodulated, damping: Damping) -> PhaseFit:
    """Fit a constant frequency to the windows' phases and test it against one that depends on amplitude.

    Parameters
    ----------
    demodulated : Demodulated
    damping : Damping

    Returns
    -------
    PhaseFit

    Notes
    -----
    The reported frequency is the record's mean, whether or not the frequency varies. If the residuals of the straight
    line are not white, its uncertainty is multiplied by the square root of the correlation length and, if chi-square
    is too large, of the reduced chi-square. The interval then covers a curvature of the phase.

    The frequency of an ideal spring is constant. A nonlinear spring shifts it in proportion to the square of the
    amplitude.

    The delay of a period's fitted sinusoid (:func:`lag_of`) follows from the damping law and is removed first.
    """
    t, lag = demodulated.t, lag_of(damping.best, damping.t0, demodulated)
    phase = demodulated.phase if lag is None else demodulated.phase + np.interp(t, *lag)
    noise = np.maximum(np.sqrt(demodulated.covariance[:, 1, 1]), ROUNDING)
    if t.size < 2:
        return _single(demodulated, damping, float(noise[0]))
    turning = phase - demodulated.angular_frequency * (t - t[0])
    spread = scatter(t, turning, noise)
    kept = spread.kept
    u = spread.u[kept]
    middle = float(np.average(t[kept], weights=1.0 / u**2))
    # The last row of the design matrices is that of the start.
    points = np.append(t, damping.t0)
    line = design = _design(points, middle, damping, bent=False)
    straight = solve_weighted(line[:-1][kept], phase[kept], u)
    bent = None
    if u.size >= 8 and len(damping.best.law.parameters) > 1:
        curve = _design(points, middle, damping, bent=True)
        trial = solve_weighted(curve[:-1][kept], phase[kept], u)
        gain = (straight.chi2 - trial.chi2) / spread.correlation - math.log(u.size / spread.correlation)
        if gain > EVIDENCE:
            bent, design = trial, curve
    widened, length = _widening(straight, u, spread)
    covariance = straight.covariance * widened
    model = bent or straight
    start = np.array([1.0, damping.t0 - middle])
    at_start = float(design[-1] @ model.values) - (0.0 if lag is None else float(lag[1][0]))
    residual = phase - line[:-1] @ straight.values
    free = max(u.size - model.values.size, 1)
    return PhaseFit(
        damping.t0,
        Estimate(float(straight.values[1]), math.sqrt(covariance[1, 1]), "rad/s"),
        Estimate(wrapped(at_start), math.sqrt(float(start @ covariance @ start)), "rad"),
        None if bent is None else _backbone(bent, spread, free),
        model.chi2 / free,
        length,
        residual,
        model.values,
        middle,
        damping,
        lag,
    )


def lag_of(fit: LawFit, t0: float, demodulated: Demodulated) -> tuple[F8, F8] | None:
    """Return times from ``t0`` (2049,) in s and the delays in rad that drag causes in a period's fitted sinusoid.

    Return None if the delay is constant, as with linear drag.

    Parameters
    ----------
    fit : LawFit
        Provides the amplitude as a function of the time since ``t0`` and the decay rate :math:`r(A) = -\\dot A`.
    t0 : float, s
        Time of the first sample used.
    demodulated : Demodulated

    Notes
    -----
    Drag acts mainly while the bob is fast. A period is therefore not exactly sinusoidal, and the first harmonic of its
    exact waveform lags behind a phase that advances at a constant rate. To first order, averaging gives the lag
    :math:`\\frac{n + 3}{2(n + 1)}\\frac{r}{\\omega A} = (\\frac12 + \\frac1{n + 1})\\frac{r}{\\omega A}` for a force
    :math:`\\propto v^n`. For any sum of powers it is therefore

    .. math:: \\frac{1}{\\omega A}\\Bigl(\\frac{r(A)}{2} + \\frac1A\\int_0^A r(a)\\,da\\Bigr).

    For friction the lag is :math:`3\\delta/\\pi A`, where :math:`2\\delta` is the loss of amplitude per half-cycle.
    Near the stop the formula fails; the lag is limited to its value where half of the amplitude is lost per radian.
    """
    omega, last = demodulated.angular_frequency, max(float(np.max(demodulated.t)), t0 + 1e-9)
    t = np.linspace(t0, last, TABLE)
    amplitude = np.abs(fit.amplitude(t - t0))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    below = amplitude[:, None] * 0.5 * (nodes + 1.0)
    theta = fit.joint.values
    with np.errstate(all="ignore"):
        rate = -fit.law.rate(amplitude, theta)
        mean = -0.5 * fit.law.rate(below.ravel(), theta).reshape(below.shape) @ weights
        lag = (0.5 * rate + mean) / (omega * amplitude)
    lag = np.clip(np.where(np.isfinite(lag), lag, 0.0), -MOST_LAG, MOST_LAG)
    return (t, lag) if float(np.ptp(lag)) > 1e-12 else None


def _design(t: F8, middle: float, damping: Damping, *, bent: bool) -> F8:
    columns = [np.ones(t.size), t - middle]
    if bent:
        columns.append(_integral_at(t, middle, damping))
    return np.stack(columns, axis=1)


def _integral_at(t: F8, middle: float, damping: Damping) -> F8:
    end = max(2.0 * middle - damping.t0, float(np.max(t)), damping.t0 + 1e-9)
    first = min(damping.t0, float(np.min(t)))
    grid, area = amplitude_integral(damping.best, damping.t0, middle, first, end)
    return np.asarray(np.interp(t - middle, grid, area))


def amplitude_integral(fit: LawFit, t0: float, middle: float, first: float, last: float) -> tuple[F8, F8]:
    """Return times relative to ``middle`` (2049,) in s and the integral of A^2 from ``middle`` in m^2 s.

    The trapezoidal rule and linear interpolation between its points have a relative error below 1e-5 if A^2 decays
    by a factor of e^10 within the table.

    Parameters
    ----------
    fit : LawFit
        Provides the amplitude as a function of the time since ``t0``.
    t0, middle, first, last : float, s
        The table extends from ``first`` to ``last``.
    """
    from scipy.integrate import cumulative_trapezoid

    grid = np.linspace(first - middle, last - middle, TABLE)
    power = fit.amplitude(grid + (middle - t0)) ** 2
    power[~np.isfinite(power)] = 0.0  # before the analysed part a law may have a pole
    integral = cumulative_trapezoid(power, grid, initial=0.0)
    return grid, np.asarray(integral - np.interp(0.0, grid, integral))


def _widening(line: Line, u: F8, spread: Scatter) -> tuple[float, float]:
    """Return the factor that widens the straight line's covariance, and the correlation length used for it."""
    free = line.residual.size - 2
    if free < 1:
        return 1.0, 1.0
    length = max(correlation_length(line.residual / u), spread.correlation)
    too_large = line.chi2 > chi2_quantile(1.0 - REJECTION, free)
    return length * (line.chi2 / free if too_large else 1.0), length


def _backbone(bent: Line, spread: Scatter, free: int) -> Estimate:
    widened = spread.correlation * max(1.0, bent.chi2 / free)
    return Estimate(float(bent.values[2]), math.sqrt(bent.covariance[2, 2] * widened), BACKBONE.of("m"))


def _single(demodulated: Demodulated, damping: Damping, noise: float) -> PhaseFit:
    """Return the fit of a single window: its frequency is that of the spectrum, uncertain by half a line width."""
    t, omega = float(demodulated.t[0]), demodulated.angular_frequency
    phase = float(demodulated.phase[0]) + omega * (damping.t0 - t)
    reach = max(2.0 * (t - damping.t0), 1e-9)
    u_omega = math.pi / reach
    return PhaseFit(
        damping.t0,
        Estimate(omega, u_omega, "rad/s"),
        Estimate(wrapped(phase), math.hypot(noise, 0.5 * math.pi), "rad"),
        None,
        math.nan,
        1.0,
        np.zeros(1),
        np.array([float(demodulated.phase[0]), omega]),
        t,
        damping,
    )


def wrapped(angle: float) -> float:
    """Return the angle in rad wrapped into (-pi, pi]."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned == -math.pi else turned
