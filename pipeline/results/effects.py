"""Effects: the possible effects at this bench, their predicted and measured sizes, and whether the model includes them.

An analysis includes an effect only if its predicted or measured size exceeds a tenth of the uncertainty that it would
affect. In a simulation the size is the largest change of the displacement over the run without the effect, over the
starting amplitude. The table shows all effects, included or not, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.bench.air import speed_of_sound
from pipeline.bench.clock_rate import ClockRate, clock_rate
from pipeline.bench.disc import SOURCES, DerivedDrag, added_mass_kg, disc_rate, scene_air, scene_air_density
from pipeline.bench.scene import Scene
from pipeline.bench.spring import GRAVITY_M_PER_S2, HEAVIEST_SHARE, oscillating_mass_kg
from pipeline.damping.laws.drag import amplitudes
from pipeline.damping.select import Damping
from pipeline.dynamics.equation import Problem
from pipeline.modes.mode import Modes
from pipeline.motion.fitted import Oscillation, RestPosition
from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.track import Track
from pipeline.units import amount

STEEL_KG_PER_M3 = 7850.0  # EN 1993-1-2 (2005), 3.2.2
# Relative decrease of the modulus of rigidity of steel with temperature, 1/K: G. H. Keulegan, M. R. Houseman, J. Res.
# NBS 10 (1933) 289.
SOFTER_PER_K = 2.6e-4


@dataclass(frozen=True, slots=True)
class Effect:
    """One row of the effects table; a size is None where the scene does not determine it or the record not show it."""

    name: str
    predicted: float | None
    measured: float | None
    unit: str
    included: bool
    why: str


def tabulate(track: Track, fitted: Oscillation, scene: Scene) -> tuple[Effect, ...]:
    """Return the effects table of an analysis."""
    phase, damping, unit, clock = fitted.phase, fitted.damping, track.unit, clock_rate(track)
    omega = phase.angular_frequency
    u_k = 2.0 * math.hypot(omega.u / omega.value, clock.rate.u)
    if scene.bob_mass_kg is not None:
        u_k = math.hypot(u_k, scene.bob_mass_kg.u / scene.bob_mass_kg.value)

    def counted(name: str, share: float, what: str) -> Effect:
        included = share > NEGLIGIBLE * u_k
        relation = "more" if included else "less"
        why = f"{what}: {share:.2g} of the bob's mass, {relation} than a tenth of u(k)/k = {u_k:.2g}"
        return Effect(name, share, None, "1", included, why)

    return (
        *_masses(scene, counted),
        _disc_drag(scene, damping, omega.value, unit),
        _damping(fitted),
        _bend(fitted),
        _rest_drift(fitted.rest, fitted.windows.noise),
        *_modes(fitted.modes, unit),
        *((_buoyancy(scene, omega.value, 1.0, "m"), _speed_of_sound(scene, track)) if unit == "m" else ()),
        _clock_rate(clock),
    )


def simulated_effects(scene: Scene, problem: Problem, seconds: float, drag: DerivedDrag | None) -> tuple[Effect, ...]:
    """Return the effects table of a simulation, which solves all terms of the equation.

    Leaving out a share s of the mass shifts the
    phase by :math:`s\\omega T/2` over a run of duration T, which changes the displacement by up to twice the sine of
    half of it. If the suspended length l is within 1.5 amplitudes of :math:`4g/\\omega^2`, any small sideways motion
    grows at the rate :math:`3\\omega A/8l` (P. Lynch, Int. J. Non-Linear Mech. 37 (2002) 345).
    """
    omega, start = problem.equation.angular_frequency_per_s, problem.amplitude_m()

    def turned(share: float) -> float:
        return 2.0 * math.sin(min(0.25 * share * omega * seconds, 0.5 * math.pi))

    def moved(name: str, share: float, what: str) -> Effect:
        return Effect(name, turned(share), None, "1", True, f"{what}: {share:.2g} of the bob's mass")

    u_kelvin, length = scene_air(scene)[0].u, 4.0 * GRAVITY_M_PER_S2 / omega**2
    softer = f"the air's u of {u_kelvin:g} K makes a steel spring softer by {SOFTER_PER_K * u_kelvin:.1g}"
    swings = (
        f"the scene gives no length; suspended {length:.3g} m +- {1.5 * start:.2g} m below its point the bob would "
        "swing sideways at half the frequency (2:1), and a small swing would grow at this rate"
    )
    return (
        *_masses(scene, moved),
        _disc(scene, problem, seconds, drag),
        *_forces(problem, seconds),
        Effect("temperature", turned(SOFTER_PER_K * u_kelvin), None, "1", False, softer),
        Effect("sideways_mode", 0.375 * omega * start / length, None, "1/s", False, swings),
        _buoyancy(scene, omega, start, "1"),
    )


def _masses(scene: Scene, judge: Callable[[str, float, str], Effect]) -> Iterator[Effect]:
    """Yield the effects of the masses that swing along, judged by name, share of the bob's mass, and what it is."""
    if scene.bob_mass_kg is None:
        for name in ("spring_mass", "added_mass"):
            yield Effect(name, None, None, "1", False, "the scene gives no bob mass, so no spring constant is derived")
        return
    mass = scene.bob_mass_kg.value
    if scene.spring_mass_kg is None:
        why = (
            f"the scene gives no spring mass: none is counted, and an analysis allows for {HEAVIEST_SHARE:g} of the bob"
        )
        yield Effect("spring_mass", None, None, "1", False, why)
    else:
        share = oscillating_mass_kg(scene.spring_mass_kg.value, mass) / mass - 1.0
        yield judge("spring_mass", share, "of the spring's mass m_s/x^2 - m swings along, x tan x = m_s/m")
    if scene.disc_diameter_m is None:
        why = "the scene names no disc; the bob alone carries a negligible mass of air"
        yield Effect("added_mass", None, None, "1", False, why)
    else:
        yield judge("added_mass", added_mass_kg(scene) / mass, "the disc carries (8/3) rho a^3 of air along")


