"""A scene made ready to be solved: what a run stands for, what drag disc and air imply, what the user leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.analyse import Analysis
from pipeline.bench.derived_drag import DerivedDrag, derive_drag, needs_drag
from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem
from pipeline.numerics.estimate import Estimate, Joint
from springmass.runs.simulating.against import completed

__all__ = ["WITHOUT", "Prepared", "prepare"]

WITHOUT = ("drag", "disc", "spring-mass")
"""What a user may leave out."""


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A scene that can be solved.

    Parameters
    ----------
    stated : Scene
        As it was given, with what a run stands for.
    solved : Scene
        The same with the drag that was derived, and without what is left out.
    drag : DerivedDrag or None
        What disc, bob and air imply; None where the scene states its damping, names no air, or it is left out.
    measured : Joint or None
        Of attributes that are known together: the run's, and the derived drag's.
    from_run : tuple of str
        The attributes that are the run's.
    problem : Problem
    """

    stated: Scene
    solved: Scene
    drag: DerivedDrag | None
    measured: Joint | None
    from_run: tuple[str, ...]
    problem: Problem

    def values(self) -> dict[str, Estimate]:
        """Return every uncertain attribute with its uncertainty, by name."""
        from pipeline.dynamics.band import uncertain

        joint = uncertain(self.solved, self.measured)
        return {name: joint[name] for name in joint.names}


def prepare(
    scene: Scene, seconds: float, *, analysis: Analysis | None = None, without: Sequence[str] = (), where: str = "scene"
) -> Prepared:
    """Return a scene made ready.

    Parameters
    ----------
    scene : Scene
    seconds : float
        How long it is to be solved, s.
    analysis : Analysis, optional
        Of a measured run that stands for start, spring constant and damping where the scene is silent; not for a
        damping that disc and air imply, which would be no prediction.
    without : sequence of str
        Of :data:`WITHOUT`.
    where : str
        Named in errors.

    Raises
    ------
    SceneError, DynamicsError
        If the scene lacks what a motion needs, or states what has none.
    """
    derived = needs_drag(scene)
    measured: Joint | None = None
    from_run: tuple[str, ...] = ()
    if analysis is not None:
        scene, measured = completed(scene, analysis, damping=not derived)
        from_run = measured.names
    solved = scene
    if "disc" in without:
        solved = replace(solved, disc_diameter_m=None)
    if "spring-mass" in without:
        solved = replace(solved, spring_mass_kg=None)
    problem, drag = Problem.from_scene(solved, where=where), None
    if derived and "drag" not in without and needs_drag(solved):
        drag = derive_drag(solved, problem.amplitude_m(), seconds)
        joint = drag.joint
        solved = replace(
            solved, gamma_per_s=joint["gamma_per_s"], beta_per_m_s=replace(joint["beta_per_m_s"], unit="1/(m s)")
        )
        measured = _together(measured, joint)
        problem = Problem.from_scene(solved, where=where)
    return Prepared(scene, solved, drag, measured, from_run, problem)


def _together(one: Joint | None, other: Joint) -> Joint:
    """Return both as one joint, independent of each other."""
    if one is None:
        return other
    size = len(one.names)
    covariance = np.zeros((size + len(other.names),) * 2)
    covariance[:size, :size], covariance[size:, size:] = one.covariance, other.covariance
    return Joint(
        (*one.names, *other.names), np.concatenate([one.values, other.values]), covariance, (*one.units, *other.units)
    )
