"""What every test may ask for: output of one width, a cluster, and hypothesis that draws the same each time."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

# A slow machine is no fault of the data: neither a deadline nor the check for slow generation holds here.
for _profile, _examples in (("springmass", 20), ("nightly", 1000)):
    settings.register_profile(
        _profile, derandomize=True, deadline=None, max_examples=_examples, suppress_health_check=[HealthCheck.too_slow]
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
