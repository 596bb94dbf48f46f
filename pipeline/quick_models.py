"""Quick models: four damping laws, a constant frequency and a constant rest position by linear algebra.

Each function returns None where a chi-square or a correlation says that the record needs more; the standard stage of
that name is then called.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from pipeline.damping import BARE_MENTION, Damping, LawFit
from pipeline.damping import Params as DampingParams
from pipeline.demodulate import Demodulated
from pipeline.estimate import Estimate, Joint
from pipeline.laws import LAWS, Law
from pipeline.laws.drag import FADING
from pipeline.normal_matrix import inverse_of
from pipeline.phase import PhaseFit, wrapped
from pipeline.regression import Scatter, chi2_quantile, correlation_length
from pipeline.rest import Rest
from pipeline.track import F8

__all__ = ["FAST_LAWS", "fit_damping_quickly", "fit_phase_quickly", "fit_rest_quickly"]

FAST_LAWS = ("none", "linear", "quadratic", "linear+quadratic")
MIXTURE = FAST_LAWS[-1]
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
    if set(params.laws) != set(FAST_LAWS) or t.size < 8 or not y.min() > 5.0 * u.max():
        return None
    weight = 1.0 / u
    start = _start(t, y, y * weight)
    rich = None if start is None else _settled(MIXTURE, t, y, weight, start)
    if rich is None:
        return None
    if rich.chi2 > chi2_quantile(0.99, t.size - 3) or correlation_length(rich.residual) > 1.0:
        return None
    settled = {name: _special(name, t, y, weight, rich) for name in FAST_LAWS[:-1]}
    settled[MIXTURE] = rich
    fits = {name: _weigh(LAWS[name], each, t.size, params) for name, each in settled.items() if each is not None}
    if len(fits) < len(FAST_LAWS):
        return None
    allowed = [name for name in fits if not fits[name].rejected]
    if not allowed:
        return None
    least = min(fits[name].bic for name in allowed)
    ties = [name for name in allowed if fits[name].bic - least < BARE_MENTION]
    selected = min(ties, key=lambda name: (len(LAWS[name].parameters), list(fits).index(name)))
    order = sorted(allowed, key=lambda name: (name != selected, fits[name].bic))
    admissible = tuple(name for name in order if fits[name].bic - least <= params.evidence)
    return Damping(t0, fits, selected, admissible, Scatter(u, 0.0, np.ones(t.size, np.bool_), 1.0))


class _Settled(NamedTuple):
    """Where a law's fit of p parameters ends.

    Parameters (p,), normal matrix and its inverse (p, p), chi-square, and residuals (n,) over their uncertainty before
    the last step, which is small.
    """

    theta: F8
    normal: F8
    inverse: F8
    chi2: float
    residual: F8


def _start(t: F8, y: F8, weight: F8) -> F8 | None:
    """Mixture's parameters (3,) from a parabola through the logarithms: its slope is -(gamma + beta A)."""
    middle, half = 0.5 * float(t[-1]), 0.5 * float(t[-1])
    x = t / half - 1.0
    design = np.empty((3, t.size))
    design[0] = weight
    np.multiply(weight, x, out=design[1])
    np.multiply(design[1], x, out=design[2])
    inverse = inverse_of(design @ design.T)
    if inverse is None:
        return None
    level, slope, bend = (inverse @ (design @ (weight * np.log(y)))).tolist()
    ends = (math.exp(level - slope + bend), math.exp(level + slope + bend))
    rates = (-(slope - 2.0 * bend) / middle, -(slope + 2.0 * bend) / middle)
    fall = ends[0] - ends[1]
    beta = (rates[0] - rates[1]) / fall if abs(fall) > 0.02 * ends[0] else 0.0
    return np.array([ends[0], rates[0] - beta * ends[0], beta])


def _special(name: str, t: F8, y: F8, weight: F8, rich: _Settled) -> _Settled | None:
    """Fit a special case of the mixture, from where the mixture's chi-square, a parabola about its least, is least."""
    slots = [LAWS[MIXTURE].parameters.index(parameter) for parameter in LAWS[name].parameters]
    rows = rich.normal[slots]
    inverse = inverse_of(rows[:, slots])
    return None if inverse is None else _settled(name, t, y, weight, inverse @ (rows @ rich.theta))