def _disc(scene: Scene, problem: Problem, seconds: float, drag: DerivedDrag | None) -> Effect:
    """Return the effect of the disc's drag: the largest change of the amplitude without it."""
    if scene.disc_diameter_m is None:
        hint = "" if any(problem.equation.laws()) else "; nothing damps the motion: add [disc] or [damping]"
        return Effect("disc_drag", None, None, "1", False, f"the scene names no disc{hint}")
    if drag is None:
        return Effect("disc_drag", None, None, "1", True, "[damping] is stated, the disc's drag with it")
    start = problem.amplitude_m() or 1.0
    law = np.array([[start, 0.0, *drag.joint.values]])  # it is derived where nothing else damps
    size = 1.0 - float(amplitudes(np.array([0.0, seconds]), law)[0, 1]) / start
    return Effect("disc_drag", size, None, "1", True, f"no [damping] is stated: derived, {drag.words}")


def _forces(problem: Problem, seconds: float) -> Iterator[Effect]:
    """Yield each force of the equation with a bound on the change of the displacement without it, over the amplitude.

    With :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)` the bounds are :math:`\\gamma T + \\gamma^2 T/2\\omega`,
    :math:`\\beta A_0 T`, :math:`\\mu T/A_0` and, through the phase, :math:`3|c|A_0^2T/8\\omega`. Variations within a
    cycle add about one radian to the time T. With a cubic term an error of the amplitude changes the frequency, and the
    other bounds are multiplied by the phase drift that this causes.
    """
    eq, start = problem.equation, problem.amplitude_m()
    gamma, beta, mu = eq.laws()
    omega, cubic = eq.angular_frequency_per_s, abs(eq.cubic_per_m2_s2)
    time = seconds + 1.0 / omega
    bend = 0.75 * cubic * (start / omega) ** 2
    drift = 1.0 + bend / math.sqrt(1.0 + bend) * omega * time
    sizes = {
        "viscous_drag": gamma * time * (1.0 + 0.5 * gamma / omega) * drift,
        "quadratic_drag": beta * start * time * drift,
        "friction": mu * time / start * drift if start > 0.0 else 0.0,
        "amplitude_dependent_frequency": 0.375 * cubic * start**2 / omega * time,
    }
    for name, size in sizes.items():
        why = f"up to {min(size, 1.0):.1g} of the amplitude" if size > 0.0 else "the scene has none"
        yield Effect(name, min(size, 1.0), None, "1", size > 0.0, why)


def _disc_drag(scene: Scene, damping: Damping, omega: float, unit: str) -> Effect:
    """Return the damping rate at the start that the disc should cause, next to the whole one that was measured."""
    share = {"m": 1.0, "m/s": omega**-1, "m/s^2": omega**-2}.get(unit)  # of the displacement in the recorded amplitude
    measured, predicted = damping.best.rate_at_start(), None
    if scene.disc_diameter_m is None or scene.bob_mass_kg is None or share is None:
        why = "predicted for a disc and a mass of the bob in the scene only; measured: all damping at the start"
    else:
        predicted, kc = disc_rate(scene, share * damping.best.joint["A0"].value, omega)
        why = f"a thin disc at KC {kc:.3g} ({SOURCES}); measured: all damping at the start, that of the spring too"
    return Effect("disc_drag", predicted, measured, "1/s", len(damping.best.law.parameters) > 1, why)


