"""What follows from an overdamped motion: rates, frequencies and the spring constant with their uncertainties."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from pipeline.bench.added_mass import added_mass_kg
from pipeline.bench.scene import Scene
from pipeline.motion.overdamped.decay_fit import DecayFit
from pipeline.numerics.estimate import Estimate

__all__ = ["Kind", "Overdamped", "described", "spring_constant"]

Kind = Literal["overdamped", "critical", "strong"]


@dataclass(frozen=True, slots=True)
class Overdamped:
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

    why: str
    kind: Kind
    damping_ratio: Estimate
    squared_frequency: Estimate
    estimates: Mapping[str, Estimate]
    start_s: float


def described(fit: DecayFit, kind: Kind, start_s: float, count: int, u_clock: float) -> Overdamped:
    """Return what follows from a fit.

    Parameters
    ----------
    fit : DecayFit
    kind : {"overdamped", "critical", "strong"}
    start_s : float
        From where the motion was followed, s.
    count : int
        Of samples.
    u_clock : float
        Relative standard uncertainty of the clock.
    """
    rate, stiffness, square = fit.rate, fit.stiffness, fit.square
    root = math.sqrt(abs(square))

    def estimate(value: float, gradient: tuple[float, ...], unit: str, power: int = 0) -> Estimate:
        """Propagate to a function of (o, a, v, g, w) that goes as the clock's rate to some power."""
        slope = (np.array(gradient) * np.array([1.0, 1.0, 1.0, rate, stiffness]))[: fit.theta.size]
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
        return Overdamped(why, kind, Estimate(1.0, 0.0), squared, found, start_s)
    squared = estimate(stiffness, (0.0, 0.0, 0.0, 0.0, 1.0), "rad^2/s^2", 2)
    ratio = estimate(rate / natural, (0.0, 0.0, 0.0, 1.0 / natural, -0.5 * rate / natural**3), "")
    if kind == "overdamped":
        for name, sign in (("slow", -1.0), ("fast", 1.0)):
            gradient = (0.0, 0.0, 0.0, 1.0 + sign * rate / root, -sign * 0.5 / root)
            value = rate + root if name == "fast" else fit.slowest
            found[f"relaxation_rate_{name}"] = estimate(value, gradient, "1/s", 1)
        slow, fast = found["relaxation_rate_slow"], found["relaxation_rate_fast"]
        why = f"the motion is overdamped: it relaxes without oscillating, at {slow} and {fast}"
    else:
        _add_oscillation(found, fit, estimate)
        why = f"the oscillation is strongly damped: its damping ratio is {ratio}"
    return Overdamped(why, kind, ratio, squared, found, start_s)


class Estimator(Protocol):
    """Propagates the fit's covariance to one function of its parameters."""

    def __call__(self, value: float, gradient: tuple[float, ...], unit: str, power: int = 0) -> Estimate:
        """Return the estimate of a function with this value and this gradient."""
        ...


def _add_oscillation(found: dict[str, Estimate], fit: DecayFit, estimate: Estimator) -> None:
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


def spring_constant(found: Overdamped, scene: Scene) -> dict[str, Estimate]:
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
