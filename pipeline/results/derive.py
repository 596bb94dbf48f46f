"""Derive: from frequency, amplitude and damping to the results of the experiment, with uncertainties."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from uncertainties import correlated_values, wrap

from pipeline.bench.clock_rate import clock_rate
from pipeline.bench.scene import Scene
from pipeline.bench.sensor_filter import SensorFilter
from pipeline.bench.spring import unstated_spring_kg
from pipeline.checks.residual import Misfit
from pipeline.damping.average import Weighted, average_over_laws, scaled
from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import Drag, Law, free_power
from pipeline.damping.laws.drag import COEFFICIENTS
from pipeline.damping.local import local_decay
from pipeline.damping.select import Damping
from pipeline.motion.at_rest import Rest
from pipeline.motion.fitted import Oscillation, Phase
from pipeline.motion.kinds import Motion
from pipeline.motion.lines import TwoModes
from pipeline.motion.relaxation import Relaxation
from pipeline.numerics.estimate import Estimate, Joint, UpperLimit
from pipeline.numerics.levels import LIMIT
from pipeline.numerics.robust import U_OF_MAD, mad_sigma
from pipeline.quantities import QUANTITIES
from pipeline.results.ambient import Ambient
from pipeline.results.budget import Budget, Inputs, joint_of
from pipeline.results.closed_form import closed_form
from pipeline.results.effects import Effect
from pipeline.results.formulas import solve
from pipeline.track import F8, UNUSABLE, Quality, Track
from pipeline.windows.demodulate import Windows


@dataclass(frozen=True, eq=False)
class Derived:
    """The results in Table 1, and the factors that curves and comparisons need; None if the scene determines none."""

    # Estimates with all known contributions to the uncertainty, including clock and scale.
    estimates: Mapping[str, Estimate]
    budgets: Mapping[str, Budget]  # contributions of the inputs to every estimate and coefficient
    scales: tuple[Any, Any]  # variables: the factors that convert rates and lengths of the record to true s and m
    # Coefficients of one law, with all known contributions; coefficients that are not determined are upper limits. The
    # law is the stated one if there is one, or the only admissible one. Otherwise it is linear and quadratic drag
    # together if the record allows it, or the selected law.
    coefficients: Mapping[str, Estimate] = field(default_factory=dict)
    laws: tuple[Weighted, ...] = ()  # over which amplitude and damping rate are averaged
    # Name of the law by which the results are stated; empty if they are an average over laws. They count as an average
    # also if the record selects one drag and the results use both, of which it is a special case.
    law: str = ""
    law_of_coefficients: str = ""  # name of the law of ``coefficients``
    # Whether the coefficients may be quoted: their law is stated, the only one that the record admits, or if it admits
    # none, far nearer than the others.
    quoted: bool = False
    # Bob, and the air and the share of the spring that the effects table includes, and the same without the spring.
    effective_mass_kg: Estimate | None = None
    own_mass_kg: Estimate | None = None
    # Mechanical energy over the squared recorded amplitude, N/m for a length; per kilogram if no mass is known.
    half_stiffness: Estimate | None = None
    # Displacement over the recorded value: 1 for a length, in s for a velocity, in s^2 for an acceleration.
    displacement: Estimate | None = None
    drag_length: Estimate | None = None  # drag coefficient over :math:`-\\dot A/A^2` of the recorded amplitude

    @cached_property
    def of_law(self) -> frozenset[str]:
        """Names of the estimates that depend on the damping law."""
        inputs = {name: {c.name for c in self.budgets[name].contributions} for name in self.estimates}
        return frozenset(name for name, own in inputs.items() if own & {"damping_law", "choice_of_law"})

    def parameters_of(self, fit: LawFit) -> dict[str, Estimate]:
        """Return the parameters of a law by name, in true seconds and metres, with all known contributions.

        Those of the law of the results are the results themselves; coefficients that are not determined are upper
        limits.
        """
        coefficients = self.coefficients if self.law_of_coefficients == fit.name else {}
        if self.law == fit.name:
            return {"A0": self.estimates["amplitude"], **coefficients}
        joint = scaled(fit).joint
        variables = list(correlated_values(joint.values.tolist(), joint.covariance))
        found = in_true_units(fit.law, joint, variables, *self.scales)
        own = {name: limited(fit.law, name, Estimate.of_variable(*x)) for name, x in found.items()}
        return {**own, **coefficients}

    @cached_property
    def statistical(self) -> Mapping[str, Estimate]:
        """The estimates with only the part of their uncertainties from scatter of the recording (type A)."""
        return {name: Estimate(e.value, self.budgets[name].u_of("A"), e.unit) for name, e in self.estimates.items()}

    @cached_property
    def joint(self) -> Joint:
        """All estimates and coefficients with their covariance; an estimate replaces a coefficient of the same name."""
        return joint_of({**self.coefficients, **self.estimates})

    @property
    def amplitude_scale(self) -> float:
        """Factor from amplitudes of the record to those of the motion, before the filter of a sensor."""
        return Estimate.of_variable(self.scales[1], "").value


def derive(
    track: Track, motion: Motion, scene: Scene, effects: tuple[Effect, ...], misfits: tuple[Misfit, ...]
) -> Derived:
    """Calculate the results of a run by :mod:`pipeline.results.formulas`, and propagate their uncertainties.

    Results that depend on values missing in the scene are left out; the effects table says which masses are included.
    Misfits are inputs of kind B with the mean zero. Uncertainties are propagated to first order (JCGM 100:2008) by the
    ``uncertainties`` package, with one variable for each input. The clock's rate r and the scale s of the distances are
    uncertain: :math:`\\omega = r\\omega_r`, :math:`A_0 = s a_0` and :math:`\\beta = r b/s`, each from the record.

    The quality factor is exact for linear drag; for other laws it is :math:`2\\pi` times the energy over the loss in a
    period, to first order in the damping. The drag coefficient is that of K. Lelas, R. Pezer, arXiv:2502.07458.

    Results that depend on the damping law are averages over laws (:func:`pipeline.damping.average.average_over_laws`):
    :math:`x = \\sum_i w_i x_i` and :math:`u^2 = \\sum_i w_i (u_i^2 + (x_i - x)^2)`.
    """
    inputs = Inputs()
    if not isinstance(motion, Oscillation):
        of_scene = _of_scene(track, scene, {"added_mass", "spring_mass"}, inputs)
        every = _closed(motion, track, of_scene, inputs)
        return _derived(every, inputs, track.unit)
    laws = _Laws(motion.damping, inputs, motion.windows)
    of_scene = _of_scene(track, scene, {effect.name for effect in effects if effect.included}, inputs)
    every = solve(of_scene | _of_motion(track, motion, misfits, laws, inputs))
    derived, alone = _derived(every, inputs, track.unit), len(laws.weighted) == 1
    shown = {name: derived.budgets[name].estimate for name in every.get("coefficients", {})}
    return replace(
        derived,
        coefficients={name: limited(laws.shown.law, name, estimate) for name, estimate in shown.items()},
        laws=laws.weighted,
        law=laws.stated.name if alone and laws.stated.name == motion.damping.selected else "",
        law_of_coefficients=laws.shown.name,
        quoted=laws.quoted,
    )


def _derived(every: Mapping[str, Any], inputs: Inputs, unit: str) -> Derived:
    """Return all results with their budgets."""
    found = {name: (every[name], _unit_of(name, unit)) for name in QUANTITIES if name in every}
    budgets = {n: inputs.budget(n, x, own) for n, (x, own) in (found | every.get("coefficients", {})).items()}
    return Derived(
        estimates={name: budgets[name].estimate for name in found},
        budgets=budgets,
        scales=(every["rates"], every["lengths"]),
        **{name: Estimate.of_variable(every[name], _unit_of(name, unit)) for name in _PARTS if name in every},
    )


def _closed(
    motion: Relaxation | TwoModes | Rest, track: Track, of_scene: dict[str, Any], inputs: Inputs
) -> dict[str, Any]:
    """Return the results of a motion without laws, with the clock, scale and zero of the instrument."""
    rate, scale = inputs.add("clock_rate", clock_rate(track).rate, "B"), of_scene["distance_scale"]
    x = dict(zip(motion.joint.names, inputs.add_joint("fitted_motion", motion.joint, motion.dof), strict=True))
    known = {
        "time_factor": rate,
        "rest_position": x["rest"],
        "offset_misfit": 0.0,
        "noise_of_samples": inputs.add("noise", motion.noise, "A", motion.dof),
    }
    of_motion, results = closed_form(motion, x, rate=rate, scale=scale)
    return solve(of_scene | known | of_motion) | results | {"rates": rate, "lengths": scale}


def limited(law: Law, name: str, estimate: Estimate) -> Estimate:
    """Return a parameter of a law; a coefficient that the record does not determine becomes an upper limit."""
    return estimate if name in ("A0", free_power(law)) else UpperLimit.of(estimate)


# What curves and comparisons need besides the estimates; names of attributes of :class:`Derived`.
_PARTS = ("displacement", "half_stiffness", "effective_mass_kg", "own_mass_kg", "drag_length")


def _unit_of(name: str, unit: str) -> str:
    """Return the unit of a result for a record in a unit."""
    if name == "velocity_rms" and unit.startswith("rad"):
        return "rad/s"
    if name in QUANTITIES:
        return QUANTITIES[name].unit_in(unit)
    of_length = {
        "displacement": ("", "s", "s^2"),
        "half_stiffness": ("N/m", "J s^2/m^2", "J s^4/m^2"),
        "drag_length": ("m", "m/s", "m/s^2"),
    }
    return of_length[name][_LENGTHS.index(unit)] if name in of_length else "kg"


_LENGTHS = ("m", "m/s", "m/s^2")  # units in which a displacement, or a derivative of it, is recorded


def _of_motion(
    track: Track, fitted: Oscillation, misfits: tuple[Misfit, ...], laws: _Laws, inputs: Inputs
) -> dict[str, Any]:
    """Return the inputs of the formulas that the recording and its fit give; None for what they do not determine."""
    windows, damping, phase, rest = fitted.windows, fitted.damping, fitted.phase, fitted.rest
    unit, amiss = track.unit, _amiss(misfits, inputs)

    def less_certain(name: str, value: float) -> Any:
        """Return a factor of mean 1 that adds the uncertainty from the misfits to an estimate of this value."""
        return 1.0 + amiss[name] / float(value) if value else 1.0

    count = phase.residual.size
    # With one or two windows the uncertainty comes from the samples.
    free = (count - 2) / phase.correlation if count > 2 else windows.residual.size - 3.0 * count
    slope = inputs.add("angular_frequency", phase.angular_frequency, "A", free)
    bend = phase.bend
    small, apart = phase.small_swings, 0.0 if bend is None else bend.apart / phase.angular_frequency.value
    return {
        "phase_slope": slope,
        "small_swings": None if small is None else inputs.add("small_swings", small, "A", free),
        "squared_rate": fitted.squared_rate,
        "time_factor": inputs.add("clock_rate", clock_rate(track).rate, "B") * (1.0 + amiss["clock"]),
        "amplitude_factor": less_certain("amplitude", laws.values[0]),
        "rate_factor": less_certain("damping_rate", laws.values[1]),
        "law": laws.coefficients,
        "law_start": laws.start,
        "law_rate": laws.rate_at_start if phase.walk is None else None,
        "law_rms": laws.root_mean_square,
        "decays": laws.values[1] > 0 or None,
        "beta_settled": (damping.settled and damping.best.drag_term("beta") is not None) or None,
        "crest": _crest(fitted, unit, inputs),
        "stiffness_factor": 1.0 + 2.0 * inputs.add("mean_frequency", Estimate(0.0, apart, ""), "B") if apart else 1.0,
        "rest_position": inputs.add("rest_position", rest.mean, "A", free),
        "offset_misfit": amiss["offset"],
        "start_phase": _start_phase(phase, slope, inputs, free),
        "phase_misfit": amiss["phase"],
        "noise_of_samples": inputs.add("noise", _noise(windows, unit), "A", windows.residual.size - 3.0 * count),
        # The order of the time derivative that was recorded; it is unknown for a voltage or a force.
        "order": {"m": 0, "rad": 0, "m/s": 1, "rad/s": 1, "m/s^2": 2}.get(unit),
        "of_length": unit in _LENGTHS or None,
        "of_angle": unit in ("rad", "rad/s") or None,
        "of_pendulum": phase.of_pendulum or unit in ("rad", "rad/s") or None,
    }


def _of_scene(track: Track, scene: Scene, included: set[str], inputs: Inputs) -> dict[str, Any]:
    """Return the inputs of the formulas that the scene gives; None for what it does not state."""
    air = Ambient(scene, inputs)

    def stated(name: str, value: Estimate | None) -> Any:
        return None if value is None else inputs.add(name, value, "B")

    bob, spring = scene.bob_mass_kg, scene.spring_mass_kg
    unstated = None if bob is None or spring is not None else unstated_spring_kg(bob.value)
    return {
        "air": air,
        "known_air": air if air.known else None,
        "distance_scale": air.scale(track) if track.unit == "m" else 1.0,
        "sensor_zero": inputs.add("sensor_zero", Estimate(0.0, track.u_offset_m, track.unit), "B"),
        "sensor_filter": _filter(SensorFilter.of(scene, track.rate_hz), inputs),
        "pendulum_length": stated("pendulum_length", scene.pendulum_length_m),
        "disc_diameter": stated("disc_diameter", scene.disc_diameter_m),
        "bob_mass": stated("bob_mass", bob),
        "spring_mass": stated("spring_mass", spring) if "spring_mass" in included else None,
        "unstated_spring_mass": stated("unstated_spring_mass", unstated),
        "of_added_mass": "added_mass" in included or None,
        # An angle may be that of a pendulum, so a spring constant is given only if the scene has a spring.
        "of_spring": (scene.hangs_on_spring and not track.unit.startswith("rad")) or spring is not None or None,
    }


def _crest(fitted: Oscillation, unit: str, inputs: Inputs) -> Any:
    """Return the largest angle of the first swing over the amplitude of its sinusoid.

    A stiffness that changes as the square of the amplitude gives a third harmonic of a twelfth of the shift of the
    frequency: half of a per cent for a pendulum at 60 degrees. Half of it is its uncertainty, because the frequency may
    change for another reason.
    """
    if not fitted.phase.of_amplitude or unit != "rad":
        return 1.0
    third = fitted.shift / 12.0
    return 1.0 + inputs.add("crest", Estimate(third, 0.5 * abs(third), ""), "B")


def _amiss(misfits: tuple[Misfit, ...], inputs: Inputs) -> Mapping[str, Any]:
    """Return the misfits as inputs: a variable of mean zero for each estimate, by name."""
    by_name: dict[str, Any] = defaultdict(float)
    for misfit in misfits:
        for name, variable in inputs.add_errors(misfit.name, misfit.sizes).items():
            by_name[name] += variable
    return by_name


def _filter(smoothing: SensorFilter | None, inputs: Inputs) -> Callable[[Any], tuple[Any, Any]]:
    """Return gain and delay, rad, of the sensor's filter as a function of the angular frequency."""
    if smoothing is None:
        return lambda _: (1.0, 0.0)
    sizes = [
        inputs.add(name, size, "B") if size.u > 0.0 else size.value
        for name, size in (("sensor_mean_samples", smoothing.mean_samples), ("sensor_lag", smoothing.lag_s))
    ]
    return lambda omega: (wrap(smoothing.gain)(omega, *sizes), wrap(smoothing.delay)(omega, *sizes))


