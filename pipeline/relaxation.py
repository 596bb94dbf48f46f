"""Relaxation: records in which damping ends the motion before, or almost before, it can oscillate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from pipeline.condition import Conditioned
from pipeline.cycles import NoOscillation
from pipeline.decay_model import Decay, Exponentials, basis
from pipeline.effects import added_mass_kg
from pipeline.estimate import Estimate
from pipeline.law_fit import covariance_or_infinite, minimise
from pipeline.scene import Scene
from pipeline.track import F8

__all__ = ["Params", "Relaxation", "find_relaxation", "spring_constant"]

Kind = Literal["overdamped", "critical", "strong"]
FEWEST = 20  # samples in which five parameters can be looked for
POINTS = 300  # to which a record is averaged where models of its shape are compared


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_relaxation`.

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


@dataclass(frozen=True, slots=True)
class Relaxation(NoOscillation):
    """A motion that damping ends within a few cycles or without any.

    Parameters
    ----------
    why : str
        One sentence with the rates.
    kind : {"overdamped", "critical", "strong"}
        Two rates; one; or an oscillation whose damping ratio is large.
    damping_ratio : Estimate
        :math:`\\zeta = g/\\omega_0`.
    squared_frequency : Estimate
        :math:`\\omega_0^2` of the undamped motion, rad^2/s^2: times the mass, the spring constant.
    estimates : mapping of str to Estimate
    start_s : float
        From where the motion was followed, s.
    """

    kind: Kind
    damping_ratio: Estimate
    squared_frequency: Estimate
    estimates: Mapping[str, Estimate]
    start_s: float


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Where a fit of (o, a, v, ln g, ln w) ended.

    ``critical`` holds w at g^2; ``noise`` is that of a sample, m.
    """

    theta: F8
    covariance: F8
    chi2: float
    noise: float
    critical: bool = False

    @property
    def rate(self) -> float:
        """g, 1/s."""
        return math.exp(self.theta[3])

    @property
    def stiffness(self) -> float:
        """w, the square of the undamped frequency, rad^2/s^2."""
        return self.rate**2 if self.critical else math.exp(self.theta[4])

    @property
    def square(self) -> float:
        """q = g^2 - w, 1/s^2."""
        return self.rate**2 - self.stiffness