def _settled(name: str, t: F8, y: F8, weight: F8, theta: F8) -> _Settled | None:
    """Fit a law from parameters (p,); None where steps do not settle."""
    form, p = FADING[LAWS[name].parameters], theta.size
    with np.errstate(all="ignore"):
        for taken in range(STEPS):
            amplitude, by = form(t, *theta.tolist())
            rows = np.empty((p + 1, t.size))  # slopes and residual over the uncertainty
            np.multiply(by, weight, out=rows[:p])
            residual = np.multiply(y - amplitude, weight, out=rows[p])
            # All sums of products at once.
            gram = rows @ rows.T
            normal, right, chi2 = gram[:p, :p], gram[:p, p], float(gram[p, p])
            inverse = inverse_of(normal)
            if inverse is None or not math.isfinite(chi2):
                return None
            step = inverse @ right
            gain = float(step @ right)
            theta = theta + step
            # A thirtieth of a standard uncertainty is left, quadratic convergence takes it away.
            if 0.0 <= gain <= 1e-3 * max(1.0, chi2 / t.size):
                return _Settled(theta, normal, inverse, chi2 - gain, residual)
            # A special case that the record contradicts need not settle: it is rejected either way.
            if taken and chi2 > 4.0 * t.size and gain < 0.1 * chi2:
                return _Settled(theta, normal, inverse, chi2, residual)
    return None


def _weigh(law: Law, found: _Settled, points: int, params: DampingParams) -> LawFit:
    free = points - found.theta.size
    rejection: Literal["", "misfit", "negative"] = ""
    if found.chi2 > chi2_quantile(1.0 - params.rejection, free):
        rejection = "misfit"
    elif (found.theta < -3.0 * np.sqrt(found.inverse.diagonal())).any():
        rejection = "negative"
    joint = Joint(law.parameters, found.theta, found.inverse, law.units)
    bic = found.chi2 + found.theta.size * math.log(points)
    return LawFit(law, joint, found.chi2 / free, float(free), bic, True, rejection)


def fit_phase_quickly(demodulated: Demodulated, damping: Damping) -> PhaseFit | None:
    """Fit a constant frequency to the windows' phases; None where they bend or scatter.

    Parameters
    ----------
    demodulated : Demodulated
    damping : Damping
    """
    t, u = demodulated.t, np.sqrt(demodulated.covariance[:, 1, 1])
    weight = 1.0 / np.maximum(u, 1e-12) ** 2
    total = float(weight.sum())
    middle = float(weight @ t) / total
    tau = t - middle
    square, moment = tau * tau, weight * tau
    turning = demodulated.phase - demodulated.angular_frequency * tau
    level = float(weight @ turning) / total
    power = float(moment @ tau)
    slope = float(moment @ turning) / power
    residual = turning - level - slope * tau
    pulls = residual / u
    free = t.size - 2
    # What a parabola beyond the line would take away: the bend of an amplitude-dependent frequency shows there first.
    curve = square - power / total - tau * (float(moment @ square) / power)
    bend = float((weight * curve) @ residual) ** 2 / float(weight @ (curve * curve))
    chi2 = float(pulls @ pulls)
    if bend > 9.0 or chi2 > chi2_quantile(0.99, free) or correlation_length(pulls) > 1.0:
        return None
    omega = demodulated.angular_frequency + slope
    before = damping.t0 - middle
    u_level, u_slope = 1.0 / math.sqrt(total), 1.0 / math.sqrt(power)
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
    total = float(weight.sum())
    mean = float(weight @ offset) / total
    pulls = (offset - mean) / u
    lever = (t - float(t.sum()) / t.size) / u
    trend = float(lever @ pulls) ** 2 / float(lever @ lever)
    chi2 = float(pulls @ pulls)
    if trend > 9.0 or chi2 > chi2_quantile(0.99, t.size - 1) or correlation_length(pulls) > 1.0:
        return None
    estimate = Estimate(mean, 1.0 / math.sqrt(total), "m")
    return Rest(estimate, 0.0, False, t, np.full(t.size, mean))