def _damping(fitted: Oscillation) -> Effect:
    """Return by how much damping makes the period longer, :math:`\\omega_0/\\omega - 1`."""
    omega = fitted.phase.angular_frequency.value
    longer = math.sqrt(1.0 + max(fitted.squared_rate, 0.0) / omega**2) - 1.0
    why = "makes the period longer by this share, 1/8Q^2 for linear drag; the spring constant allows for it"
    return Effect("damping", None, longer, "1", longer > 0.0, why)


def _bend(fitted: Oscillation) -> Effect:
    name, bend, shift = "amplitude_dependent_frequency", fitted.phase.bend, fitted.shift
    if bend is None:
        return Effect(name, None, None, "1", False, "a constant frequency describes the phase: an ideal spring's")
    if not fitted.phase.of_amplitude:
        or_amplitude = "or with the amplitude" if bend.by_amplitude else "and not with the amplitude"
        why = f"the phase bends: the frequency shifts by {shift:.2g} of itself during the run, with time {or_amplitude}"
        return Effect(name, None, None, "1", False, why)
    why = (
        f"the phase bends: the frequency shifts by {shift:.2g} of itself from rest to the first amplitude, "
        "far beyond its uncertainty"
    )
    return Effect(name, None, shift, "1", True, why)


def _rest_drift(rest: RestPosition, noise: float) -> Effect:
    unit = rest.mean.unit
    if not rest.drifts:
        why = f"a constant rest position describes the record (residuals within single periods {amount(noise, unit)})"
        return Effect("rest_drift", None, rest.drift, unit, False, why)
    why = "the rest position moves more than its scatter allows; it is followed by a smooth curve"
    return Effect("rest_drift", None, rest.drift, unit, True, why)


def _modes(modes: Modes, unit: str) -> Iterator[Effect]:
    """Yield the effects of modes of other frequencies, and of harmonics of the main oscillation."""
    found = modes.members
    own = [mode for mode in found if mode.kind == "mode"]
    locked = [mode for mode in found if mode.kind != "mode"]
    names = (("sideways_mode", own, "mode of another frequency"), ("harmonics", locked, "harmonic"))
    for name, members, what in names:
        if modes.carrier is None:
            yield Effect(name, None, None, unit, False, "not sought: too few periods, or not at this accuracy")
        elif not members:
            yield Effect(name, None, None, unit, False, f"no {what} stands out of what the main oscillation leaves")
        else:
            size = math.sqrt(sum(mode.amplitude**2 for mode in members))
            verdict = "more" if modes.subtracted is not None else "less"
            why = (
                f"{len(members)} times a {what}, together of this amplitude; the strongest line would leave up to "
                f"{amount(modes.leak, unit)} in the main amplitude, {verdict} than a tenth of its uncertainty"
            )
            yield Effect(name, None, size, unit, modes.subtracted is not None, why)


def _buoyancy(scene: Scene, omega: float, length_m: float, unit: str) -> Effect:
    shift = scene_air_density(scene) / STEEL_KG_PER_M3 * GRAVITY_M_PER_S2 / omega**2
    why = "a constant force: it moves the rest position (a steel bob's by this much) and nothing else"
    return Effect("buoyancy", shift / length_m if length_m > 0.0 else None, None, unit, False, why)


def _speed_of_sound(scene: Scene, track: Track) -> Effect:
    record, shift, included = track.speed_of_sound_m_per_s, None, False
    if track.u_scale > 0:
        why = "the distances were calibrated, so the calibration's uncertainty stands in its place"
    elif not track.sonic and not scene.tells_of_sensor:
        why = "no rangefinder is known, so its 0.18 %/K stand in no uncertainty; a sensor in the scene adds them"
    elif scene.air_temperature_c is None:
        why = "the scene gives no air temperature, so a room's 20 +- 3 degC count, 0.5 % in the scale"
    else:
        included, why = True, "the record does not state the one that it used"
        if record is not None:
            shift = speed_of_sound(*(each.value for each in scene_air(scene))) / record - 1.0
            why = f"relative to the {record:g} m/s of the record, uncorrected"
        why += "; the air's uncertainty stands in the distances'"
    why += "; it scales every distance alike: amplitude and beta, not the spring constant"
    return Effect("speed_of_sound", shift, None, "1", included, why)


def _clock_rate(clock: ClockRate) -> Effect:
    shift = None if clock.rate.value == 1.0 else clock.rate.value - 1.0
    return Effect("clock_rate", clock.rate.u, shift, "1", True, clock.words)
