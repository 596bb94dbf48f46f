"""Periods behind simulated adapters: within 4 u, and pooled over all runs of a latency neither too far nor too near.

``SPRINGMASS_TRIALS=20 pytest -m trials tests/trials/test_line_times.py -s`` prints the table of all adapters.
"""

from __future__ import annotations

import itertools
import os

import numpy as np
import pytest

from acquisition.block import Flag, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.recordings.recording import Recording
from pipeline.analyse import analyse
from springmass.loading.loaded import Loaded
from tests.adapters import PERIOD_S, Adapter, delivered

SEEDS = min(20, int(os.environ.get("SPRINGMASS_TRIALS", "2")))
LOST, JITTER_S = (0.0, 0.01, 0.05), (0.0, 0.001, 0.003)

pytestmark = pytest.mark.trials


@pytest.mark.parametrize("latency_s", [0.001, 0.002, 0.016, 0.24])
def test_periods_behind_an_adapter(latency_s: float) -> None:
    """The rms of all z is 0.7 to 1.2 and no period is 4 u off; at 240 ms lost lines may make u larger."""
    pooled = []
    for waits, lost, jitter_s in itertools.product((False, True), LOST, JITTER_S):
        adapter, z, u_ppm, noise_mm, used = Adapter(latency_s, lost, jitter_s, waits), [], [], [], []
        for seed in range(SEEDS):
            chain = SensorChain(get_family("text-lines"), options={"unit": "cm"})
            reads, _ = delivered(adapter, 30.0, seed)
            block = chain.settle(concatenate([chain.feed(host_ns, data) for host_ns, data in reads]))
            run = analyse(Loaded(Recording("wire", "", chain.info("port"), "", block), "wire").track)
            period = run.estimates["period"]
            z.append((period.value - PERIOD_S) / period.u)
            u_ppm.append(1e6 * period.u / PERIOD_S)
            noise_mm.append(1e3 * run.estimates["noise"].value)
            used.append(float(np.mean((run.flags & ~np.uint8(Flag.GAP_BEFORE)) == 0)))
        print(
            f"{1e3 * latency_s:4.0f} ms, {lost:4.0%} lost, jitter {1e3 * jitter_s:.0f} ms, waits {waits!s:5}: "
            f"z rms {np.sqrt(np.mean(np.square(z))):.2f}, largest {np.abs(z).max():.2f}; u {np.median(u_ppm):.0f} ppm; "
            f"noise {np.median(noise_mm):.3f} mm; used {np.median(used):.1%}"
        )
        pooled += z
    rms = float(np.sqrt(np.mean(np.square(pooled))))
    print(f"{1e3 * latency_s:4.0f} ms: rms of all z {rms:.2f}, largest {np.abs(pooled).max():.2f}")
    assert np.abs(pooled).max() < 4.0
    chance = 3.0 / np.sqrt(2 * len(pooled))
    assert 0.7 - chance < rms < 1.2 + chance
