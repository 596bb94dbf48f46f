"""Derive: from frequency, amplitude and damping to what the experiment is about, with uncertainties."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.air import air_density, air_viscosity
from pipeline.condition import MAD_TO_SIGMA
from pipeline.damping import Damping, LawFit
from pipeline.demodulate import Demodulated
from pipeline.effects import Effect, added_mass_kg
from pipeline.estimate import Estimate
from pipeline.phase import PhaseFit
from pipeline.rest import Rest
from pipeline.scene import Scene
from pipeline.track import UNUSABLE, Quality

__all__ = ["Derived", "Params", "derive"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`derive`.

    Parameters
    ----------
    u_clock_nominal : float
        Relative standard uncertainty of a clock that nobody compared with another: a crystal's 50 ppm taken as
        half-width of a rectangle. It does not average away.
    u_air_temperature_k : float
        Standard uncertainty of an air temperature stated without one, K.
    """

    u_clock_nominal: float = 50e-6 / math.sqrt(3.0)
    u_air_temperature_k: float = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Derived:
    """Everything that Table 1 lists.

    Parameters
    ----------
    estimates : mapping of str to Estimate
        With every known contribution to the uncertainty, the clock's among them.
    statistical : mapping of str to Estimate
        From the record's own scatter alone (Type A), where that differs.
    effective_mass_kg : Estimate or None
        Mass that oscillates: bob, a third of the spring, air carried along, as far as the scene requires them.
    own_mass_kg, spring_share_kg : Estimate or None
        Its parts: what belongs to this run alone, and the share of the spring, which other runs have too.
    """

    estimates: Mapping[str, Estimate]
    statistical: Mapping[str, Estimate]
    effective_mass_kg: Estimate | None
    own_mass_kg: Estimate | None
    spring_share_kg: Estimate | None


def derive(
    demodulated: Demodulated,
    damping: Damping,
    phase: PhaseFit,
    rest: Rest,
    scene: Scene,
    effects: tuple[Effect, ...],
    *,
    clock: str,
    params: Params | None = None,
) -> Derived:
    """Propagate uncertainties to everything that is asked of a run.

    Parameters
    ----------
    demodulated, damping, phase, rest
        Outputs of the stages of those names.
    scene : Scene
        What is not known there leaves out what depends on it.
    effects : tuple of Effect
        Say which masses count.
    clock : str
        "nominal", "device" or "host".
    params : Params, optional

    Returns
    -------
    Derived

    Notes
    -----
    First-order propagation [1]_ through the ``uncertainties`` package:
    :math:`f = \\omega/2\\pi`, :math:`T = 2\\pi/\\omega`,
    :math:`k = (\\omega^2 + \\overline{\\lambda^2}) (m + m_s/3 + m_a)`,
    :math:`Q = \\omega/2\\lambda` with :math:`\\lambda = -\\dot A/A` at the start,
    :math:`v_\\mathrm{rms} = \\omega\\sqrt{\\overline{A^2}/2}`, :math:`Re = \\rho v_\\mathrm{rms} D/\\eta`,
    :math:`KC = 2\\pi A_0/D`, and for the drag coefficient :math:`C = 3\\pi m \\beta/(2 \\omega \\rho S)` [2]_.

    References
    ----------
    .. [1] JCGM 100:2008, "Guide to the expression of uncertainty in measurement".
    .. [2] K. Lelas, R. Pezer, arXiv:2502.07458.
    """
    from uncertainties import wrap

    params = params or Params()
    omega_stat = phase.angular_frequency
    rate_error = _variable(Estimate(1.0, params.u_clock_nominal if clock == "nominal" else 0.0))
    omega = _variable(omega_stat) * rate_error
    amplitude = damping.averaged({n: f.joint["A0"] for n, f in damping.considered.items()})
    decay = damping.averaged({n: f.damping_rate() for n, f in damping.considered.items()})
    start = _variable(amplitude)
    lam = _variable(decay) * rate_error
    v_rms = omega * _variable(_root_mean_square(damping.best, demodulated, damping.t0))
    found = {
        "period": (2 * math.pi / omega, "s"),
        "frequency": (omega / (2 * math.pi), "Hz"),
        "angular_frequency": (omega, "rad/s"),
        "amplitude": (start, "m"),
        "offset": (_variable(rest.mean), "m"),
        "phase": (_variable(phase.phase), "rad"),
        "noise": (_variable(_noise(demodulated)), "m"),
        "damping_rate": (lam, "1/s"),
        "velocity_rms": (v_rms, "m/s"),
    }
    if decay.value > 0:
        found["quality_factor"] = (omega / (2 * lam), "")
    # One variable for the diameter, wherever it enters: what it shares must cancel or add up.
    diameter = None if scene.disc_diameter_m is None else _variable(scene.disc_diameter_m)
    own, share = _masses(scene, effects, diameter)
    mass = None if own is None else own + (share or 0.0)
    if mass is not None:
        found["spring_constant"] = ((omega**2 + damping.squared_rate(demodulated.t)) * mass, "N/m")
    if diameter is not None:
        found["keulegan_carpenter_number"] = (2 * math.pi * start / diameter, "")
        if scene.air_temperature_c is not None:
            density, viscosity = wrap(air_density), wrap(air_viscosity)
            given_c = scene.air_temperature_c
            celsius = _variable(Estimate(given_c.value, given_c.u or params.u_air_temperature_k, "degC"))
            rho = density(celsius, *(_variable(x) for x in _air(scene)))
            found["reynolds_number"] = (rho * v_rms * diameter / viscosity(celsius), "")
            best = damping.best
            if damping.settled and "beta" in best.joint.names and mass is not None:
                beta = _variable(best.joint["beta"])
                area = math.pi * diameter**2 / 4
                found["drag_coefficient"] = (3 * math.pi * mass * beta / (2 * omega * rho * area), "")
    estimates = {name: _estimate(x, unit) for name, (x, unit) in found.items()}
    relative = omega_stat.u / omega_stat.value
    statistical = {
        name: Estimate(estimates[name].value, estimates[name].value * relative, estimates[name].unit)
        for name in ("period", "frequency", "angular_frequency")
    }
    effective, own_mass, spring_share = (None if m is None else _estimate(m, "kg") for m in (mass, own, share))
    return Derived(estimates, statistical, effective, own_mass, spring_share)