class _Laws:
    """Inputs that depend on the damping law: start amplitude, damping rate, rms displacement and coefficients."""

    def __init__(self, damping: Damping, inputs: Inputs, windows: Windows) -> None:
        elapsed, best = windows.t - damping.t0, damping.best
        every = average_over_laws(damping, math.sqrt(float(np.mean(windows.amplitude**2))))
        found = [(one, *_of_law(one.fit, elapsed)) for one in every]
        # A law that is infinite within the record cannot be averaged with the others.
        found = [(one, values, slopes) for one, values, slopes in found if np.isfinite(values @ slopes).all()]
        if not found:
            found = [(Weighted(best, 1.0), *_of_law(best, elapsed))]
        self.weighted = tuple(one for one, *_ in found)
        self.stated = self.weighted[0].fit
        ahead = not damping.admissible and self.weighted[0].weight >= LIMIT
        self.quoted = damping.by_statement or damping.settled or ahead
        self.shown = best if self.quoted else self.stated
        each = np.array([values for _, values, _ in found])
        weights = np.array([one.weight for one in self.weighted])
        weights /= weights.sum()
        self.values: F8 = weights @ each
        self.variables = inputs.add_joint("damping_law", self.stated.joint, self.stated.dof)
        departures = [x - value for x, value in zip(self.variables, self.stated.joint.values.tolist(), strict=True)]
        slopes = math.sqrt(weights[0]) * found[0][2]
        quantities = self.values + slopes @ np.array(departures)
        if weights.size > 1:
            factors = [by_parameters @ _root(one.fit.joint.covariance) for one, _, by_parameters in found]
            apart = each - self.values
            covariance = (weights[:, None] * apart).T @ apart
            for factor, one, weight in zip(factors, self.weighted, weights, strict=True):
                if one.fit is not self.stated:
                    covariance += weight * factor @ factor.T
            joint = Joint(("amplitude", "damping_rate", "displacement"), np.zeros(3), covariance, ("m", "1/s", "m"))
            quantities = quantities + np.array(inputs.add_joint("choice_of_law", joint))
        self.start, self.rate_at_start, self.root_mean_square = quantities.tolist()
        if damping.by_statement or damping.admissible:
            return
        expected = self.stated.amplitude(elapsed)
        local = local_decay(elapsed, windows.amplitude, expected, damping.scatter, best.joint.units[0])
        if local is not None:
            self.values = np.array([*local.values, self.values[2]])
            self.start, self.rate_at_start = inputs.add_joint("local_decay", local)

    def coefficients(self, rate: Any, scale: Any, lam: Any, start: Any) -> dict[str, tuple[Any, str]]:
        """Return the coefficients of the law of the results, in true seconds and metres.

        If the record shows one drag only, c A^n, and the results allow for a little of another one, c follows from
        them: :math:`\\lambda A_0 = c A_0^n`.
        """
        found = in_true_units(self.stated.law, self.stated.joint, self.variables, rate, scale)
        shown = self.shown.law
        if shown is not self.stated.law and isinstance(shown, Drag):
            return {COEFFICIENTS[n]: (lam / start ** (n - 1), found[COEFFICIENTS[n]][1]) for n in shown.powers}
        return {name: found[name] for name in self.stated.joint.names[1:]}


