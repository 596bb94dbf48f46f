"""Simulate a rangefinder's readings of a motion: a block of samples, with optional noise and false echoes."""

from __future__ import annotations

import math

import numpy as np

from acquisition.block import Block
from acquisition.simulated.rangefinder import VirtualRangefinder, VirtualSensor
from acquisition.source import SourceInfo
from pipeline.dynamics import Trajectory
from springmass.session.simulated_bench import REST_M

__all__ = ["plain_block", "readings", "rest_m"]


def rest_m(trajectory: Trajectory) -> float:
    """Return a rest distance in m at which the bob never touches the sensor."""
    return max(REST_M, 2.0 * float(np.max(np.abs(trajectory.y))))


def plain_block(trajectory: Trajectory, name: str) -> tuple[Block, SourceInfo]:
    """Return the states as a sensor without noise, echoes or resolution would read them, with their velocities."""
    distance = rest_m(trajectory) + trajectory.y
    block = Block(0, trajectory.t, distance, np.zeros(len(distance), np.uint8), velocity=trajectory.v.copy())
    return block, SourceInfo("simulated", name, 1.0 / trajectory.spacing_s)


def readings(
    trajectory: Trajectory, seconds: float, sensor: VirtualSensor, name: str, seed: int
) -> tuple[Block, SourceInfo]:
    """Return a rangefinder's readings of a motion.

    Parameters
    ----------
    trajectory : Trajectory
        Motion with states close enough for interpolation. It must extend a few readings beyond the end, because the
        sound of the last reading meets the bob after it is sent.
    seconds : float
        Time at which the readings end, s.
    sensor : VirtualSensor
        Rate, resolution, noise and false echoes of the rangefinder.
    name : str
    seed : int
        Seed of the random numbers.
    """
    rest = rest_m(trajectory)
    # All times at which the sensor may measure are interpolated together: the reading times, their neighbours, times
    # after the end, and the times at which the sound of each reading meets the bob.
    grid = np.arange(math.ceil(seconds * sensor.rate_hz) + 3) / sensor.rate_hz
    distances = rest + trajectory.at(grid)
    met = grid + distances / sensor.speed_of_sound_m_per_s
    there = dict(zip(met.tolist(), (rest + trajectory.at(met)).tolist(), strict=True))

    def position(t: float) -> float:
        place = t * sensor.rate_hz
        row = round(place)
        if abs(place - row) < 1e-6:
            return float(distances[min(max(row, 0), distances.size - 1)])
        return there[t] if t in there else rest + float(trajectory.at(np.array([t]))[0])

    finder = VirtualRangefinder(position, sensor, np.random.default_rng(seed))
    return finder.block(seconds + 1.0 / sensor.rate_hz), finder.info(name)
