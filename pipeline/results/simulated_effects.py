"""Effects in a simulated motion: how much each changes the motion, whether it is included, and why.

The size of an effect is the largest error of the displacement over the run without it, over the start amplitude. The
table has the form of that of an analysis, without measured sizes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pipeline.bench.added_mass import added_mass_kg, scene_air, scene_air_density
from pipeline.bench.derived_drag import BOB_KG_PER_M3, DerivedDrag, needs_drag
from pipeline.bench.scene import Scene
from pipeline.bench.spring import HEAVIEST_SHARE, oscillating_mass_kg
from pipeline.dynamics.amplitude import amplitude
from pipeline.dynamics.problem import Problem
from pipeline.dynamics.terms import Term, required
from pipeline.results.effects import Effect

__all__ = ["simulated_effects"]

GRAVITY = 9.81  # m/s^2
SOFTER_PER_K = 2.6e-4  # relative decrease of the modulus of spring steel with temperature, 1/K
_NAMES = {
    "viscous_drag": "[damping] gamma_per_s",
    "quadratic_drag": "[damping] beta_per_m_s",
    "friction": "[damping] mu_m_per_s",
    "amplitude_dependent_frequency": "[spring] cubic_n_per_m3",
}


def simulated_effects(
    scene: Scene,
    problem: Problem,
    terms: Sequence[Term],
    seconds: float,
    drag: DerivedDrag | None,
    without: Sequence[str],
) -> tuple[Effect, ...]:
    """Return the effects table of a simulation.

    Parameters
    ----------
    scene : Scene
        The scene as stated.
    problem : Problem
        The problem made from the scene, including derived drag.
    terms : sequence of Term
        The terms of the equation, included or not at the tolerance; empty for a named method, which solves all of them.
    seconds : float
        Duration of the run, s.
    drag : DerivedDrag or None
        Drag derived from disc, bob and air.
    without : sequence of str
        Effects that the user left out: "drag", "disc", "spring-mass".

    Notes
    -----
    Leaving out a share s of the mass shifts the phase by :math:`s\\omega T/2` over a run of duration T. An error
    :math:`\\delta` of the angular frequency changes the displacement by up to :math:`2\\sin(\\delta T/2)` of the
    amplitude. If the suspended length l is within 1.5 amplitudes of :math:`4g/\\omega^2`, any small sideways motion
    grows at the rate :math:`3\\omega A/8l` [1]_.

    References
    ----------
    .. [1] P. Lynch, "Resonant motions of the three-dimensional elastic pendulum", Int. J. Non-Linear Mech. 37
       (2002) 345.
    """
    return (
        *_masses(scene, problem, seconds, without),
        _disc(scene, problem, seconds, drag),
        _bob(scene, problem, seconds, drag),
        *_terms(problem, terms, seconds, drag),
        _temperature(scene, problem, seconds),
        _pendulum(problem),
        _buoyancy(scene, problem),
    )


def _turned(share: float, problem: Problem, seconds: float) -> float:
    """Return the change of the displacement by a relative error of the frequency, over the amplitude."""
    return 2.0 * math.sin(min(0.5 * abs(share) * problem.equation.angular_frequency_per_s * seconds, 0.5 * math.pi))


def _masses(scene: Scene, problem: Problem, seconds: float, without: Sequence[str]) -> Iterator[Effect]:
    assert scene.bob_mass_kg is not None
    load = scene.bob_mass_kg.value
    if scene.spring_mass_kg is None:
        most = 0.5 * (oscillating_mass_kg(HEAVIEST_SHARE * load, load) / load - 1.0)
        why = (
            "the scene gives no spring mass; the heaviest usual one, 0.3 of the bob, would change the motion by "
            f"{_turned(most, problem, seconds):.2g} of the amplitude: add [spring] mass_kg"
        )
        yield Effect("spring_mass", None, None, "1", False, why)
    else:
        share = oscillating_mass_kg(scene.spring_mass_kg.value, load) / load - 1.0
        size, included = _turned(0.5 * share, problem, seconds), "spring-mass" not in without
        why = f"{share:.2g} of the bob's mass swings along" + ("" if included else "; left out by --without")
        yield Effect("spring_mass", size, None, "1", included, why)
    if scene.disc_diameter_m is None:
        yield Effect(
            "added_mass", None, None, "1", False, "the scene names no disc; the bob carries next to no air along"
        )
    else:
        share = added_mass_kg(scene) / load
        included = "disc" not in without
        why = f"the disc carries {share:.2g} of the bob's mass of air along" + (
            "" if included else "; left out by --without"
        )
        yield Effect("added_mass", _turned(0.5 * share, problem, seconds), None, "1", included, why)


def _lost(problem: Problem, seconds: float, gamma: float, beta: float) -> float:
    """Return the largest change of the amplitude without part of the damping, over the start amplitude."""
    start = problem.amplitude_m()
    if start == 0.0:
        return 0.0
    laws = problem.equation.laws()
    t = np.linspace(0.0, seconds, 200)
    less = max(laws[0] - gamma, 0.0), max(laws[1] - beta, 0.0), laws[2]
    return float(np.max(np.abs(amplitude(start, *less, t) - amplitude(start, *laws, t)))) / start


def _disc(scene: Scene, problem: Problem, seconds: float, drag: DerivedDrag | None) -> Effect:
    name = "disc_drag"
    if scene.disc_diameter_m is None:
        return Effect(name, None, None, "1", False, "the scene names no disc")
    if drag is None:
        why = "[damping] is stated, the disc's drag with it"
        if needs_drag(scene):
            why = "left out by --without: the motion is that without the disc's drag"
        return Effect(name, None, None, "1", not needs_drag(scene), why)
    size = _lost(problem, seconds, drag.gamma_per_s - drag.bob_per_s, drag.beta_per_m_s)
    return Effect(name, size, None, "1", True, f"no [damping] is stated: derived, {drag.words}")


def _bob(scene: Scene, problem: Problem, seconds: float, drag: DerivedDrag | None) -> Effect:
    name = "bob_drag"
    if drag is None:
        why = "[damping] is stated, the bob's drag with it"
        silent = scene.gamma_per_s is None and scene.beta_per_m_s is None and scene.mu_m_per_s is None
        if needs_drag(scene):
            why = "left out by --without"
        elif silent:
            why = "neither [damping] nor [air] nor [disc] is stated: the bob moves in a vacuum; add [air]"
        return Effect(name, None, None, "1", not silent, why)
    size = _lost(problem, seconds, drag.bob_per_s, 0.0)
    return Effect(name, size, None, "1", True, f"a sphere of steel in the air's viscosity, {drag.bob_per_s:.2g} 1/s")


def _terms(problem: Problem, terms: Sequence[Term], seconds: float, drag: DerivedDrag | None) -> Iterator[Effect]:
    if not terms:
        _, found = required(problem, seconds, 1.0)
        terms = [
            replace(term, included=True, why="a method by name solves all terms") if term.size > 0.0 else term
            for term in found
        ]
    for term in terms:
        why = term.why
        if not term.in_scene:
            why = f"the scene has no {_NAMES[term.name]}"
        elif drag is not None and term.name in ("viscous_drag", "quadratic_drag"):
            why += "; the coefficient is the derived one"
        yield Effect(term.name, term.size, None, "1", term.included, why)


def _temperature(scene: Scene, problem: Problem, seconds: float) -> Effect:
    celsius, *_ = scene_air(scene)
    size = _turned(0.5 * SOFTER_PER_K * celsius.u, problem, seconds)
    stated = "the scene's" if scene.air_temperature_c is not None else "a room's, as the scene states none:"
    why = (
        f"{stated} u(t) of {celsius.u:g} K makes a steel spring softer by {SOFTER_PER_K * celsius.u:.1g}; the "
        "scene's k is taken to be that of its temperature"
    )
    return Effect("temperature", size, None, "1", False, why)


def _pendulum(problem: Problem) -> Effect:
    omega, start = problem.equation.angular_frequency_per_s, problem.amplitude_m()
    length = 4.0 * GRAVITY / omega**2
    rate = 0.375 * omega * start / length
    why = (
        f"the scene gives no length; suspended {length:.3g} m +- {1.5 * start:.2g} m below its point the bob would "
        f"swing sideways at half the frequency (2:1), growing by {rate:.2g} 1/s from what there is"
    )
    return Effect("sideways_mode", None, None, "1", False, why)


def _buoyancy(scene: Scene, problem: Problem) -> Effect:
    start = problem.amplitude_m()
    shift = scene_air_density(scene) / BOB_KG_PER_M3 * GRAVITY / problem.equation.angular_frequency_per_s**2
    why = f"a constant force: it moves the rest by {shift:.2g} m, from which displacements are counted"
    return Effect("buoyancy", shift / start if start > 0.0 else None, None, "1", False, why)
