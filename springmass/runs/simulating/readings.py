"""What a rangefinder would have read of a simulated motion: a block of samples, with noise and echoes by choice."""

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
    """Return a distance at which the bob never touches the sensor, m."""
    return max(REST_M, 2.0 * float(np.max(np.abs(trajectory.y))))


def plain_block(trajectory: Trajectory, name: str) -> tuple[Block, SourceInfo]:
    """Return the states as a sensor without noise, echoes or resolution would read them, with their velocities."""
    distance = rest_m(trajectory) + trajectory.y
    block = Block(0, trajectory.t, distance, np.zeros(len(distance), np.uint8), velocity=trajectory.v.copy())
    return block, SourceInfo("simulated", name, 1.0 / trajectory.spacing_s)


def readings(
    trajectory: Trajectory, seconds: float, sensor: VirtualSensor, name: str, seed: int
) -> tuple[Block, SourceInfo]:
    """Return what a rangefinder reads of a motion.

    Parameters
    ----------
    trajectory : Trajectory
        In states fine enough to interpolate between, to some readings after the end: the sound of the last reading
        meets the bob later than it was sent.
    seconds : float
        Until when it reads, s.
    sensor : VirtualSensor
        Its rate, resolution, noise and false echoes.
    name : str
    seed : int
        Of its chance.
    """
    rest = rest_m(trajectory)
    # All moments at which it may look, interpolated together: its own, the ones beside them, and after the end; and
    # those at which the sound of each meets the bob.
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