def _estimate(x: Any, unit: str) -> Estimate:
    from uncertainties import nominal_value, std_dev

    return Estimate(float(nominal_value(x)), float(std_dev(x)), unit)


def _air(scene: Scene) -> tuple[Estimate, Estimate]:
    return (
        scene.air_pressure_pa or Estimate(101325.0, 1500.0, "Pa"),
        scene.air_relative_humidity or Estimate(0.5, 0.2),
    )


def _variable(estimate: Estimate) -> Any:
    """The estimate as a variable of the ``uncertainties`` package; a plain number where it is exact."""
    from uncertainties import ufloat

    return ufloat(estimate.value, estimate.u) if estimate.u > 0 else estimate.value


def _masses(scene: Scene, effects: tuple[Effect, ...], diameter: Any) -> tuple[Any, Any]:
    """Bob with the air it carries, and a third of the spring, as far as the effects table includes them."""
    if scene.bob_mass_kg is None:
        return None, None
    own = _variable(scene.bob_mass_kg)
    included = {effect.name for effect in effects if effect.included}
    if "added_mass" in included and diameter is not None:
        from uncertainties import wrap

        own = own + wrap(lambda d: added_mass_kg(scene, d))(diameter)
    if "spring_mass" in included and scene.spring_mass_kg is not None:
        return own, _variable(scene.spring_mass_kg) / 3
    return own, None


def _noise(demodulated: Demodulated) -> Estimate:
    """Noise of one sample, m, from the residuals' median.

    Tails heavier than the normal distribution's make "the" standard deviation a matter of definition. The uncertainty
    holds the difference to the root mean square of the samples used, and what a share e of wide draws like those left
    out does to a median: 0.5 e / (2 phi(0.6745)) = 1.17 e of it.
    """
    used = (demodulated.flags & UNUSABLE) == 0
    residual = demodulated.residual[used]
    residual = residual[np.isfinite(residual)]
    dof = float(np.sum(np.maximum(demodulated.count - 3, 1)))
    value = MAD_TO_SIGMA * float(np.median(np.abs(residual))) * math.sqrt(residual.size / dof)
    wide = float(np.mean((demodulated.flags & Quality.FALSE_ECHO) != 0))
    parts = (1.17 * value / math.sqrt(2.0 * dof), demodulated.noise_m - value, 1.17 * wide * value)
    return Estimate(value, math.hypot(*parts), "m")


def _root_mean_square(fit: LawFit, demodulated: Demodulated, t0: float) -> Estimate:
    """Of the displacement over the windows, m, with its standard uncertainty."""
    t = demodulated.t - t0
    amplitude = fit.amplitude(t)
    value = math.sqrt(float(np.mean(amplitude**2)) / 2.0)
    if value == 0.0:
        return Estimate(0.0, 0.0, "m")
    gradient = np.mean(amplitude[:, None] * fit.law.jacobian(t, fit.joint.values), axis=0) / (2.0 * value)
    return Estimate(value, math.sqrt(max(float(gradient @ fit.joint.covariance @ gradient), 0.0)), "m")
