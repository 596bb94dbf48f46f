"""Quick models: four damping laws, a constant frequency and a constant rest position by linear algebra.

Each function returns None where a chi-square or a correlation says that the record needs more; the standard stage of
that name is then called.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from pipeline.damping import BARE_MENTION, Damping, LawFit
from pipeline.damping import Params as DampingParams
from pipeline.demodulate import Demodulated
from pipeline.estimate import Estimate, Joint
from pipeline.laws import LAWS, Law
from pipeline.phase import PhaseFit, wrapped
from pipeline.regression import Scatter, chi2_quantile, correlation_length
from pipeline.rest import Rest
from pipeline.track import F8

__all__ = ["fit_damping_quickly", "fit_phase_quickly", "fit_rest_quickly"]

NESTED = {"none": (0,), "linear": (0, 1), "quadratic": (0, 2), "linear+quadratic": (0, 1, 2)}
STEPS = 4  # Gauss-Newton's; from curves through the logarithms two suffice


def fit_damping_quickly(demodulated: Demodulated, t0: float, params: DampingParams) -> Damping | None:
    """Fit no damping, linear, quadratic and both to the windows' amplitudes.

    Parameters
    ----------
    demodulated : Demodulated
    t0 : float
        Time of the first sample used, s.
    params : pipeline.damping.Params

    Returns
    -------
    Damping or None
        None where other laws are asked for, where the mixture of both leaves more than noise or what it leaves is
        correlated, and where every law is rejected: the amplitudes' scatter must then be measured first.

    Notes
    -----
    The mixture is fitted by Gauss-Newton, from a parabola through the logarithms. Its special cases start where the
    mixture's covariance sees them, and take Gauss-Newton steps of their own.
    """
    t, y = demodulated.t - t0, demodulated.amplitude
    u = np.sqrt(demodulated.covariance[:, 0, 0])
    if set(params.laws) != set(NESTED) or t.size < 8 or not y.min() > 5.0 * u.max():
        return None
    theta = _start(t, y, u)
    found = _gauss_newton((0, 1, 2), t, y, u, theta)
    if found is None:
        return None
    theta, covariance, chi2 = found
    free = t.size - 3
    if chi2 > chi2_quantile(0.99, free):
        return None
    if correlation_length((y - _mixture(t, theta)[0]) / u) > 1.0:
        return None
    fits: dict[str, LawFit] = {}
    for name, slots in NESTED.items():
        solution: tuple[F8, F8, float] | None = (theta, covariance, chi2)
        if len(slots) < 3:
            others = [k for k in range(3) if k not in slots]
            pull = np.linalg.solve(covariance[np.ix_(others, others)], theta[others])
            start = theta[list(slots)] - covariance[np.ix_(slots, others)] @ pull
            solution = _gauss_newton(slots, t, y, u, start)
        if solution is None:
            return None
        fits[name] = _weigh(LAWS[name], *solution, t.size, params)
    allowed = [name for name in fits if not fits[name].rejected]
    if not allowed:
        return None
    least = min(fits[name].bic for name in allowed)
    ties = [name for name in allowed if fits[name].bic - least < BARE_MENTION]
    selected = min(ties, key=lambda name: (len(NESTED[name]), list(fits).index(name)))
    order = sorted(allowed, key=lambda name: (name != selected, fits[name].bic))
    admissible = tuple(name for name in order if fits[name].bic - least <= params.evidence)
    return Damping(t0, fits, selected, admissible, Scatter(u, 0.0, np.ones(t.size, np.bool_), 1.0))


def _start(t: F8, y: F8, u: F8) -> F8:
    """Mixture's parameters from a parabola through the logarithms: its slope is -(gamma + beta A)."""
    middle = 0.5 * float(t[-1])
    tau = t - middle
    design = np.stack([np.ones(t.size), tau, tau**2], axis=1) * (y / u)[:, None]
    level, slope, bend = np.linalg.lstsq(design, np.log(y) * (y / u), rcond=None)[0]
    ends = np.array([-middle, float(t[-1]) - middle])
    amplitude = np.exp(level + slope * ends + bend * ends**2)
    rates = -(slope + 2.0 * bend * ends)
    fall = float(amplitude[0] - amplitude[1])
    beta = float(rates[0] - rates[1]) / fall if abs(fall) > 0.02 * float(amplitude[0]) else 0.0
    return np.array([amplitude[0], float(rates[0]) - beta * amplitude[0], beta])


def _mixture(t: F8, theta: F8) -> tuple[F8, F8]:
    """Amplitude (n,) and derivatives (n, 3) of linear and quadratic drag together, in one pass.

    The general law of :mod:`pipeline.laws` costs five times as much; a test holds the two together.
    """
    start, gamma, beta = theta
    fall = np.exp(-gamma * t)
    if abs(gamma) * float(t[-1]) < 1e-4:
        reach, bend = t - 0.5 * gamma * t**2, t**2 * (gamma * t / 3.0 - 0.5)
    else:
        reach = (1.0 - fall) / gamma
        bend = (t * fall - reach) / gamma
    below = 1.0 + beta * start * reach
    amplitude = start * fall / below
    by = np.stack(
        [
            amplitude / (start * below),
            -amplitude * (t + beta * start * bend / below),
            -amplitude * start * reach / below,
        ]
    )
    return amplitude, by.T


