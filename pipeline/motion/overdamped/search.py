"""Overdamped motion: records in which damping ends the motion before, or almost before, it can oscillate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.motion.overdamped.decay_fit import DecayFit, best_decay, critical_decay, lone_exponential
from pipeline.motion.overdamped.estimates import Kind, Overdamped, described, spring_constant
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.cycles import NoOscillation
from pipeline.track import F8

__all__ = ["Overdamped", "Params", "find_overdamped", "spring_constant"]

FEWEST = 20  # samples in which five parameters can be looked for
POINTS = 300  # to which a record is averaged where models of its shape are compared


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_overdamped`.

    Parameters
    ----------
    evidence : float
        By how much the BIC of a relaxation must beat that of any drift, step or ramp.
    misfit : float
        Greatest root mean square of what the fit leaves, in units of the record's noise.
    least_damping : float
        Damping ratio zeta from which an oscillation counts as strongly damped; below, its cycles are analysed.
    u_clock : float
        Relative standard uncertainty of a nominal clock.
    """

    evidence: float = 10.0
    misfit: float = 1.5
    least_damping: float = 0.05
    u_clock: float = 50e-6 / math.sqrt(3.0)


def find_overdamped(conditioned: Conditioned, params: Params | None = None) -> Overdamped | NoOscillation | None:
    """Fit the free motion of a linearly damped bob, and say which kind of damping it shows.

    Parameters
    ----------
    conditioned : Conditioned
    params : Params, optional

    Returns
    -------
    Overdamped, NoOscillation or None
        NoOscillation says that the record is a lone exponential, which a drift looks like too. None where it is no
        relaxation: noise, a drift, a step, a ramp, a weakly damped oscillation.

    Notes
    -----
    :class:`pipeline.motion.overdamped.decay_model.Decay` covers all strengths of damping. Start values are the best
    of a grid of rates
    and frequencies, for each of which the other three parameters are linear. A relaxation must leave no more than 1.5
    times the noise, in its moving part too, beat every polynomial to the third degree, every step and every ramp by
    ten in BIC, and be over within the record (:math:`gT > 2`). Of critical damping, two rates and an oscillation
    the one of lowest BIC is taken, which must be lower than a lone exponential's by six. A record
    that begins before the release is followed from where the displacement begins to fall.
    """
    params = params or Params()
    used = conditioned.used
    t, y = conditioned.track.t[used], conditioned.track.y[used]
    if t.size < FEWEST:
        return None
    noise = max(conditioned.noise_m, (conditioned.quantum_m or 0.0) / math.sqrt(12.0), 1e-4 * float(np.ptp(y)))
    if not (noise > 0.0 and _moves(y, noise, params.evidence)):
        return None
    for first in _starts(y, noise):
        found = _follow(t[first:], y[first:], noise, conditioned, params)
        if found is not None:
            return found
    return None


