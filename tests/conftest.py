"""What every test may ask for: synthetic runs, windows made by hand, and hypothesis that draws the same each time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from numpy.typing import ArrayLike

from pipeline.windows.demodulate import Demodulated
from tests import synthetic as synthetic_runs

# A slow machine is no fault of the data: neither a deadline nor the check for slow generation holds here.
for _profile, _examples in (("springmass", 20), ("nightly", 1000)):
    settings.register_profile(
        _profile,
        derandomize=True,
        deadline=None,
        max_examples=_examples,
        suppress_health_check=[HealthCheck.too_slow],
    )
settings.load_profile(os.environ.get("SPRINGMASS_EXAMPLES", "springmass"))

# Hypothesis also draws constants that it finds in the project's modules that are imported by then, which depends on
# the tests that the process ran before. No public setting turns that off; old versions do not draw them.
with contextlib.suppress(ImportError):
    from hypothesis.internal.conjecture import providers

    providers._get_local_constants = lambda: providers._local_constants

# A job in the background is started with Ctrl-C ignored, and hands that on to the programs that the tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


collect_ignore = ["plugin/check_extras.py"]  # a test of the plug-in, which is not installed here


@pytest.fixture(autouse=True)
def a_page_of_one_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wrap what the program prints at 100 columns, whatever terminal or test runner is around."""
    monkeypatch.setenv("COLUMNS", "100")


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    """Return the generator of synthetic runs, ``tests/synthetic.py``."""
    return synthetic_runs


@pytest.fixture(scope="session")
def windows() -> Callable[..., Demodulated]:
    """Return a function that makes the demodulated windows of a run from its amplitudes, phases and rests."""
    return demodulated


def demodulated(
    t: ArrayLike,
    amplitude: ArrayLike,
    *,
    omega: float = 8.3,
    phase: ArrayLike | None = None,
    offset: ArrayLike = 0.2,
    u: tuple[float, float, float] = (1e-5, 1e-4, 1e-5),
    noise_m: float = 3e-4,
) -> Demodulated:
    """Return windows at t (w,) s with independent uncertainties ``u`` of amplitude, phase and offset."""
    at = np.asarray(t, np.float64)
    samples = 76
    return Demodulated(
        t=at,
        amplitude=np.broadcast_to(np.asarray(amplitude, np.float64), at.shape).copy(),
        phase=omega * at if phase is None else np.asarray(phase, np.float64),
        offset=np.broadcast_to(np.asarray(offset, np.float64), at.shape).copy(),
        noise=np.full(at.size, noise_m),
        covariance=np.broadcast_to(np.diag(np.square(u)), (at.size, 3, 3)).copy(),
        count=np.full(at.size, samples),
        angular_frequency=omega,
        decay=np.zeros(at.size),
        residual=noise_m * np.tile([-1.0, 1.0], at.size * samples // 2),
        flags=np.zeros(at.size * samples, np.uint8),
        lost=0,
    )


CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, *(worker.pid for worker in cluster.workers.values()), flush=True)
        sys.stdin.read()
"""
CLUSTER_ENDS_S = 300.0


@pytest.fixture
def cluster() -> Iterator[tuple[str, list[int]]]:
    """A dask cluster of two processes: its address and their numbers."""
    process = subprocess.Popen(
        [sys.executable, "-c", CLUSTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdin is not None
    assert process.stdout is not None
    address, *pids = process.stdout.readline().decode().split()
    yield address, [int(pid) for pid in pids]
    process.stdin.close()
    process.wait(CLUSTER_ENDS_S)
    process.stdout.close()