def find_relaxation(conditioned: Conditioned, params: Params | None = None) -> Relaxation | NoOscillation | None:
    """Fit the free motion of a linearly damped bob, and tell which kind of damping it shows.

    Parameters
    ----------
    conditioned : Conditioned
    params : Params, optional

    Returns
    -------
    Relaxation, NoOscillation or None
        NoOscillation says that the record is a lone exponential, which a drift looks like too. None where it is no
        relaxation: noise, a drift, a step, a ramp, a weakly damped oscillation.

    Notes
    -----
    :class:`pipeline.decay_model.Decay` covers all strengths of damping. Start values are the best of a grid of rates
    and frequencies, for each of which the other three parameters are linear. A relaxation must leave no more than 1.5
    times the noise, in its moving part too, beat every polynomial to the third degree, every step and every ramp by
    ten in BIC, and be over within the record (:math:`gT > 2`). Critical damping, two rates and an oscillation are told
    apart by the lowest BIC, which must be lower than a lone exponential's by six. A record
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


def spring_constant(found: Relaxation, scene: Scene) -> dict[str, Estimate]:
    """Return the spring constant, N/m, by name; nothing where the scene gives no bob mass.

    Notes
    -----
    :math:`k = \\omega_0^2 (m + m_s/3 + m_a)` with the undamped frequency; the spring's share and the air carried
    along count where the scene names them.
    """
    if scene.bob_mass_kg is None:
        return {}
    mass, squares = scene.bob_mass_kg.value + added_mass_kg(scene), scene.bob_mass_kg.u**2
    if scene.spring_mass_kg is not None:
        mass += scene.spring_mass_kg.value / 3.0
        squares += (scene.spring_mass_kg.u / 3.0) ** 2
    k = found.squared_frequency.value * mass
    relative = math.hypot(math.sqrt(squares) / mass, found.squared_frequency.u / found.squared_frequency.value)
    return {"spring_constant": Estimate(k, k * relative, "N/m")}


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


def _follow(t: F8, y: F8, noise: float, conditioned: Conditioned, params: Params) -> Relaxation | NoOscillation | None:
    tau = t - t[0]
    fit = _best(tau, y, noise, conditioned.track.rate_hz, None)
    if fit is None or not fit.rate * tau[-1] > 2.0 or _misses(tau, y, fit, params.misfit):
        return None
    if not _beats_other_shapes(tau, y, fit, noise, params.evidence):
        return None
    choice = _kind(tau, y, fit, conditioned.track.rate_hz)
    if isinstance(choice, NoOscillation):
        return choice
    kind, fit = choice
    # Uncertainties grow with what the fit leaves beyond the noise.
    fit = replace(fit, covariance=fit.covariance * max(1.0, fit.chi2 / max(t.size - 5, 1)))
    u_clock = params.u_clock if conditioned.track.clock == "nominal" else 0.0
    found = _describe(fit, kind, float(t[0]), t.size, u_clock)
    return None if kind == "strong" and found.damping_ratio.value < params.least_damping else found


def _misses(tau: F8, y: F8, fit: _Fit, misfit: float) -> bool:
    """Whether the fit leaves too much of the record, or of the part in which it moves."""
    values = Decay(tau, np.ones((1, 5), np.bool_), critical=fit.critical).evaluate(
        np.zeros(1, np.int64), fit.theta[None, :]
    )[0][0]
    squares = ((y - values) / fit.noise) ** 2
    slowest = fit.stiffness / (fit.rate + math.sqrt(fit.square)) if fit.square > 0.0 else fit.rate
    count = max(int(np.searchsorted(tau, 4.0 / slowest)), 12)
    return bool(max(float(np.mean(squares)), float(np.mean(squares[:count]))) > misfit**2)


def _best(tau: F8, y: F8, noise: float, rate_hz: float, near: F8 | None) -> _Fit | None:
    """The least-squares fit from a grid of starts, or the critical one from near a point."""
    weight = np.full(y.size, 1.0 / noise)
    if near is None:
        theta = np.concatenate([_two_rates(tau, y, weight, rate_hz), _grid(tau, y, rate_hz)])
    else:
        theta = near[None, :]
    free = np.ones(theta.shape, np.bool_)
    free[:, 4] = near is None
    end = minimise(Decay(tau, free, critical=near is not None), y, weight, theta)
    best = int(np.argmin(np.where(end.converged, end.chi2, np.inf)))
    if not end.converged[best]:
        return None
    slots = np.flatnonzero(free[best])
    covariance = np.zeros((5, 5))
    covariance[np.ix_(slots, slots)] = covariance_or_infinite(end.jacobian[best, slots])
    if not np.isfinite(covariance).all():
        return None
    return _Fit(end.theta[best], covariance, float(end.chi2[best]), noise, near is not None)


def _two_rates(tau: F8, y: F8, weight: F8, rate_hz: float, keep: int = 2) -> F8:
    """Start values (keep, 5) or fewer: sums of two exponentials, found from the best single one."""
    rates = np.geomspace(1.0 / tau[-1], 0.5 * rate_hz, 40)
    falls = np.exp(-rates[:, None] * tau)
    level = float(y.mean())
    left, linear = _linear_best(np.stack([np.ones_like(falls), falls], axis=1), y - level)
    k = int(np.argmin(left))
    lone = minimise(
        Exponentials(tau, 1, 1), y, weight, np.array([[level + linear[k, 0], linear[k, 1], math.log(rates[k])]])
    )
    slow = math.exp(lone.theta[0, 2])
    fast = np.geomspace(1.5 * slow, max(rate_hz, 3.0 * slow), 24)
    falls = np.exp(-fast[:, None] * tau)
    fall = np.broadcast_to(np.exp(-slow * tau), falls.shape)
    left, linear = _linear_best(np.stack([np.ones_like(falls), fall, falls], axis=1), y - level)
    best = np.argsort(left)[:keep]
    offset, first, second = linear[best].T
    start = np.stack([level + offset, first, np.full(best.size, math.log(slow)), second, np.log(fast[best])], axis=1)
    offset, first, slows, second, fasts = minimise(Exponentials(tau, best.size, 2), y, weight, start).theta.T
    with np.errstate(all="ignore"):
        slows, fasts = np.exp(slows), np.exp(fasts)
        speed = -first * slows - second * fasts
        theta = np.stack([offset, first + second, speed, np.log(0.5 * (slows + fasts)), np.log(slows * fasts)], axis=1)
    sound: F8 = theta[np.isfinite(theta).all(axis=1)]
    return sound


def _linear_best(design: F8, y: F8) -> tuple[F8, F8]:
    """Squares that each design (k, p, n) leaves, less those of y (n,), and the linear parameters (k, p)."""
    scale = np.sqrt(np.einsum("kpn,kpn->kp", design, design)) + 1e-300
    unit = design / scale[:, :, None]
    right = unit @ y
    linear = np.linalg.solve(unit @ unit.transpose(0, 2, 1) + 1e-10 * np.eye(design.shape[1]), right[:, :, None])[
        ..., 0
    ]
    left = -np.einsum("kp,kp->k", linear, right)
    return left, linear / scale


def _grid(tau: F8, y: F8, rate_hz: float, keep: int = 2) -> F8:
    """Start values (2 keep, 5): the best of a grid of oscillations and of rates near each other.

    On samples thinned with growing time, which stand for as many as lie about them.
    """
    rows = np.unique(np.concatenate([np.arange(min(60, tau.size)), np.geomspace(1, tau.size, 240).astype(int) - 1]))
    t, share = tau[rows], np.sqrt(np.gradient(rows.astype(np.float64)))
    rates = np.geomspace(1.0 / tau[-1], 0.5 * rate_hz, 24)
    near = np.array([(g, g * g * (1.0 - x)) for g in rates for x in (0.04, 0.3)])
    turning = np.array([(g, g * g * (1.0 + x * x)) for g in rates for x in (0.4, 1.0, 2.0, 4.0, 8.0, 16.0)])
    rate, stiffness = np.concatenate([near, turning]).T
    cosine, sine = basis(t, rate[:, None], (rate * rate - stiffness)[:, None])
    level = float(y[rows].mean())
    design = np.stack([np.ones_like(cosine), cosine + rate[:, None] * sine, sine], axis=1) * share
    left, linear = _linear_best(design, (y[rows] - level) * share)
    linear[:, 0] += level
    order = np.argsort(left)
    best = np.concatenate([order[order < len(near)][:keep], order[order >= len(near)][:keep]])
    theta: F8 = np.concatenate([linear, np.log(np.stack([rate, stiffness], axis=1))], axis=1)[best]
    return theta


def _beats_other_shapes(tau: F8, y: F8, fit: _Fit, noise: float, evidence: float) -> bool:
    """Whether the relaxation explains the record better than any polynomial, step or ramp does."""
    size = max(1, tau.size // POINTS)
    whole = tau.size // size * size
    t, values = tau[:whole].reshape(-1, size).mean(axis=1), y[:whole].reshape(-1, size).mean(axis=1)
    sigma = max(noise / math.sqrt(size), fit.noise / math.sqrt(size))
    shape = Decay(tau[:whole], np.ones((1, 5), np.bool_), critical=fit.critical)
    model = shape.evaluate(np.zeros(1, np.int64), fit.theta[None, :])[0][0]
    mine = float(np.sum((values - model.reshape(-1, size).mean(axis=1)) ** 2)) / sigma**2 + 5.0 * math.log(t.size)
    others = min(left / sigma**2 + count * math.log(t.size) for left, count in _other_shapes(t, values))
    return mine + evidence < others


def _other_shapes(t: F8, y: F8) -> Iterator[tuple[float, int]]:
    """Squares that other shapes leave, each with its number of parameters."""
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


def _kind(tau: F8, y: F8, fit: _Fit, rate_hz: float) -> tuple[Kind, _Fit] | NoOscillation:
    """Which kind of damping has the lowest BIC, and its fit, if a lone exponential does not do."""
    price = math.log(tau.size)
    slowest = fit.rate - math.sqrt(max(fit.square, 0.0))
    fall = np.exp(-slowest * tau)
    offset = float(fit.theta[0])
    start = np.array([[offset, float(fall @ (y - offset)) / float(fall @ fall), math.log(slowest)]])
    lone = minimise(Exponentials(tau, 1, 1), y, np.full(y.size, 1.0 / fit.noise), start)
    alone = float(lone.chi2[0]) + 3.0 * price
    one = _best(tau, y, fit.noise, rate_hz, fit.theta)
    critical = math.inf if one is None else one.chi2 + 4.0 * price
    free = fit.chi2 + 5.0 * price
    if min(critical, free) > alone - 6.0:
        rate = math.exp(lone.theta[0, 2])
        return NoOscillation(
            f"the distance follows one exponential, at {rate:.3g} 1/s: "
            "an overdamped motion whose fast part is over or too small, or a drift"
        )
    if one is not None and critical <= free:
        return "critical", one
    return ("overdamped" if fit.square > 0.0 else "strong"), fit


def _describe(fit: _Fit, kind: Kind, start_s: float, count: int, u_clock: float) -> Relaxation:
    rate, stiffness, square = fit.rate, fit.stiffness, fit.square
    root = math.sqrt(abs(square))

    def estimate(value: float, gradient: tuple[float, ...], unit: str, power: int = 0) -> Estimate:
        """Propagate to a function of (o, a, v, g, w) that goes as the clock's rate to some power."""
        slope = np.array(gradient) * np.array([1.0, 1.0, 1.0, rate, stiffness])
        return Estimate(value, math.hypot(math.sqrt(slope @ fit.covariance @ slope), power * u_clock * value), unit)

    spread = math.sqrt(fit.chi2 / max(count - 5, 1)) * fit.noise
    found = {
        "offset": estimate(float(fit.theta[0]), (1.0, 0.0, 0.0, 0.0, 0.0), "m"),
        "noise": Estimate(spread, spread / math.sqrt(2.0 * count), "m"),
    }
    natural = math.sqrt(stiffness)
    if kind == "critical":
        found["relaxation_rate"] = estimate(rate, (0.0, 0.0, 0.0, 1.0, 0.0), "1/s", 1)
        squared = estimate(stiffness, (0.0, 0.0, 0.0, 2.0 * rate, 0.0), "rad^2/s^2", 2)
        why = (
            f"the motion relaxes without oscillating, at {found['relaxation_rate']}: "
            "within its noise it is critically damped, with one rate"
        )
        return Relaxation(why, kind, Estimate(1.0, 0.0), squared, found, start_s)
    squared = estimate(stiffness, (0.0, 0.0, 0.0, 0.0, 1.0), "rad^2/s^2", 2)
    ratio = estimate(rate / natural, (0.0, 0.0, 0.0, 1.0 / natural, -0.5 * rate / natural**3), "")
    if kind == "overdamped":
        for name, sign in (("slow", -1.0), ("fast", 1.0)):
            gradient = (0.0, 0.0, 0.0, 1.0 + sign * rate / root, -sign * 0.5 / root)
            # Of the slow rate, rate - root would lose digits.
            value = rate + root if name == "fast" else stiffness / (rate + root)
            found[f"relaxation_rate_{name}"] = estimate(value, gradient, "1/s", 1)
        slow, fast = found["relaxation_rate_slow"], found["relaxation_rate_fast"]
        why = f"the motion is overdamped: it relaxes without oscillating, at {slow} and {fast}"
    else:
        _add_oscillation(found, fit, estimate)
        why = f"the oscillation is strongly damped: its damping ratio is {ratio}"
    return Relaxation(why, kind, ratio, squared, found, start_s)


