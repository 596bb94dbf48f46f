"""Findings on the scene: missing values, values without an uncertainty, and implausible values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pipeline.bench.plausible import slips
from pipeline.bench.scene import BENCH_KEYS, PLACES, Scene
from pipeline.bench.spring import HEAVIEST_SHARE
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate
from pipeline.results.effects import Effect

# Drag coefficients of bodies in a stream lie within 0.3 (sphere) and, for an oscillating disc at KC of 0.1, near 10
# (J. M. R. Graham, J. Fluid Mech. 97 (1980) 331); all damping counts as drag here, which adds a factor of five.
USUAL_DRAG = (0.3, 50.0)
DISC, LENGTH = "disc_diameter_m", "pendulum_length_m"
# On the Earth's surface, 9.764 to 9.834 m/s^2 (C. Hirt et al., Geophys. Res. Lett. 40 (2013) 4279), wider by the 5 % of
# a ball whose radius is a third of the pendulum's length.
GRAVITIES = (0.95 * 9.764, 1.05 * 9.834)


def scene_findings(scene: Scene, effects: tuple[Effect, ...], estimates: Mapping[str, Estimate]) -> Iterator[Notice]:
    """Yield what is missing or implausible in a scene; the effects say whether the mass of the spring counts.

    ``estimates`` are the results: the angle of a pendulum gives no spring constant.

    >>> bare = Scene.from_mapping({"bob": {"mass_kg": 0.2}})
    >>> [found.code for found in scene_findings(bare, (), {"spring_constant": Estimate(14.0, 0.1, "N/m")})]
    ['spring_mass_missing', 'uncertainty_missing']
    """
    springs = any(effect.name == "spring_mass" and effect.included for effect in effects)
    used = ("bob", "mass_kg"), *([("spring", "mass_kg")] if springs else []), ("pendulum", "length_m"), PLACES[DISC]
    quantities = [BENCH_KEYS[place] for place in used]
    exact = [q.label for q in quantities if (x := getattr(scene, q.attribute)) is not None and x.u == 0]
    perhaps = slips(scene)
    said = [each.clause if each.asks else f"{each.clause}." for each in perhaps]
    # A drag coefficient that no disc has says nothing new if the diameter is in doubt already.
    if all(each.attribute != DISC for each in perhaps):
        said += _drag(estimates)
    gravity = [] if any(each.attribute == LENGTH for each in perhaps) else [*_gravity(estimates)]
    if said := [*said, *gravity]:
        numbers = {"first": said[0], "more": len(said) - 1 or None, "all": " ".join(said)}
        grave = gravity or any(each.decides for each in perhaps)
        yield Notice("scene_implausible", numbers, None if grave else "info")
    if "spring_constant" in estimates and scene.bob_mass_kg is not None and scene.spring_mass_kg is None:
        yield Notice("spring_mass_missing", {"heaviest": HEAVIEST_SHARE})
    if exact:
        yield Notice("uncertainty_missing", {"inputs": ", ".join(exact)})


def _gravity(estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield the question about an acceleration of gravity that is not the Earth's."""
    gravity, (low, high) = estimates.get("gravity"), GRAVITIES
    if gravity is not None and not low - 2.0 * gravity.u <= gravity.value <= high + 2.0 * gravity.u:
        yield f"g would be {gravity.value:.3g} m/s^2, not the Earth's: is the length of the pendulum right?"


def _drag(estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield the question about a drag coefficient that no disc has."""
    drag, (low, high) = estimates.get("drag_coefficient"), USUAL_DRAG
    if drag is not None and not low - 2.0 * drag.u <= drag.value <= high + 2.0 * drag.u:
        yield f"the drag coefficient would be {drag.value:.2g}, which no disc has: is its diameter right?"
