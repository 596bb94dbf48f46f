"""A simulated bench for ``record --simulate``: a bob that obeys the equation of its scene, above a simulated sensor."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from acquisition.clock import Clock
from pipeline.bench.scene import Scene
from pipeline.dynamics.equation import Problem
from pipeline.dynamics.strang import STRANG
from pipeline.simulation import Trajectory
from springmass.simulations.simulation import FINE, prepare

REST_M = 0.25  # height of the bob's rest position above the sensor, m
STRETCH_STEPS = 2000  # number of steps solved at a time, when the recording needs them
EXAMPLE = Scene.from_mapping(
    {
        "bob": {"mass_kg": 0.2},
        "spring": {"mass_kg": 0.01, "constant_n_per_m": 14.0},
        "start": {"displacement_m": 0.05},
        "damping": {"gamma_per_s": 0.01},
    }
)
"""The bench that is simulated if no scene names another."""


class Release:
    """The moment ``at_s`` at which the simulated bob is released, once its rest position has been measured."""

    def __init__(self, clock: Clock) -> None:
        self.at_s = math.inf
        self._clock = clock
        self._begun_ns = 0

    def begin(self) -> None:
        """Set the zero of the bench's time scale to the current moment."""
        self._begun_ns = self._clock.now_ns()

    def after(self, seconds: float) -> None:
        """Release the bob after the given number of seconds."""
        self.at_s = (self._clock.now_ns() - self._begun_ns) * 1e-9 + seconds


def bench_position(
    scene: Scene, seconds: float = 10.0, *, where: str = "scene", release: Release | None = None
) -> Callable[[float], float]:
    """Return the bob's distance from the sensor in m as a function of time in s, with the drag for these seconds.

    The bob hangs at rest until its release; without one it starts at t = 0. The equation of motion is solved by Strang
    splitting, only up to the latest time needed.

    >>> scene = Scene.from_mapping({"bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0},
    ...                             "start": {"displacement_m": 0.05}})
    >>> f"{bench_position(scene)(0.1 * np.pi):.6f}"
    '0.200000'
    """
    problem = prepare(scene, seconds, where=where).problem
    step_s = 1.0 / (FINE * problem.equation.angular_frequency_per_s)
    solved: list[Trajectory] = []

    def position(t: float) -> float:
        free_s = t if release is None else t - release.at_s
        if release is not None and free_s < 0.0:
            return REST_M
        stretch, since = divmod(max(free_s, 0.0), STRETCH_STEPS * step_s)
        while len(solved) <= stretch:
            start = Problem(problem.equation, solved[-1].y[-1], solved[-1].v[-1]) if solved else problem
            solved.append(STRANG.run(start, step_s, STRETCH_STEPS))
        return REST_M + float(solved[int(stretch)].at(np.array([since]))[0])

    return position