def _gauss_newton(slots: tuple[int, ...], t: F8, y: F8, u: F8, theta: F8) -> tuple[F8, F8, float] | None:
    """Parameters, covariance and chi-square; None where steps do not settle."""
    for taken in range(STEPS):
        with np.errstate(all="ignore"):
            whole = np.zeros(3)
            whole[list(slots)] = theta
            amplitude, by = _mixture(t, whole)
            residual = (y - amplitude) / u
            jacobian = by[:, slots] / u[:, None]
            normal, right = jacobian.T @ jacobian, jacobian.T @ residual
            scale = np.sqrt(normal.diagonal())
        chi2 = float(residual @ residual)
        if not (math.isfinite(chi2) and math.isfinite(float(right.sum())) and float(scale.min()) > 0.0):
            return None
        try:
            inverse = np.linalg.inv(normal / (scale[:, None] * scale)) / (scale[:, None] * scale)
        except np.linalg.LinAlgError:
            return None
        step = inverse @ right
        gain = float(step @ right)
        theta = theta + step
        # A thirtieth of a standard uncertainty is left, quadratic convergence takes it away.
        if 0.0 <= gain <= 1e-3 * max(1.0, chi2 / t.size):
            return theta, inverse, chi2 - gain
        # A special case that the record contradicts need not settle: it is rejected either way.
        if taken and chi2 > 4.0 * t.size and gain < 0.1 * chi2:
            return theta, inverse, chi2
    return None


def _weigh(law: Law, theta: F8, covariance: F8, chi2: float, points: int, params: DampingParams) -> LawFit:
    count = len(law.parameters)
    free = points - count
    rejection: Literal["", "misfit", "negative"] = ""
    if chi2 > chi2_quantile(1.0 - params.rejection, free):
        rejection = "misfit"
    elif np.any(theta < -3.0 * np.sqrt(np.diag(covariance))):
        rejection = "negative"
    joint = Joint(law.parameters, theta, covariance, law.units)
    return LawFit(law, joint, chi2 / free, float(free), chi2 + count * math.log(points), True, rejection)


def fit_phase_quickly(demodulated: Demodulated, damping: Damping) -> PhaseFit | None:
    """Fit a constant frequency to the windows' phases; None where they bend or scatter.

    Parameters
    ----------
    demodulated : Demodulated
    damping : Damping
    """
    t, u = demodulated.t, np.sqrt(demodulated.covariance[:, 1, 1])
    weight = 1.0 / np.maximum(u, 1e-12) ** 2
    middle = float(weight @ t / weight.sum())
    tau = t - middle
    turning = demodulated.phase - demodulated.angular_frequency * tau
    level = float(weight @ turning / weight.sum())
    power = float(weight @ tau**2)
    slope = float((weight * tau) @ turning) / power
    residual = turning - level - slope * tau
    pulls = residual / u
    free = t.size - 2
    # What a parabola beyond the line would take away: the bend of an amplitude-dependent frequency shows there first.
    curve = tau**2 - float(weight @ tau**2) / weight.sum() - tau * float(weight @ tau**3) / power
    bend = float((weight * curve) @ residual) ** 2 / float(weight @ curve**2)
    chi2 = float(pulls @ pulls)
    if bend > 9.0 or chi2 > chi2_quantile(0.99, free) or correlation_length(pulls) > 1.0:
        return None
    omega = demodulated.angular_frequency + slope
    before = damping.t0 - middle
    u_level, u_slope = 1.0 / math.sqrt(float(weight.sum())), 1.0 / math.sqrt(power)
    return PhaseFit(
        damping.t0,
        Estimate(omega, u_slope, "rad/s"),
        Estimate(wrapped(level + omega * before), math.hypot(u_level, u_slope * before), "rad"),
        None,
        chi2 / free,
        1.0,
        residual,
        np.array([level, omega]),
        middle,
        damping,
    )


def fit_rest_quickly(demodulated: Demodulated) -> Rest | None:
    """Fit a constant to the windows' rest positions; None where they drift or scatter.

    Parameters
    ----------
    demodulated : Demodulated
    """
    t, offset = demodulated.t, demodulated.offset
    u = np.sqrt(demodulated.covariance[:, 2, 2])
    if not u.min() > 0.0:
        return None
    weight = 1.0 / u**2
    mean = float(weight @ offset / weight.sum())
    pulls = (offset - mean) / u
    tau = (t - float(t.mean())) / float(np.ptp(t))
    trend = float((tau / u) @ pulls) ** 2 / float((tau / u) @ (tau / u))
    chi2 = float(pulls @ pulls)
    if trend > 9.0 or chi2 > chi2_quantile(0.99, t.size - 1) or correlation_length(pulls) > 1.0:
        return None
    estimate = Estimate(mean, 1.0 / math.sqrt(float(weight.sum())), "m")
    return Rest(estimate, 0.0, False, t, np.full(t.size, mean))
