"""The simulated bench: a bob that moves by the equation of motion of its scene, under the simulated rangefinder."""

from __future__ import annotations

import math
from collections.abc import Callable

from pipeline.bench.scene import Scene
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
    >>> f"{bench_position(scene)(0.1 * math.pi):.6f}"
    '0.200000'
    """
    problem = Problem.from_scene(scene, where=where)
    step_s = 1.0 / (STEPS_A_RADIAN * problem.equation.angular_frequency_per_s)
    # Displacement and velocity times step, as far as they are solved.
    ys, rises = [problem.displacement_m], [problem.velocity_m_per_s * step_s]

    def solve_on() -> None:
        last = Problem(problem.equation, ys[-1], rises[-1] / step_s)
        stretch = STRANG.run(last, step_s, STRETCH)
        ys.extend(stretch.y[1:].tolist())
        rises.extend((stretch.v[1:] * step_s).tolist())

    def position(t: float) -> float:
        place = max(t, 0.0) / step_s
        row = math.floor(place)
        while row + 1 >= len(ys):
            solve_on()
        x = place - row
        rise = x * x * (3.0 - 2.0 * x)
        bends = x * (1.0 - x) * ((1.0 - x) * rises[row] - x * rises[row + 1])
        return float(REST_M + (1.0 - rise) * ys[row] + rise * ys[row + 1] + bends)

    return position
