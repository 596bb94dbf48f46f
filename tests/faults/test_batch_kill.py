"""kill -9 of a course's processes: what was killed is done again, and the results are those of a clean pass.

``SPRINGMASS_KILLS`` sets the number of trials each way to a twelfth of it, and the course to its whole length.
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from springmass.cli import main
from tests.courses import contents, rows_of, short_course

TRIALS = max(1, int(os.environ.get("SPRINGMASS_KILLS", "12")) // 12)
LIMIT_S = 300.0
RUNS = 24 if "SPRINGMASS_KILLS" in os.environ else 6
DASK_RUNS = 250 if "SPRINGMASS_KILLS" in os.environ else RUNS  # three tasks, or one
OPTIONS = ("--reports", "0", "--accuracy", "fast")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, bytes], float]:
    """A course, the results of a clean pass over it, and how long a pass by two processes takes, s."""
    top = tmp_path_factory.mktemp("course")
    runs = short_course(top / "runs", RUNS)
    assert main(["batch", str(runs), "-o", str(top / "clean" / "out"), "--jobs", "1", *OPTIONS]) == 0
    began = time.monotonic()
    assert started(runs, top / "timed" / "out").wait(LIMIT_S) == 0
    return runs, contents(top / "clean" / "out"), time.monotonic() - began


def started(runs: Path, out: Path, *options: str) -> subprocess.Popen[bytes]:
    """Start a pass."""
    command = [sys.executable, "-m", "springmass", "batch", str(runs), "-o", str(out), *(options or ("--jobs", "2"))]
    return subprocess.Popen([*command, *OPTIONS], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)


def children(pid: int) -> list[int]:
    """Return the processes below one, as Linux lists them."""
    try:
        below = [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []
    return [each for first in below for each in (first, *children(first))]


def is_worker(pid: int) -> bool:
    """Tell a process of the pool from what keeps track of its semaphores."""
    try:
        return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


@pytest.mark.trials
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds processes by /proc")
@pytest.mark.parametrize("who", ["parent", "worker"])
def test_a_killed_pass_is_completed(place, tmp_path, who):
    """The parent killed, or a worker, at any moment: nothing doubled or missing, the same bytes, no process left."""
    runs, clean, seconds = place
    moments = random.Random(5)
    for trial in range(TRIALS):
        out = tmp_path / f"{trial}" / "out"
        process = started(runs, out)
        deadline = time.monotonic() + seconds * moments.uniform(0.1, 1.0)
        below: list[int] = []
        while time.monotonic() < deadline and process.poll() is None:
            below = children(process.pid) or below
            time.sleep(0.01)  # the moment is by the clock of the machine: what is killed is a process of it
        victims = [process.pid] if who == "parent" else [pid for pid in below if is_worker(pid)][:1]
        if process.poll() is None:
            for pid in victims:
                os.kill(pid, signal.SIGKILL)
        code = process.wait(LIMIT_S)
        assert code == (-signal.SIGKILL if who == "parent" and code < 0 else 0), code
        until = time.monotonic() + LIMIT_S
        while any(is_worker(pid) for pid in below) and time.monotonic() < until:
            time.sleep(0.01)
        assert not [pid for pid in below if is_worker(pid)]
        assert started(runs, out).wait(LIMIT_S) == 0
        assert contents(out) == clean
        assert [row["run"] for row in rows_of(out / "results.csv")] == [f"run{i:03d}" for i in range(RUNS)]


def used_s(pid: int) -> float:
    """Return the processor time that a process has used, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.trials
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds the worker that is at work by /proc")
def test_a_worker_of_dask_killed_in_the_middle_is_replaced(tmp_path, cluster):
    """The worker at work is killed: its task of a hundred runs goes to another, and the results are the same."""
    runs = short_course(tmp_path / "runs", DASK_RUNS)
    (tmp_path / "clean").mkdir()
    assert main(["batch", str(runs), "-o", str(tmp_path / "clean" / "out"), "--jobs", "1", *OPTIONS]) == 0
    address, pids = cluster
    before = {pid: used_s(pid) for pid in pids}
    process = started(runs, tmp_path / "out", "--dask", address)
    victim = None
    while process.poll() is None and victim is None:
        victim = next((pid for pid in pids if used_s(pid) - before[pid] > 0.8), None)  # imports alone are less
        time.sleep(0.01)
    if victim is not None:
        os.kill(victim, signal.SIGKILL)
    assert process.wait(LIMIT_S) == 0
    assert contents(tmp_path / "out") == contents(tmp_path / "clean" / "out")
