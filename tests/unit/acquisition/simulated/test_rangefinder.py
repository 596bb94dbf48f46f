"""The simulated rangefinder: its false echoes have the size and the places that it is set to."""

import math

import numpy as np

from acquisition.simulated import VirtualRangefinder, VirtualSensor


def bob(t: float) -> float:
    """Return the position of a swing of 5 cm about 25 cm."""
    return 0.25 + 0.05 * math.sin(7.9 * t)


def met(t: float, speed: float = 344.0) -> float:
    """Return how far away sound that leaves at a time meets the bob."""
    distance = bob(t)
    for _ in range(5):
        distance = bob(t + distance / speed)
    return distance


def test_false_echoes_come_in_clusters_where_the_bob_turns_near_the_sensor() -> None:
    """Runs of 3 to 17 readings lie 2.5 to 7.5 mm beyond the bob, each from a nearest turning point on."""
    sensor = VirtualSensor(noise_m=0.0, false_echo_rate_hz=0.3)
    finder = VirtualRangefinder(bob, sensor, np.random.default_rng(1))
    result = np.array([finder.shot(i).distance_m for i in range(20_000)])
    off = result - np.array([met(i / 100) for i in range(20_000)])
    false = off > 1e-3
    edges = np.flatnonzero(np.diff(np.concatenate([[False], false, [False]]).astype(int)))
    lengths = edges[1::2] - edges[::2]
    assert 30 < lengths.size < 120
    assert 3 <= lengths.min() <= lengths.max() <= 17
    assert np.all((off[false] > 2.4e-3) & (off[false] < 7.6e-3))
    assert all(bob((start - 1) / 100) < 0.2005 for start in edges[::2])
    assert np.all(np.abs(off[~false]) < 25e-6)
