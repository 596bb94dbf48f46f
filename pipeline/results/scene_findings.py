"""What a scene leaves open that an analysis had to take for granted."""

from __future__ import annotations

from pipeline.bench.scene import Scene
from pipeline.results.effects import Effect
from pipeline.results.findings import Finding

__all__ = ["judge_scene"]


def judge_scene(scene: Scene, effects: tuple[Effect, ...]) -> tuple[Finding, ...]:
    """Return what to know of the inputs that results were derived from.

    Parameters
    ----------
    scene : Scene
    effects : tuple of Effect
        Say whether the spring's mass is in the model.

    Examples
    --------
    >>> bare = Scene.from_mapping({"bob": {"mass_kg": 0.2}})
    >>> judge_scene(bare, ())[0].code
    'uncertainty_missing'
    """
    springs = any(effect.name == "spring_mass" and effect.included for effect in effects)
    used = {
        "[bob] mass_kg": scene.bob_mass_kg,
        "[spring] mass_kg": scene.spring_mass_kg if springs else None,
        "[disc] diameter_m": scene.disc_diameter_m,
    }
    exact = [name for name, estimate in used.items() if estimate is not None and estimate.u == 0]
    if not exact:
        return ()
    message = (
        f"the scene states {', '.join(exact)} without an uncertainty: taken as exact, so what is derived from "
        f"{'it' if len(exact) == 1 else 'them'} is less certain than its u says; write {{ value = ..., u = ... }}"
    )
    return (Finding("uncertainty_missing", "warning", message),)
