"""The simulated bench: a bob that moves by the equation of motion of its scene, under the simulated rangefinder."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.dynamics import Trajectory
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.problem import Problem

__all__ = ["REST_M", "bench_position"]

REST_M = 0.25  # where the bob hangs above the sensor
STEPS_A_RADIAN = 24  # interpolated between: 1e-8 of the amplitude
STRETCH = 2000  # steps solved at a time, as the recording asks for them


def bench_position(scene: Scene, *, where: str = "scene") -> Callable[[float], float]:
    """Return the bob's distance from the sensor, m, as a function of time, s.

    Parameters
    ----------
    scene : Scene
        Bob mass, spring constant and starting displacement are needed; what else is left out is zero.
    where : str
        Named in errors.

    Raises
    ------
    SceneError
        If the scene lacks what a motion needs.

    Notes
    -----
    The equation of motion of :class:`pipeline.dynamics.Equation` by Strang splitting, solved as far as it is asked
    for. Before t = 0 the bob is held at its start.

    Examples
    --------
    >>> scene = Scene.from_mapping({"bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0},
    ...                             "start": {"displacement_m": 0.05}})
    >>> f"{bench_position(scene)(0.1 * np.pi):.6f}"
    '0.200000'
    """
    problem = Problem.from_scene(scene, where=where)
    step_s = 1.0 / (STEPS_A_RADIAN * problem.equation.angular_frequency_per_s)
    solved: list[Trajectory] = []

    def position(t: float) -> float:
        stretch, since = divmod(max(t, 0.0), STRETCH * step_s)
        while len(solved) <= stretch:
            start = Problem(problem.equation, solved[-1].y[-1], solved[-1].v[-1]) if solved else problem
            solved.append(STRANG.run(start, step_s, STRETCH))
        return REST_M + float(solved[int(stretch)].at(np.array([since]))[0])

    return position
