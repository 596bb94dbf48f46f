"""The motion that a scene predicts, for scripts."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pipeline.errors import DynamicsError
from pipeline.simulation.methods import OneStep, acceleration
from springmass.api.analysing import AnyScene
from springmass.loading.scenes import scene_from
from springmass.simulations.simulation import SimulationOptions, simulated

if TYPE_CHECKING:
    import xarray as xr

StepFunction = Callable[[float, float, float, Callable[[float, float], float]], tuple[float, float]]


def simulate(
    scene: AnyScene, t: ArrayLike, *, method: str | StepFunction = "auto", tolerance: float | None = None
) -> xr.Dataset:
    """Solve the equation of motion that a scene implies, as ``springmass simulate`` does.

    Parameters
    ----------
    scene : Scene, path or mapping
        Masses, spring, start and damping, or the disc and the air that imply it.
    t : (n,) array_like, s
        Equally spaced times from 0 on.
    method : str or callable
        "auto", or an integrator: "forward-euler", "symplectic-euler", "verlet", "yoshida4", "rk4", "exact", "strang"
        or "dop853". A function ``step(y, v, h, a)`` returns displacement and velocity after a step of h seconds, where
        ``a(y, v)`` is the acceleration; its step is the spacing of the times.
    tolerance : float, optional
        Largest error relative to the starting amplitude. Default: for "auto" and methods that choose their step, a
        hundredth of the uncertainty; any other method takes the spacing as its step.

    Returns
    -------
    xarray.Dataset
        Along ``time``: displacement (m) with its standard uncertainty u_displacement, and velocity (m/s). Attributes:
        the method, its step_s, and the errors of displacement and velocity relative to their greatest values.

    Raises
    ------
    springmass.Error
        If the scene describes no motion, or the method is unknown or unstable with this step.

    Examples
    --------
    >>> scene = {"bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0}, "start": {"displacement_m": 0.05}}
    >>> motion = simulate(scene, np.arange(0, 10, 0.01))
    >>> bool(abs(motion.displacement - 0.05 * np.cos(10 * motion.time)).max() < 1e-8)
    True
    """
    import xarray as xr

    times = np.asarray(t, np.float64)
    spacing_s = float(times[1]) if times.ndim == 1 and times.size > 1 else 0.0
    if spacing_s <= 0.0 or not np.allclose(times, spacing_s * np.arange(times.size), rtol=1e-9, atol=1e-9 * spacing_s):
        raise DynamicsError("simulate takes equally spaced times from 0 on", "give np.arange(0, SECONDS, STEP)")
    given_scene, seconds = scene_from(scene), float(times[-1])
    if given_scene is None:
        raise DynamicsError("simulate takes a scene, got None", "give a Scene, its tables or the path of its file")
    options = SimulationOptions(
        method=method if isinstance(method, str) else _own(method),
        spacing_s=spacing_s,
        seconds=seconds,
        tolerance=tolerance,
        force=not isinstance(method, str),
    )
    found = simulated(given_scene, options)
    solution, band = found.solution, found.band
    around = np.zeros((4, times.size)) if band is None else band.displacement_at(times)
    of = {"displacement": solution.trajectory.y, "u_displacement": 0.5 * (around[2] - around[1])}
    data = {name: ("time", values, {"units": "m"}) for name, values in of.items()}
    data["velocity"] = ("time", solution.trajectory.v, {"units": "m/s"})
    errors = {"error": solution.error, "velocity_error": solution.velocity_error}
    about = {"method": solution.integrator.name, "step_s": solution.step_s, **errors, "why": solution.no_estimate}
    time = {"time": ("time", times, {"units": "s", "standard_name": "time"})}
    return xr.Dataset(data, time, {name: value for name, value in about.items() if value not in (None, "")})


def _own(step: StepFunction) -> OneStep:
    name = getattr(step, "__name__", "own")
    return OneStep(name, name, 1, lambda equation, h: lambda y, v: step(y, v, h, acceleration(equation)))
