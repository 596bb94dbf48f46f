"""Measure the cost of a recording relative to its limit of 3 % of a core: `python benchmarks/recording.py`.

A simulated sensor runs in a separate process; `springmass record` reads it twice, in a short and a long run. The
difference of the two is the cost of recording and of building the run file at the end, without that of the start.
Both runs are made with the progress line discarded, and again with the progress line on a terminal. The exit code is 1
if the limit is exceeded or a reading is missing.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import pty
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

from springmass import load

LIMIT = 0.03
"""Maximum share of a core, for one sensor at 100 Hz."""

SENSOR = """
import sys
import numpy as np
from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.simulated import VirtualRangefinder, VirtualSensor
from acquisition.simulated import VirtualPort

finder = VirtualRangefinder(lambda t: 0.25 + 0.05 * np.cos(8 * t), VirtualSensor(), np.random.default_rng(5))
with VirtualPort(get_family("line-protocol"), finder, SystemClock(), seconds=3600.0) as port:
    print(port.path, flush=True)
    port.start()
    sys.stdin.read()
"""


def main() -> int:
    """Record short and long runs, without and with a terminal; print samples and CPU; return 1 if one fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", type=int, default=5, metavar="S", help="seconds of the short run (%(default)s)")
    parser.add_argument("--long", type=int, default=125, metavar="S", help="seconds of the long run (%(default)s)")
    options = parser.parse_args()
    pipe = subprocess.PIPE
    broken = False
    with subprocess.Popen([sys.executable, "-c", SENSOR], stdin=pipe, stdout=pipe, text=True) as sensor:
        assert sensor.stdout is not None
        assert sensor.stdin is not None
        port = sensor.stdout.readline().strip()
        for where, terminal in (("without a page", False), ("with its line on a terminal", True)):
            short, long = (measure(port, seconds, terminal=terminal) for seconds in (options.short, options.long))
            share = (long[2] - short[2]) / (options.long - options.short)
            print(f"samples: {long[0]} in {options.long} s at 100 Hz, {long[1]} gaps")
            ratio = f"{share / LIMIT:.2f} of its limit"
            print(f"CPU: {share:.2%} of a core while recording {where}, {ratio} ({long[2]:.2f} s for the long run)")
            broken = broken or share > LIMIT or long[1] > 0
        sensor.stdin.close()
    return int(broken)


def measure(port: str, seconds: int, *, terminal: bool) -> tuple[int, int, float]:
    """Record once; return the numbers of samples and gaps, and the processor time, s."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.h5"
        command = ["record", "--port", port, "--sensor", "line-protocol", "--seconds", str(seconds), "-o", str(run)]
        with _stderr(terminal) as stderr:
            environment = {**os.environ, "TERM": "xterm-256color", "PYTHONUTF8": "1"}
            child = subprocess.Popen([sys.executable, "-m", "springmass", *command], stderr=stderr, env=environment)
            _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise SystemExit(f"springmass record ended with exit code {child.returncode}")
        samples = load(run).loaded.samples
        return len(samples), int((samples.flags != 0).sum()), usage.ru_utime + usage.ru_stime


@contextlib.contextmanager
def _stderr(terminal: bool) -> Iterator[int]:
    """Yield the destination of the progress line: the null device, or a terminal whose output is read."""
    if not terminal:
        yield subprocess.DEVNULL
        return
    master, slave = pty.openpty()
    reader = threading.Thread(target=_read_on, args=(master,))
    reader.start()
    try:
        yield slave
    finally:
        os.close(slave)
        reader.join()
        os.close(master)


def _read_on(master: int) -> None:
    """Read until the other side is closed, which a pseudo-terminal reports as an error."""
    with contextlib.suppress(OSError):
        while os.read(master, 4096):
            pass


if __name__ == "__main__":
    raise SystemExit(main())
