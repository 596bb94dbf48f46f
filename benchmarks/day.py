"""Memory over a simulated day at 100 Hz: `python benchmarks/day.py`.

A session records through its own threads, log and live analysis; only the clock and the port are simulated. The port
advances the clock by a tenth of a second whenever the session has nothing more to do, and sends what a sensor would
have sent by then, so that a day takes minutes.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
import threading
from pathlib import Path

from acquisition.decoders.line_protocol import LineProtocolEncoder
from acquisition.decoders.registry import get_family
from springmass.session.session import Progress, Sensor, Session
from storage.wire_log.scanning import read_log

RATE_HZ = 100
STEP_NS = 100_000_000
SPEED_M_PER_S = 344.0


class LockstepClock:
    """A clock that moves on only while a sleeper waits for it."""

    def __init__(self) -> None:
        self._now_ns = 1_000_000_000
        self._deadline_ns = 0
        self._changed = threading.Condition()

    def now_ns(self) -> int:
        """Return the simulated time."""
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Wait until the simulated time has come there."""
        with self._changed:
            self._deadline_ns = deadline_ns
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._now_ns >= deadline_ns)

    def advance(self, patience_s: float) -> bool:
        """Go one step on as soon as somebody sleeps; False where nobody does."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._deadline_ns > self._now_ns, patience_s):
                return False
            self._now_ns += STEP_NS
            self._changed.notify_all()
            return True


class SimulatedPort:
    """A port without a descriptor: each read brings what a sensor sent in a tenth of a second."""

    name = "simulated day"

    def __init__(self, clock: LockstepClock) -> None:
        self._clock = clock
        self._encoder = LineProtocolEncoder()
        self._sent = 0

    def fileno(self) -> int:
        """Have none."""
        return -1

    def read(self, wait_s: float = 0.25) -> bytes:
        """Return the next frames."""
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
        """Ignore requests: this sensor sends by itself."""

    def discard_input(self) -> None:
        """Hold nothing to discard."""

    def reopen(self) -> None:
        """Be open."""

    def close(self) -> None:
        """Have nothing to close."""


def resident_mb() -> float:
    """Memory of this process that is in use, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def record(hours: float, points: int) -> tuple[list[tuple[float, float]], int, int]:
    """Record; return (hours, MB) at that many equal steps, readings in the log, and records dropped."""
    clock = LockstepClock()
    session = Session([Sensor(get_family("line-protocol"), SimulatedPort(clock))], clock, kind="simulated")
    seconds = hours * 3600.0
    seen: list[tuple[float, float]] = []

    def note(progress: Progress) -> None:
        if round(progress.seconds) % 60 == 0:
            progress.motion()
        if progress.seconds >= (len(seen) + 1) * seconds / (points + 1):
            seen.append((progress.seconds / 3600.0, resident_mb()))

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "day.wire"
        session.listen()
        try:
            status = session.record(log, seconds=seconds, progress=note).status
        finally:
            session.stop()
        readings = sum(record.payload.count(b"\n") for record in read_log(log))
    return seen, readings, status.dropped_records


def main() -> int:
    """Print memory against time; 1 where it grew."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, metavar="H", help="length of the run (%(default)s)")
    parser.add_argument("--limit-mb", type=float, default=8.0, metavar="MB", help="growth that is flat (%(default)s)")
    options = parser.parse_args()
    seen, readings, dropped = record(options.hours, 12)
    for hours, mb in seen:
        print(f"{hours:6.2f} h  {mb:7.1f} MB")
    expected = round(options.hours * 3600 * RATE_HZ)
    growth = seen[-1][1] - seen[0][1]
    print(f"{readings} readings in the log of {expected}, {dropped} records dropped")
    print(f"growth from the first to the last: {growth:+.1f} MB (flat: below {options.limit_mb:g})")
    return int(growth > options.limit_mb or dropped > 0 or readings < expected)


if __name__ == "__main__":
    sys.exit(main())
