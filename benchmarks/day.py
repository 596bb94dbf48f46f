"""Measure memory during a simulated day at 100 Hz, and cost of its recovery: `python benchmarks/day.py`.

A session records with its usual threads, log and live analysis; only the clock and the port are simulated. Whenever
the session is idle, the port advances the clock by a tenth of a second and sends the readings of that time, so that a
day takes minutes. The clock stands still while the motion is analysed, once a minute.

Memory grows until the libraries are loaded and the times kept for the clock's rate have reached their maximum number,
after one and a half hours. The growth per hour is the slope of a straight line through what follows.

A separate process then recovers the log. It reports its wall time, its processor time and its peak memory (VmHWM).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.decoders.line_protocol import LineProtocolEncoder
from acquisition.decoders.registry import get_family
from acquisition.live.clock_fit import MAX_SAMPLES
from springmass.session.live_state import Progress
from springmass.session.sensors import OpenSensor
from springmass.session.session import RunLimits, RunListeners, Session
from storage.recovery.recover import recover
from storage.wire_log.scanning import read_log

RATE_HZ = 100
STEP_NS = 100_000_000
SPEED_M_PER_S = 344.0
PEAK_MB = 200.0
WARM_H = MAX_SAMPLES / RATE_HZ / 3600.0


class LockstepClock:
    """A clock that advances only while a thread waits for it."""

    def __init__(self) -> None:
        self._now_ns = 1_000_000_000
        self._deadline_ns = 0
        self._changed = threading.Condition()
        self.stopped = self._changed  # a context in which the time stands still

    def now_ns(self) -> int:
        """Return the simulated time."""
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Wait until the simulated time reaches the deadline."""
        with self._changed:
            self._deadline_ns = deadline_ns
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._now_ns >= deadline_ns)

    def advance(self, patience_s: float) -> bool:
        """Advance by one step as soon as a thread waits; return False if none waits within ``patience_s``."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._deadline_ns > self._now_ns, patience_s):
                return False
            self._now_ns += STEP_NS
            self._changed.notify_all()
            return True


class SimulatedPort:
    """A port each of whose reads returns the bytes that a sensor sends in a tenth of a second."""

    name = "simulated day"
    is_network = False
    shared = False

    def __init__(self, clock: LockstepClock) -> None:
        self._clock = clock
        self._encoder = LineProtocolEncoder()
        self._sent = 0

    def read(self, wait_s: float = 0.25) -> bytes:
        """Return the next frames; empty if the session does not wait."""
        if not self._clock.advance(wait_s):
            return b""
        count = RATE_HZ * STEP_NS // 1_000_000_000
        frames = b"".join(self._frame(i) for i in range(self._sent, self._sent + count))
        self._sent += count
        return frames

    def _frame(self, index: int) -> bytes:
        t = index / RATE_HZ
        distance_m = 0.25 + 0.05 * math.cos(8.3 * t)
        return self._encoder.encode(
            sequence=index,
            device_us=round(t * 1e6),
            echo_us=2e6 * distance_m / SPEED_M_PER_S,
            distance_m=distance_m,
            temperature_c=20.0,
        )

    def write(self, data: bytes) -> None:
        """Ignore requests, because this sensor sends without them."""

    def discard_input(self) -> None:
        """Do nothing, because no input is buffered."""

    def close(self) -> None:
        """Do nothing, because there is nothing to close."""


def resident_mb() -> float:
    """Return the resident memory of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def peak_mb() -> float:
    """Return the maximum resident memory of this process so far, MB."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024 / 1e6


@dataclass(frozen=True)
class Cost:
    """The cost of a recovery: samples, wall time, processor time and peak memory."""

    samples: int
    seconds: float
    processor_s: float
    peak_mb: float


def recovered(log: Path) -> Cost:
    """Recover a log in a separate process, and remove it as at the end of a recording."""
    command = [sys.executable, __file__, "--recover", str(log)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return Cost(**json.loads(output))


def recover_here(log: Path) -> Cost:
    """Recover a log in this process."""
    start_s, start_processor_s = time.perf_counter(), time.process_time()
    (run,) = recover(log, log.with_suffix(".h5"), overwrite=True, remove_log=True).runs
    seconds, processor_s = time.perf_counter() - start_s, time.process_time() - start_processor_s
    return Cost(run.samples, seconds, processor_s, peak_mb())


def record(hours: float) -> tuple[list[tuple[float, float]], int, int, Cost]:
    """Record; return (hours, MB) in each minute, readings in the log, dropped records, and recovery cost."""
    clock = LockstepClock()
    session = Session([OpenSensor(get_family("line-protocol"), SimulatedPort(clock))], clock, kind="simulated")
    seen: list[tuple[float, float]] = []

    def note(progress: Progress) -> None:
        if progress.seconds >= 60.0 * (len(seen) + 1):
            with clock.stopped:
                progress.motion()
            seen.append((progress.seconds / 3600.0, resident_mb()))

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "day.wire"
        session.listen()
        try:
            status = session.record(log, RunLimits(seconds=hours * 3600.0), RunListeners(progress=note)).status
        finally:
            session.stop()
        readings = sum(record.payload.count(b"\n") for record in read_log(log))
        cost = recovered(log)
    return seen, readings, status.dropped_records, cost


def main() -> int:
    """Print memory over time; return 1 if a limit is exceeded or a reading is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, metavar="H", help="length of the run (%(default)s)")
    parser.add_argument(
        "--limit-mb", type=float, default=2.0, metavar="MB", help="growth per hour that is flat (%(default)s)"
    )
    parser.add_argument("--recover", type=Path, metavar="LOG", help="only recover this log, which is removed")
    options = parser.parse_args()
    if options.recover is not None:
        print(json.dumps(dataclasses.asdict(recover_here(options.recover))))
        return 0
    if options.hours < 2.0 * WARM_H:
        parser.error(f"memory is steady after {WARM_H:.2f} h; take twice this time or more")
    seen, readings, dropped, cost = record(options.hours)
    for hours, mb in seen[:: len(seen) // 12]:
        print(f"{hours:6.2f} h  {mb:7.1f} MB")
    expected = round(options.hours * 3600 * RATE_HZ)
    steady = np.array([each for each in seen if each[0] > WARM_H])
    growth = float(np.polyfit(*steady.T, 1)[0])
    print(f"{readings} readings in the log of {expected}, {dropped} records dropped")
    print(f"growth after {WARM_H:.2f} h: {growth:+.2f} MB per hour (flat: below {options.limit_mb:g})")
    print(
        f"recovered: {cost.samples} samples in {cost.seconds:.1f} s ({cost.processor_s:.1f} s of the processor, "
        f"{cost.samples / cost.processor_s:.0f} samples/s), peak of memory {cost.peak_mb:.0f} MB (limit {PEAK_MB:g})"
    )
    whole = readings >= expected and cost.samples >= expected
    return int(growth > options.limit_mb or dropped > 0 or not whole or cost.peak_mb > PEAK_MB)


if __name__ == "__main__":
    sys.exit(main())
