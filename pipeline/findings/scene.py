"""Findings on the scene: missing values, values without an uncertainty, and implausible values."""

from __future__ import annotations

from pipeline.bench.scene import Scene
from pipeline.bench.spring import HEAVIEST_SHARE
from pipeline.findings.finding import Finding
from pipeline.results.effects import Effect

__all__ = ["scene_findings"]


def scene_findings(scene: Scene, effects: tuple[Effect, ...]) -> tuple[Finding, ...]:
    """Return the findings on the inputs from the scene.

    Parameters
    ----------
    scene : Scene
    effects : tuple of Effect
        The effects table, which says whether the model includes the mass of the spring.

    Examples
    --------
    >>> bare = Scene.from_mapping({"bob": {"mass_kg": 0.2}})
    >>> [finding.code for finding in scene_findings(bare, ())]
    ['spring_mass_missing', 'uncertainty_missing']
    """
    springs = any(effect.name == "spring_mass" and effect.included for effect in effects)
    used = {
        "[bob] mass_kg": scene.bob_mass_kg,
        "[spring] mass_kg": scene.spring_mass_kg if springs else None,
        "[disc] diameter_m": scene.disc_diameter_m,
    }
    exact = [name for name, estimate in used.items() if estimate is not None and estimate.u == 0]
    found = []
    if unusual := scene.unusual():
        more = f" (and {len(unusual) - 1} more)" if len(unusual) > 1 else ""
        found.append(
            Finding(
                "scene_implausible",
                "warning",
                f"Implausible: {unusual[0]}{more}.",
                f"{'; '.join(unusual)}.",
            )
        )
    if scene.bob_mass_kg is not None and scene.spring_mass_kg is None:
        found.append(
            Finding(
                "spring_mass_missing",
                "warning",
                "The mass of the spring is not stated, so the spring constant is less certain.",
                "The spring constant includes no part of the spring's mass; its uncertainty covers a spring of 0 to "
                f"{HEAVIEST_SHARE:g} of the bob's mass.",
            )
        )
    if exact:
        found.append(
            Finding(
                "uncertainty_missing",
                "warning",
                f"No uncertainty was stated for {', '.join(exact)}, so {'it was' if len(exact) == 1 else 'they were'} "
                "taken as exact.",
                "Results derived from it are less certain than stated, because the uncertainty of the balance or ruler "
                "is missing.",
            )
        )
    return tuple(found)
