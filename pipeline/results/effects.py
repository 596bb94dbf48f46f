"""Effects: the possible effects at this bench, their predicted and measured sizes, and whether the model includes them.

The model includes an effect only if its predicted or measured size exceeds a tenth of the uncertainty that it would
affect. The table shows all effects, included or not, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.bench.added_mass import added_mass_kg, scene_air, scene_air_density
from pipeline.bench.air import air_viscosity, speed_of_sound
from pipeline.bench.derived_drag import STEADY_DISC_DRAG
from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.bench.spring import HEAVIEST_SHARE, oscillating_mass_kg
from pipeline.damping.select import Damping
from pipeline.motion.phase import PhaseFit
from pipeline.motion.waveform import Rest
from pipeline.numerics.quantity import amount, in_unit
from pipeline.registry.effects import check_effect
from pipeline.windows.disturbances import Disturbances

__all__ = ["Effect", "tabulate"]

SHARE = 0.1  # size from which the model includes an effect, over the uncertainty that the effect would change
SPEED_OF_SOUND_OF_RECORD = 344.0  # m/s, fixed in MotionSensor.vi
STEEL_KG_PER_M3 = 7850.0


@dataclass(frozen=True, slots=True)
class Effect:
    """One row of the effects table.

    Parameters
    ----------
    name : str
        One of :data:`pipeline.registry.effects.EFFECTS`.
    predicted : float or None
        Size that the scene predicts, in ``unit``; None if the scene does not determine it.
    measured : float or None
        Size measured in the record, in ``unit``; None if the record does not show it.
    unit : str
    included : bool
        Whether the model includes the effect.
    why : str
        The reason, one sentence.

    Raises
    ------
    ValueError
        If the name is not registered.
    """

    name: str
    predicted: float | None
    measured: float | None
    unit: str
    included: bool
    why: str

    def __post_init__(self) -> None:
        check_effect(self.name)


def tabulate(
    scene: Scene,
    damping: Damping,
    phase: PhaseFit,
    rest: Rest,
    *,
    noise_m: float,
    instrument: Instrument,
    disturbances: Disturbances | None = None,
) -> tuple[Effect, ...]:
    """Return the effects table.

    Parameters
    ----------
    scene, damping, phase, rest
        The bench, and outputs of the stages with the same names.
    noise_m : float
        Standard deviation of one sample, m.
    instrument : Instrument
        Clock and scale of the sensor.
    disturbances : Disturbances, optional
        Modes other than the main oscillation; None if they were not sought.
    """
    omega, unit = phase.angular_frequency, rest.mean.unit
    u_k = 2.0 * math.hypot(omega.u / omega.value, instrument.clock_rate.u)
    if scene.bob_mass_kg is not None:
        u_k = math.hypot(u_k, scene.bob_mass_kg.u / scene.bob_mass_kg.value)
    return (
        *_masses(scene, u_k),
        *_drags(scene, damping, omega.value, unit),
        _backbone(phase, damping),
        _rest_drift(rest, noise_m),
        *_modes(disturbances, unit),
        *((_buoyancy(scene, omega.value), _speed_of_sound(scene, instrument)) if unit == "m" else ()),
        _clock_rate(instrument),
    )


def _masses(scene: Scene, u_k: float) -> Iterator[Effect]:
    if scene.bob_mass_kg is None:
        for name in ("spring_mass", "added_mass"):
            yield Effect(name, None, None, "1", False, "the scene gives no bob mass, so no spring constant is derived")
        return
    mass = scene.bob_mass_kg.value
    if scene.spring_mass_kg is None:
        why = f"the scene gives no spring mass: k counts none, and u(k) a spring of 0 to {HEAVIEST_SHARE:g} of the bob"
        yield Effect("spring_mass", None, None, "1", False, why)
    else:
        share = oscillating_mass_kg(scene.spring_mass_kg.value, mass) / mass - 1.0
        yield _mass_effect("spring_mass", share, u_k, "of the spring's mass m_s/x^2 - m swings along, x tan x = m_s/m")
    if scene.disc_diameter_m is None:
        why = "the scene names no disc; the bob alone carries a negligible mass of air"
        yield Effect("added_mass", None, None, "1", False, why)
    else:
        share = added_mass_kg(scene) / mass
        yield _mass_effect("added_mass", share, u_k, "the disc carries (8/3) rho a^3 of air along")


def _mass_effect(name: str, share: float, u_k: float, what: str) -> Effect:
    included = share > SHARE * u_k
    relation = "more" if included else "less"
    why = f"{what}: {share:.2g} of the bob's mass, {relation} than a tenth of u(k)/k = {u_k:.2g}"
    return Effect(name, share, None, "1", included, why)


def _drags(scene: Scene, damping: Damping, omega: float, unit: str) -> Iterator[Effect]:
    gamma, beta, mu = (damping.best.drag_term(name) for name in ("gamma", "beta", "mu"))
    chosen = f"selected law: {damping.selected}; admissible: {', '.join(damping.admissible) or 'none'}"
    predicted_gamma = predicted_beta = None
    if scene.disc_diameter_m is not None and scene.bob_mass_kg is not None:
        radius, mass = 0.5 * scene.disc_diameter_m.value, scene.bob_mass_kg.value
        # Creeping flow past a disc that moves along its axis: F = 16 eta a v.
        celsius, pascal, _ = scene_air(scene)
        predicted_gamma = 8.0 * air_viscosity(celsius.value, pascal.value) * radius / mass
        b = 0.5 * STEADY_DISC_DRAG * scene_air_density(scene) * math.pi * radius**2
        # Converts to the recorded quantity: each time derivative is larger than the displacement by a factor omega.
        share = {"m": 1.0, "m/s": omega**-1, "m/s^2": omega**-2}.get(unit)
        predicted_beta = None if share is None else 4.0 * b * omega / (3.0 * math.pi * mass) * share
    yield Effect("viscous_drag", predicted_gamma, gamma, "1/s", gamma is not None, chosen)
    yield Effect("quadratic_drag", predicted_beta, beta, in_unit("1/(m s)", unit), beta is not None, chosen)
    tried = any(fit.drag_term("mu") is not None for fit in damping.fits.values())
    why = chosen if tried else "no law with friction is among those tried"
    yield Effect("friction", None, mu, in_unit("m/s", unit), mu is not None, why)


def _backbone(phase: PhaseFit, damping: Damping) -> Effect:
    name, unit = "amplitude_dependent_frequency", "1"
    if phase.backbone is None:
        why = "a constant frequency describes the phase: an ideal spring needs no more"
        return Effect(name, None, None, unit, False, why)
    start = damping.best.joint["A0"].value
    shift = phase.backbone.value * start**2 / phase.angular_frequency.value
    why = (
        f"the phase bends: the frequency shifts by {shift:.2g} of itself from rest to the first amplitude, "
        "with the square of the amplitude, far beyond its uncertainty"
    )
    return Effect(name, None, shift, unit, True, why)


def _rest_drift(rest: Rest, noise_m: float) -> Effect:
    unit = rest.mean.unit
    if not rest.drifts:
        why = f"a constant rest position describes the record (noise of one sample {amount(noise_m, unit)})"
        return Effect("rest_drift", None, rest.drift_m, unit, False, why)
    why = "the rest position moves more than its scatter allows; it is followed by a smooth curve"
    return Effect("rest_drift", None, rest.drift_m, unit, True, why)


def _modes(disturbances: Disturbances | None, unit: str) -> Iterator[Effect]:
    """Yield the effects of modes of other frequencies, and of harmonics and products of the main oscillation."""
    found = () if disturbances is None else disturbances.sideways.modes
    own = [mode for mode in found if mode.kind == "mode"]
    locked = [mode for mode in found if mode.kind != "mode"]
    names = (("sideways_mode", own, "mode of another frequency"), ("harmonics", locked, "harmonic or product"))
    for name, members, what in names:
        if disturbances is None or disturbances.sideways.carrier is None:
            yield Effect(name, None, None, unit, False, "not sought: too few periods, or not at this accuracy")
        elif not members:
            yield Effect(name, None, None, unit, False, f"no {what} stands out of what the main oscillation leaves")
        else:
            size = math.sqrt(sum(mode.amplitude.value**2 for mode in members))
            verdict = "more" if disturbances.modelled else "less"
            why = (
                f"{_count(len(members), what)}, together of this amplitude; the strongest line found would leave up to "
                f"{amount(disturbances.leak_m, unit)} in the main amplitude, {verdict} than a tenth of its uncertainty"
            )
            yield Effect(name, None, size, unit, disturbances.modelled, why)


def _count(number: int, what: str) -> str:
    return f"one {what}" if number == 1 else f"{number} times a {what}"


def _buoyancy(scene: Scene, omega: float) -> Effect:
    shift = scene_air_density(scene) / STEEL_KG_PER_M3 * 9.81 / omega**2
    why = "a constant force: it moves the rest position (a steel bob's by this much) and nothing else"
    return Effect("buoyancy", shift, None, "m", False, why)


def _speed_of_sound(scene: Scene, instrument: Instrument) -> Effect:
    record = instrument.speed_of_sound_m_per_s or SPEED_OF_SOUND_OF_RECORD
    why = "it scales every distance alike: amplitude and beta, not the spring constant"
    if instrument.u_scale > 0:
        why += "; the distances were calibrated, so the calibration's uncertainty stands in its place"
        return Effect("speed_of_sound", None, None, "1", False, why)
    if scene.air_temperature_c is None:
        bench = scene.tells_of_bench or instrument.speed_of_sound_m_per_s is not None
        counts = "a room's 20 +- 3 degC count, 0.5 % in the scale" if bench else "its 0.18 %/K stand in no uncertainty"
        why = f"the scene gives no air temperature, so {counts}: {why}"
        return Effect("speed_of_sound", None, None, "1", False, why)
    actual = speed_of_sound(*(each.value for each in scene_air(scene)))
    whose = "of the record" if instrument.speed_of_sound_m_per_s else "that old recordings take for granted"
    why += f"; relative to the {record:g} m/s {whose}; the air's uncertainty stands in theirs"
    if instrument.speed_of_sound_m_per_s:
        why += ", and so does the difference, which is not corrected"
    return Effect("speed_of_sound", actual / record - 1.0, None, "1", True, why)


def _clock_rate(instrument: Instrument) -> Effect:
    rate = instrument.clock_rate
    shift = None if rate.value == 1.0 else rate.value - 1.0
    return Effect("clock_rate", rate.u, shift, "1", True, instrument.clock_words)
