"""Quick models: four damping laws, a constant frequency and a constant rest position by linear algebra.

Each function returns None where a chi-square or a correlation says that the record needs more; the standard stage of
that name is then called.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

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

# Which of (A0, gamma, beta) a law has; the mixture last.
NESTED = {"none": [0], "linear": [0, 1], "quadratic": [0, 2], "linear+quadratic": [0, 1, 2]}
CASES = np.array([[True, False, False], [True, True, False], [True, False, True]])
MIXED = np.ones((1, 3), np.bool_)
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
    weight = 1.0 / u
    rich = _gauss_newton(MIXED, t, y, weight, _start(t, y, y * weight))
    if rich is None:
        return None
    chi2 = float(rich.chi2[0])
    if chi2 > chi2_quantile(0.99, t.size - 3):
        return None
    if correlation_length((y - _mixture(t, rich.theta)[0][0]) * weight) > 1.0:
        return None
    # Where the mixture's chi-square, a parabola about its least, is least without some coefficients.
    normal = rich.normal[0]
    right = np.where(CASES, normal @ rich.theta[0], 0.0)
    start = np.linalg.solve(np.where(_pairs(CASES), normal, np.eye(3)), right[:, :, None])[:, :, 0]
    cases = _gauss_newton(CASES, t, y, weight, start)
    if cases is None:
        return None
    parts = (np.concatenate(pair) for pair in zip(cases, rich, strict=True))
    fits = _weigh_all(_Settled(*parts), t.size, params)
    allowed = [name for name in fits if not fits[name].rejected]
    if not allowed:
        return None
    least = min(fits[name].bic for name in allowed)
    ties = [name for name in allowed if fits[name].bic - least < BARE_MENTION]
    selected = min(ties, key=lambda name: (len(NESTED[name]), list(fits).index(name)))
    order = sorted(allowed, key=lambda name: (name != selected, fits[name].bic))
    admissible = tuple(name for name in order if fits[name].bic - least <= params.evidence)
    return Damping(t0, fits, selected, admissible, Scatter(u, 0.0, np.ones(t.size, np.bool_), 1.0))


class _Settled(NamedTuple):
    """Where fits of k laws end: parameters (k, 3), normal matrices and their inverses (k, 3, 3), chi-squares (k,)."""

    theta: F8
    normal: F8
    inverse: F8
    chi2: F8


def _start(t: F8, y: F8, weight: F8) -> F8:
    """Mixture's parameters (1, 3) from a parabola through the logarithms: its slope is -(gamma + beta A)."""
    middle, half = 0.5 * float(t[-1]), 0.5 * float(t[-1])
    x = t / half - 1.0
    design = np.empty((3, t.size))
    design[0], design[1], design[2] = weight, weight * x, weight * x * x
    level, slope, bend = np.linalg.solve(design @ design.T, design @ (weight * np.log(y))).tolist()
    ends = (math.exp(level - slope + bend), math.exp(level + slope + bend))
    rates = (-(slope - 2.0 * bend) / middle, -(slope + 2.0 * bend) / middle)
    fall = ends[0] - ends[1]
    beta = (rates[0] - rates[1]) / fall if abs(fall) > 0.02 * ends[0] else 0.0
    return np.array([[ends[0], rates[0] - beta * ends[0], beta]])


def _mixture(t: F8, theta: F8) -> tuple[F8, F8]:
    """Amplitudes (k, n) and derivatives (k, 3, n) of linear and quadratic drag together, theta (k, 3).

    The general law of :mod:`pipeline.laws` costs several times as much; a test holds the two together.
    """
    start, gamma, beta = theta.T[:, :, None]
    turn = gamma * t
    fall = np.exp(-turn)
    slow = np.abs(gamma) * t[-1] < 1e-4
    over = np.where(slow, 1.0, gamma)
    reach = (1.0 - fall) / over
    bend = (t * fall - reach) / over
    if slow.any():
        reach = np.where(slow, t - 0.5 * turn * t, reach)
        bend = np.where(slow, t * t * (turn / 3.0 - 0.5), bend)
    rise = beta * start
    below = 1.0 + rise * reach
    share = fall / below
    amplitude = start * share
    by = np.empty((*theta.shape, t.size))
    by[:, 0] = share / below
    by[:, 1] = -amplitude * (t + rise * bend / below)
    by[:, 2] = -amplitude * amplitude * reach / fall
    return amplitude, by


def _pairs(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return free[:, :, None] & free[:, None, :]


def _gauss_newton(free: NDArray[np.bool_], t: F8, y: F8, weight: F8, theta: F8) -> _Settled | None:
    """Fit laws that have the parameters ``free`` (k, 3); None where steps do not settle."""
    pairs, alone = _pairs(free), np.eye(3)
    end = _Settled(theta.copy(), np.empty((len(theta), 3, 3)), np.empty((len(theta), 3, 3)), np.empty(len(theta)))
    waiting = np.ones(len(theta), np.bool_)
    with np.errstate(all="ignore"):
        for taken in range(STEPS):
            amplitude, by = _mixture(t, theta)
            residual = (y - amplitude) * weight
            by *= weight
            chi2 = np.einsum("kn,kn->k", residual, residual)
            normal = np.where(pairs, by @ by.transpose(0, 2, 1), alone)
            right = np.where(free, np.einsum("kpn,kn->kp", by, residual), 0.0)
            scale = np.sqrt(np.einsum("kpp->kp", normal))
            if not (math.isfinite(float(chi2.sum() + right.sum())) and float(scale.min()) > 0.0):
                return None
            both = scale[:, :, None] * scale[:, None, :]
            try:
                inverse = np.linalg.inv(normal / both) / both
            except np.linalg.LinAlgError:
                return None
            step = np.einsum("kpq,kq->kp", inverse, right)
            gain = np.einsum("kp,kp->k", step, right)
            theta = theta + step
            # A thirtieth of a standard uncertainty is left, quadratic convergence takes it away.
            done = (gain >= 0.0) & (gain <= 1e-3 * np.maximum(1.0, chi2 / t.size))
            # A special case that the record contradicts need not settle: it is rejected either way.
            hopeless = (chi2 > 4.0 * t.size) & (gain < 0.1 * chi2) & (taken > 0)
            now = waiting & (done | hopeless)
            for mine, theirs in zip(end, (theta, normal, inverse, np.where(done, chi2 - gain, chi2)), strict=True):
                mine[now] = theirs[now]
            waiting &= ~now
            if not waiting.any():
                return end
    return None


def _weigh_all(found: _Settled, points: int, params: DampingParams) -> dict[str, LawFit]:
    """The laws' fits by name, in the order of ``NESTED``."""
    rows = zip(NESTED.items(), found.theta, found.inverse, found.chi2.tolist(), strict=True)
    return {
        name: _weigh(LAWS[name], theta[slots], inverse[slots][:, slots], chi2, points, params)
        for (name, slots), theta, inverse, chi2 in rows
    }


def _weigh(law: Law, theta: F8, covariance: F8, chi2: float, points: int, params: DampingParams) -> LawFit:
    count = len(law.parameters)
    free = points - count
    rejection: Literal["", "misfit", "negative"] = ""
    if chi2 > chi2_quantile(1.0 - params.rejection, free):
        rejection = "misfit"
    elif (theta < -3.0 * np.sqrt(covariance.diagonal())).any():
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