def _moves(y: F8, noise: float, evidence: float) -> bool:
    """Whether means over parts of the record differ by so much that a relaxation could explain them."""
    size = max(1, y.size // POINTS)
    values = y[: y.size // size * size].reshape(-1, size).mean(axis=1)
    excess = float(np.sum((values - values.mean()) ** 2)) * size / noise**2 - values.size
    return bool(excess > evidence + 5.0 * math.log(values.size))


def _starts(y: F8, noise: float) -> Iterator[int]:
    """Where the motion may begin: at the first sample, or where a held displacement begins to fall."""
    yield 0
    rest = float(np.median(y[-max(y.size // 10, 5) :]))
    away = np.abs(y - rest)
    held = np.flatnonzero(away >= float(np.median(away[: max(y.size // 50, 5)])) - 3.0 * noise)
    if held.size and 5 < held[-1] < y.size - 20:
        yield int(held[-1])


def _follow(t: F8, y: F8, noise: float, conditioned: Conditioned, params: Params) -> Overdamped | NoOscillation | None:
    tau = t - t[0]
    fit = best_decay(tau, y, noise, conditioned.track.rate_hz)
    if fit is None or not fit.rate * tau[-1] > 2.0 or _misses(tau, y, fit, params.misfit):
        return None
    if not _beats_other_shapes(tau, y, fit, noise, params.evidence):
        return None
    choice = _kind(tau, y, fit, 0.5 * conditioned.track.rate_hz)
    if choice is None or isinstance(choice, NoOscillation):
        return choice
    kind, fit = choice
    # Uncertainties grow with what the fit leaves beyond the noise.
    fit = replace(fit, covariance=fit.covariance * max(1.0, fit.chi2 / max(t.size - 5, 1)))
    u_clock = params.u_clock if conditioned.track.clock == "nominal" else 0.0
    found = described(fit, kind, float(t[0]), t.size, u_clock)
    return None if kind == "strong" and found.damping_ratio.value < params.least_damping else found


def _misses(tau: F8, y: F8, fit: DecayFit, misfit: float) -> bool:
    """Whether the fit leaves too much of the record, or of the part in which it moves."""
    squares = ((y - fit.position(tau)) / fit.noise) ** 2
    count = max(int(np.searchsorted(tau, 4.0 / fit.slowest)), 12)
    return bool(max(float(np.mean(squares)), float(np.mean(squares[:count]))) > misfit**2)


def _beats_other_shapes(tau: F8, y: F8, fit: DecayFit, noise: float, evidence: float) -> bool:
    """Whether the relaxation explains the record better than any polynomial, step or ramp does."""
    size = max(1, tau.size // POINTS)
    whole = tau.size // size * size
    t, values, model = (x[:whole].reshape(-1, size).mean(axis=1) for x in (tau, y, fit.position(tau)))
    sigma = max(noise, fit.noise) / math.sqrt(size)
    mine = float(np.sum((values - model) ** 2)) / sigma**2 + 5.0 * math.log(t.size)
    others = min(left / sigma**2 + count * math.log(t.size) for left, count in _other_shapes(t, values))
    return mine + evidence < others


def _other_shapes(t: F8, y: F8) -> Iterator[tuple[float, int]]:
    """Fit polynomials to the third degree, every step and every ramp.

    Parameters
    ----------
    t, y : (n,) float64
        Ascending times from 0, s, and distances, m.

    Yields
    ------
    left : float
        Squares that a shape leaves, m^2; of the steps, and of each degree, the best.
    count : int
        Its parameters.
    """
    x = 2.0 * t / t[-1] - 1.0
    for degree in range(4):
        yield _left(np.polynomial.legendre.legvander(x, degree), y), degree + 1
    n = t.size
    splits = np.arange(3, n - 3)
    total, squares = np.cumsum(y), float(y @ y)
    before, after = total[splits - 1] ** 2 / splits, (total[-1] - total[splits - 1]) ** 2 / (n - splits)
    yield squares - float(np.max(before + after)), 3
    knots = np.linspace(t[0], t[-1], 26)
    for i, first in enumerate(knots[:-1]):
        for last in knots[i + 1 :]:
            ramp = np.clip((t - first) / (last - first), 0.0, 1.0)
            yield _left(np.stack([np.ones(n), ramp], axis=1), y), 4


def _left(design: F8, y: F8) -> float:
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    residual: F8 = y - design @ values
    return float(np.sum(residual**2))


def _kind(tau: F8, y: F8, fit: DecayFit, fastest: float) -> tuple[Kind, DecayFit] | NoOscillation | None:
    """Which kind of damping has the lowest BIC, and its fit, if a lone exponential does not do.

    None where the motion ends at a rate beyond the fastest, 1/s: between two samples, where a step looks alike.
    """
    price = math.log(tau.size)
    fall = np.exp(-fit.slowest * tau)
    offset = float(fit.theta[0])
    start = np.array([offset, float(fall @ (y - offset)) / float(fall @ fall), math.log(fit.slowest)])
    lone = lone_exponential(tau, y, fit.noise, start)
    one = critical_decay(tau, y, fit)
    critical = math.inf if one is None else one.chi2 + 4.0 * price
    free = fit.chi2 + 5.0 * price
    if min(critical, free) > lone.cost + 3.0 * price - 6.0:
        rate = math.exp(lone.values[2])
        if rate > fastest:
            return None
        return NoOscillation(
            f"the distance follows one exponential, at {rate:.3g} 1/s: "
            "an overdamped motion whose fast part is over or too small, or a drift"
        )
    if one is not None and critical <= free:
        return ("critical", one) if one.rate <= fastest else None
    if fit.slowest > fastest:
        return None
    return ("overdamped" if fit.square > 0.0 else "strong"), fit