class Estimator(Protocol):
    """Propagates the fit's covariance to one function of its parameters."""

    def __call__(self, value: float, gradient: tuple[float, ...], unit: str, power: int = 0) -> Estimate:
        """Return the estimate of a function with this value and this gradient."""
        ...


def _add_oscillation(found: dict[str, Estimate], fit: _Fit, estimate: Estimator) -> None:
    """Add what an oscillation has: omega^2 = w - g^2, and a cosine of a and a sine of -(v + g a)/omega."""
    rate, omega = fit.rate, math.sqrt(-fit.square)
    _, a, v = fit.theta[:3].tolist()
    by_rate, by_stiffness = -rate / omega, 0.5 / omega
    turn = 2.0 * math.pi
    found["angular_frequency"] = estimate(omega, (0.0, 0.0, 0.0, by_rate, by_stiffness), "rad/s", 1)
    found["frequency"] = estimate(omega / turn, (0.0, 0.0, 0.0, by_rate / turn, by_stiffness / turn), "Hz", 1)
    scale = -turn / omega**2
    found["period"] = estimate(turn / omega, (0.0, 0.0, 0.0, scale * by_rate, scale * by_stiffness), "s", 1)
    side = (v + rate * a) / omega
    by_side = np.array([0.0, rate / omega, 1.0 / omega, (a - side * by_rate) / omega, -side * by_stiffness / omega])
    along = np.array([0.0, 1.0, 0.0, 0.0, 0.0])
    amplitude = math.hypot(a, side)
    found["amplitude"] = estimate(amplitude, tuple((a * along + side * by_side) / amplitude), "m")
    found["phase"] = estimate(math.atan2(-side, a), tuple((side * along - a * by_side) / amplitude**2), "rad")
    found["damping_rate"] = estimate(rate, (0.0, 0.0, 0.0, 1.0, 0.0), "1/s", 1)
    natural = math.sqrt(fit.stiffness)
    quality = 0.5 * natural / rate
    found["quality_factor"] = estimate(quality, (0.0, 0.0, 0.0, -quality / rate, 0.25 / (natural * rate)), "")
