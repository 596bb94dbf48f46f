"""Findings on the scene: missing values, values without an uncertainty, and implausible values."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.bench.scene import Scene
from pipeline.bench.spring import HEAVIEST_SHARE
from pipeline.notice import Notice
from pipeline.results.effects import Effect


def scene_findings(scene: Scene, effects: tuple[Effect, ...], *, constant: bool = True) -> Iterator[Notice]:
    """Yield what is missing or implausible in a scene; the effects say whether the mass of the spring counts.

    ``constant`` says whether a spring constant is derived: the angle of a pendulum gives none.

    >>> bare = Scene.from_mapping({"bob": {"mass_kg": 0.2}})
    >>> [found.code for found in scene_findings(bare, ())]
    ['spring_mass_missing', 'uncertainty_missing']
    """
    springs = any(effect.name == "spring_mass" and effect.included for effect in effects)
    used = {
        "[bob] mass_kg": scene.bob_mass_kg,
        "[spring] mass_kg": scene.spring_mass_kg if springs else None,
        "[pendulum] length_m": scene.pendulum_length_m,
        "[disc] diameter_m": scene.disc_diameter_m,
    }
    exact = [name for name, estimate in used.items() if estimate is not None and estimate.u == 0]
    if unusual := scene.unusual():
        said = [f"{clause}{mark or '.'}" for clause, mark in unusual]
        yield Notice("scene_implausible", {"first": said[0], "more": len(said) - 1 or None, "all": " ".join(said)})
    if constant and scene.bob_mass_kg is not None and scene.spring_mass_kg is None:
        yield Notice("spring_mass_missing", {"heaviest": HEAVIEST_SHARE})
    if exact:
        yield Notice("uncertainty_missing", {"inputs": ", ".join(exact)})