def _root(covariance: F8) -> F8:
    """Return R such that R R^T is the covariance (p, p), so that products give no negative variance at any scaling."""
    u = np.sqrt(np.diag(covariance))
    scale = np.where(u > 0.0, u, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _of_law(fit: LawFit, elapsed: F8) -> tuple[F8, F8]:
    """Return start amplitude, damping rate at the start and rms displacement, (3,), and their derivatives (3, p)."""
    amplitude, jacobian = fit.law.curve(elapsed, fit.joint.values)
    size = math.sqrt(float(amplitude @ amplitude) / (2.0 * elapsed.size))
    with np.errstate(invalid="ignore"):  # a law that is infinite within the record is left out of the average
        by_size = amplitude @ jacobian / max(2.0 * elapsed.size * size, 1e-300)
    by_start = np.eye(1, fit.joint.values.size)[0]
    values = np.array([fit.joint.values[0], fit.rate_at_start(), size])
    return values, np.stack([by_start, fit.slopes_of_rate(), by_size])


def _start_phase(phase: Phase, slope: Any, inputs: Inputs, dof: float) -> Any:
    """Return the phase at the start, from the phase in the middle of the fitted line and the error of its slope."""
    omega, at_start = phase.angular_frequency, phase.phase
    way = phase.t0 - phase.middle
    if omega.u > 0:
        way = math.copysign(min(abs(way), at_start.u / omega.u), way)
    own = math.sqrt(max(at_start.u**2 - (way * omega.u) ** 2, 0.0))
    return inputs.add("phase", Estimate(at_start.value, own, at_start.unit), "A", dof) + way * (slope - omega.value)


def in_true_units(law: Law, joint: Joint, variables: list[Any], rate: Any, scale: Any) -> dict[str, tuple[Any, str]]:
    """Return the parameters of a law in true seconds and metres, with their units."""
    values = dict(zip(joint.names, variables, strict=True))
    found: dict[str, tuple[Any, str]] = {}
    for name, printed in zip(joint.names, joint.units, strict=True):
        unit = law.parameters[name]
        metres = unit.metre - values[unit.less] if unit.less else unit.metre
        found[name] = (values[name] * scale**metres * rate**-unit.second, printed)
    return found


def _noise(windows: Windows, unit: str) -> Estimate:
    """Return the noise of one sample, from the median of the absolute residuals.

    For a distribution with heavy tails, the standard deviation is a matter of definition. So the uncertainty is no less
    than the difference to the root mean square of the samples used. It also includes the relative error of the median
    if a share e of the samples are outliers like those left out.
    """
    flags, residual = windows.flags, windows.residual
    clean = not flags.any()
    if not clean:
        residual = residual[(flags & UNUSABLE) == 0]
    finite = np.isfinite(residual)
    if not finite.all():
        residual = residual[finite]
    used = residual.size
    dof = float(max(used - 3 * windows.count.size, windows.count.size))
    value = mad_sigma(residual) * math.sqrt(used / dof)
    wide = 0.0 if clean else np.count_nonzero(flags & np.uint8(Quality.FALSE_ECHO)) / flags.size
    u = max(U_OF_MAD * value / math.sqrt(dof), abs(windows.noise - value))
    return Estimate(value, math.hypot(u, U_OF_MAD * wide * value), unit)
