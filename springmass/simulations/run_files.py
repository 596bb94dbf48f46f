"""Write a simulated motion as a run file: the states themselves, or the readings of a simulated rangefinder."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block, SourceInfo
from acquisition.simulated import VirtualRangefinder, VirtualSensor
from pipeline.bench.scene import Scene
from pipeline.simulation import Trajectory
from springmass.loading.save import made_now
from springmass.simulations.bench import REST_M
from springmass.simulations.simulation import FINE, Simulation, count_of, simulation_json, solve


def write_readings(path: Path, solved: Simulation, sensor: str, seed: int) -> None:
    """Write a sensor's readings of a simulated motion, one for each spacing, as a run of the kind "simulated".

    The noise is that of the scene's sensor, or else that of the simulated bench.
    """
    name, motion, ready = Path(solved.where).name, solved.trajectory, solved.ready
    if sensor == "ideal":
        block, info = _exact(motion, name)
    else:
        virtual = VirtualSensor(rate_hz=1.0 / motion.spacing_s)
        if ready.stated.sensor_sigma_m is not None:
            virtual = replace(virtual, noise_m=ready.stated.sensor_sigma_m.value)
        block, info = _readings(solved, virtual, name, seed)
    configuration = {"sensor": sensor, "seed": seed, **simulation_json(solved)}
    _write_run(path, block, info, ready.solved, f"{name}, as a {sensor} sensor reads it", configuration)


def write_states(path: Path, solved: Simulation, title: str) -> None:
    """Write the states of a motion as a run, as a sensor without noise, echoes or resolution would read them."""
    block, info = _exact(solved.trajectory, Path(solved.where).name)
    configuration = {"rest_m": _rest_m(solved.trajectory), **simulation_json(solved)}
    _write_run(path, block, info, solved.ready.solved, title, configuration)


def _rest_m(trajectory: Trajectory) -> float:
    """Return a rest distance in m at which the bob never touches the sensor."""
    return max(REST_M, 2.0 * float(np.max(np.abs(trajectory.y))))


def _exact(trajectory: Trajectory, name: str) -> tuple[Block, SourceInfo]:
    """Return the states as a sensor without noise, echoes or resolution would read them, with their velocities."""
    distance = _rest_m(trajectory) + trajectory.y
    block = Block(0, trajectory.t, distance, np.zeros(len(distance), np.uint8), velocity=trajectory.v.copy())
    return block, SourceInfo("simulated", name, 1.0 / trajectory.spacing_s)


def _readings(solved: Simulation, sensor: VirtualSensor, name: str, seed: int) -> tuple[Block, SourceInfo]:
    """Return a rangefinder's readings of the motion, solved again with states close enough for interpolation."""
    problem, spacing_s, seconds = solved.problem, solved.trajectory.spacing_s, float(solved.trajectory.t[-1])
    omega, rest = problem.equation.angular_frequency_per_s, _rest_m(solved.trajectory)
    # The sound of the last reading is still on its way to the bob at the end of the run.
    longer_s = seconds + 2.0 * spacing_s + 3.0 * rest / sensor.speed_of_sound_m_per_s
    parts = max(1, math.ceil(FINE * omega * spacing_s)) if solved.solution.chosen else 1
    method = "auto" if solved.solution.chosen else solved.solution.integrator.name
    count = parts * (count_of(longer_s, spacing_s) + 1)
    motion = solve(problem, method, spacing_s / parts, count, None).trajectory

    def position(t: float) -> float:
        return rest + float(motion.at(np.array([t]))[0])

    finder = VirtualRangefinder(position, sensor, np.random.default_rng(seed))
    return finder.block(seconds + 1.0 / sensor.rate_hz), finder.info(name)


def _write_run(
    path: Path, block: Block, info: SourceInfo, scene: Scene, title: str, configuration: Mapping[str, Any]
) -> None:
    from storage.run_file.writing import write_run

    write_run(
        path,
        [block],
        info,
        scene=scene.to_mapping(),
        title=title,
        provenance={**made_now(), "configuration": dict(configuration)},
        overwrite=True,
    )
