"""The simulated bench: a bob that moves as a scene says, under the simulated rangefinder."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.effects import added_mass_kg
from pipeline.estimate import Estimate
from pipeline.laws import LAWS
from pipeline.scene import Scene
from springmass.errors import USAGE, ProgramError

__all__ = ["REST_M", "bench_position"]

REST_M = 0.25  # where the bob hangs above the sensor


def bench_position(scene: Scene, *, where: str = "scene") -> Callable[[float], float]:
    """Return the bob's distance from the sensor, m, as a function of time, s.

    Parameters
    ----------
    scene : Scene
        Bob mass, spring constant and starting displacement are needed; damping coefficients left out are zero.
    where : str
        Named in errors.

    Raises
    ------
    ProgramError
        With exit code 2 if the scene lacks what a motion needs, or asks for friction.

    Notes
    -----
    The averaged motion :math:`y = y_0 + A(t)\\cos(\\omega t + \\varphi)`, which agrees with the equation of motion to
    2e-6 of the amplitude over 120 s where the damping is as weak as at a bench.
    """
    needed = {
        "[bob] mass_kg": scene.bob_mass_kg,
        "[spring] constant_n_per_m": scene.spring_constant_n_per_m,
        "[start] displacement_m": scene.start_displacement_m,
    }
    missing = [name for name, value in needed.items() if value is None]
    if missing:
        raise ProgramError(f"{where}: a simulated bench needs {', '.join(missing)}; add it to the scene", USAGE)
    if scene.mu_m_per_s is not None and scene.mu_m_per_s.value > 0:
        raise ProgramError(f"{where}: the simulated bench knows no friction yet; leave [damping] mu_m_per_s out", USAGE)
    mass = _value(scene.bob_mass_kg) + _value(scene.spring_mass_kg) / 3.0 + added_mass_kg(scene)
    omega = math.sqrt(_value(scene.spring_constant_n_per_m) / mass)
    displacement, speed = _value(scene.start_displacement_m), _value(scene.start_velocity_m_per_s)
    start = math.hypot(displacement, speed / omega)
    phase = math.atan2(-speed / omega, displacement)
    theta = np.array([start, _value(scene.gamma_per_s), _value(scene.beta_per_m_s)])
    law = LAWS["linear+quadratic"]

    def position(t: float) -> float:
        if start == 0.0:
            return REST_M
        amplitude = float(law.amplitude(np.array([max(t, 0.0)]), theta)[0])
        return REST_M + amplitude * math.cos(omega * t + phase)

    return position


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None else estimate.value
