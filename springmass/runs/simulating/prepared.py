"""Prepare a scene for solving: values taken from a run, drag derived from disc and air, omissions by the user."""

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
"""Parts of the scene that a user may leave out."""


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A scene that is ready to be solved.

    Parameters
    ----------
    stated : Scene
        The given scene, completed with values from a run.
    solved : Scene
        The stated scene with the derived drag, and without the parts that are left out.
    drag : DerivedDrag or None
        Drag implied by disc, bob and air; None if the scene states its damping or names no air, or if the drag is left
        out.
    measured : Joint or None
        Joint distribution of the attributes taken from the run and of the derived drag.
    from_run : tuple of str
        Names of the attributes taken from the run.
    problem : Problem
    """

    stated: Scene
    solved: Scene
    drag: DerivedDrag | None
    measured: Joint | None
    from_run: tuple[str, ...]
    problem: Problem

    def values(self) -> dict[str, Estimate]:
        """Return a mapping from the name of each uncertain attribute to its estimate."""
        from pipeline.dynamics.band import uncertain

        joint = uncertain(self.solved, self.measured)
        return {name: joint[name] for name in joint.names}


def prepare(
    scene: Scene, seconds: float, *, analysis: Analysis | None = None, without: Sequence[str] = (), where: str = "scene"
) -> Prepared:
    """Return a scene prepared for solving.

    Parameters
    ----------
    scene : Scene
    seconds : float
        Duration of the solution, s.
    analysis : Analysis, optional
        Analysis of a measured run. It supplies the start, and the spring constant and damping if the scene does not
        state them. A damping implied by disc and air is not taken from the run, for that would be no prediction.
    without : sequence of str
        Parts to leave out, from :data:`WITHOUT`.
    where : str
        Name of the scene in errors.

    Raises
    ------
    SceneError, DynamicsError
        If the scene lacks a value that a motion needs, or states values for which no motion exists.
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
    """Return both joint distributions as one, with no correlation between the two."""
    if one is None:
        return other
    size = len(one.names)
    covariance = np.zeros((size + len(other.names),) * 2)
    covariance[:size, :size], covariance[size:, size:] = one.covariance, other.covariance
    return Joint(
        (*one.names, *other.names), np.concatenate([one.values, other.values]), covariance, (*one.units, *other.units)
    )
