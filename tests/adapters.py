"""Simulated boards and adapters: lines that a bob over a rangefinder gives, and the reads in which they arrive.

This shares no code with the search for their times: a board sends at its own rate, an adapter collects what came and
hands it over at its own ticks, and the computer stamps each read with a clock that is wrong by its tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PERIOD_S = 0.790066
U_CRYSTAL = 50e-6 / math.sqrt(3.0)
NOISE_M = 0.3e-3
SOUND_M_PER_S = 344.0

F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Adapter:
    """How lines are sent and delivered: times in s, the share of lost lines, whether a sketch waits for the echo."""

    latency_s: float
    lost: float = 0.0
    jitter_s: float = 0.0
    waits: bool = False
    step_s: float = 0.01
    wandering: float = 0.0  # standard deviation of each step, relative


def bob_m(t: F8) -> F8:
    """Return the distance of the bob, m, at the times t, s."""
    return np.asarray(0.269 + 0.052 * np.exp(-0.015 * t) * np.cos(2 * np.pi * t / PERIOD_S + 1.0))


def sent(adapter: Adapter, seconds: float, rng: np.random.Generator) -> F8:
    """Return when the board measured the distance of each line, s."""
    step_s = adapter.step_s * (1.0 + rng.normal(0.0, U_CRYSTAL))
    times, t = [], float(rng.uniform(0.0, step_s))
    sound = SOUND_M_PER_S * (1.0 + rng.normal(0.0, 0.005))
    while t < seconds:
        times.append(t)
        t += step_s * (1.0 + adapter.wandering * rng.standard_normal())
        t += 2.0 * float(bob_m(np.array(t))) / sound if adapter.waits else 0.0
    return np.array(times)


def delivered(adapter: Adapter, seconds: float, seed: int) -> tuple[list[tuple[int, bytes]], F8]:
    """Return reads, each a host time in ns and bytes of text lines in cm, and the true times of the lines in them."""
    rng = np.random.default_rng([seed, *(round(1e6 * x) for x in (adapter.latency_s, adapter.lost, adapter.jitter_s))])
    true_s = sent(adapter, seconds, rng)
    printed = 100.0 * (bob_m(true_s) + NOISE_M * rng.standard_normal(true_s.size))
    came = np.maximum.accumulate(true_s + adapter.jitter_s * rng.standard_normal(true_s.size))
    kept = rng.random(true_s.size) >= adapter.lost
    tick_s, phase_s = adapter.latency_s * (1.0 + rng.normal(0.0, U_CRYSTAL)), rng.uniform(0.0, adapter.latency_s)
    ticks = np.ceil((came[kept] - phase_s) / tick_s)
    host = 1.0 + rng.normal(0.0, U_CRYSTAL)
    reads = []
    for tick in np.unique(ticks):
        at_s = (5.0 + phase_s + tick * tick_s + rng.exponential(1e-4)) * host
        reads.append((round(at_s * 1e9), b"".join(b"%.2f\r\n" % x for x in printed[kept][ticks == tick])))
    return reads, true_s[kept]
