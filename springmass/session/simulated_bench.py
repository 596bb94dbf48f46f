"""The simulated bench: a bob that moves by the equation of motion of its scene, under the simulated rangefinder."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from acquisition.clock import Clock
from pipeline.bench.scene import Scene
from pipeline.dynamics import Trajectory
from pipeline.dynamics.problem import Problem
from pipeline.dynamics.strang import STRANG

__all__ = ["REST_M", "Release", "bench_position"]

REST_M = 0.25  # where the bob hangs above the sensor
STEPS_A_RADIAN = 24  # interpolated between: 1e-8 of the amplitude
STRETCH = 2000  # steps solved at a time, as the recording asks for them


class Release:
    """The moment in which the simulated bob is let go: once its rest has been measured.

    Attributes
    ----------
    at_s : float
        In the bench's time, s; infinity before it is known.
    """

    def __init__(self, clock: Clock) -> None:
        self.at_s = math.inf
        self._clock = clock
        self._begun_ns = 0

    def begin(self) -> None:
        """Take this moment for the bench's time 0."""
        self._begun_ns = self._clock.now_ns()

    def after(self, seconds: float) -> None:
        """Let the bob go so long from now."""
        self.at_s = (self._clock.now_ns() - self._begun_ns) * 1e-9 + seconds


def bench_position(
    scene: Scene, seconds: float = 10.0, *, where: str = "scene", release: Release | None = None
) -> Callable[[float], float]:
    """Return the bob's distance from the sensor, m, as a function of time, s.

    Parameters
    ----------
    scene : Scene
        Bob mass, spring constant and starting displacement are needed. Where it names a disc or the air and no damping,
        the drag is derived from them, as ``springmass simulate`` does; what else is left out is zero.
    seconds : float
        How long it is recorded, s: a derived drag is that of the amplitudes within it.
    where : str
        Named in errors.
    release : Release, optional
        Until then the bob hangs at rest; left out, it is held at its start and let go at t = 0.

    Raises
    ------
    SceneError
        If the scene lacks what a motion needs.

    Notes
    -----
    The equation of motion of :class:`pipeline.dynamics.Equation` by Strang splitting, solved as far as it is asked
    for.

    Examples
    --------
    >>> scene = Scene.from_mapping({"bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0},
    ...                             "start": {"displacement_m": 0.05}})
    >>> f"{bench_position(scene)(0.1 * np.pi):.6f}"
    '0.200000'
    """
    from springmass.runs.simulating.prepared import prepare

    problem = prepare(scene, seconds, where=where).problem
    step_s = 1.0 / (STEPS_A_RADIAN * problem.equation.angular_frequency_per_s)
    solved: list[Trajectory] = []

    def position(t: float) -> float:
        free_s = t if release is None else t - release.at_s
        if release is not None and free_s < 0.0:
            return REST_M
        stretch, since = divmod(max(free_s, 0.0), STRETCH * step_s)
        while len(solved) <= stretch:
            start = Problem(problem.equation, solved[-1].y[-1], solved[-1].v[-1]) if solved else problem
            solved.append(STRANG.run(start, step_s, STRETCH))
        return REST_M + float(solved[int(stretch)].at(np.array([since]))[0])

    return position
