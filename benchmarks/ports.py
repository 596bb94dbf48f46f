"""Measure the cost of reading many ports and check its limits: ``python benchmarks/ports.py``.

A separate process writes the line protocol to pseudo-terminals, with the time of sending as the device's clock. So the
measured processor time is that of the reader alone, and each sample shows its delay from sending to decoding. The
ports are read as in ``springmass record``: one thread reads every port, puts the bytes into the recorder's queue and
passes them to the port's chain.

The limits apply to one port at 100 Hz, one port at 1 kHz and 16 ports at 100 Hz. No sample may be lost, and half of
the samples must be decoded within a millisecond of sending. The median delay is printed relative to its limit; the
exit code is 1 if a limit is exceeded.
"""

from __future__ import annotations

import argparse
import os
import pty
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.clock import SystemClock
from acquisition.decoders.line_protocol import LineProtocolEncoder
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.live.reader import PortLine, PortReader
from acquisition.live.serial_port import SerialPort
from acquisition.readings import Read
from springmass.session.reads import Tee
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from storage.wire_log.scanning import read_log

PLANS = ((1, 100.0), (1, 1000.0), (16, 100.0))
"""Number of ports, and readings per second of each port, Hz."""
LIMIT_MS = 1.0
WRAP_US = 1 << 32
BAUD = 115200
SETTLE_S, PATIENCE_S, LOOK_S = 0.5, 10.0, 1.0


@dataclass(frozen=True)
class Figures:
    """The results of one plan: samples, processor time per second, and delays from the wire to the sample."""

    received: int
    expected: int
    recorded: int
    cpu_share: float
    p50_ms: float
    p99_ms: float

    @property
    def broken(self) -> bool:
        """Whether a sample is lost or the median delay exceeds its limit."""
        return not (self.received == self.recorded == self.expected and self.p50_ms <= LIMIT_MS)

    def line(self, name: str) -> str:
        """Return the results as a line of text."""
        count = f"{self.received} of {self.expected} samples, {self.recorded} in the log"
        ratio = f"{self.p50_ms / LIMIT_MS:.2f} of its limit"
        delay = f"wire to sample p50 {self.p50_ms:.3f} ms ({ratio}), p99 {self.p99_ms:.3f} ms"
        return f"{name:14} {count}, {delay}, {self.cpu_share:.2%} of a core"


class TimedTee(Tee):
    """A recording's link between ports, recorder and chains that also measures the delay of each reading."""

    def __init__(self, chains: Sequence[SensorChain]) -> None:
        super().__init__(chains)
        self._timed = chains
        self.delays_us: list[int] = []

    def reads(self, reads: Sequence[Read]) -> None:
        """Pass on the reads of a port, and measure the delays of their readings."""
        super().reads(reads)
        now_us = time.monotonic_ns() // 1000
        for channel in {channel for channel, _, _ in reads}:
            # The device stamps each line with its time of sending.
            self.delays_us += [(now_us - reading.device_us) % WRAP_US for reading in self._timed[channel].last]


def measure(*, ports: int, rate_hz: float, seconds: float) -> Figures:
    """Record ``ports`` ports for ``seconds`` seconds, and return the results."""
    command = [sys.executable, os.path.abspath(__file__), "--send"]
    command += ["--ports", str(ports), "--rate", str(rate_hz), "--seconds", str(seconds)]
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sender,
    ):
        assert sender.stdin is not None
        assert sender.stdout is not None
        paths = sender.stdout.readline().split()
        clock, family = SystemClock(), get_family("line-protocol")
        entries = tuple(SensorEntry(i, family.name, path, BAUD) for i, path in enumerate(paths))
        recorder = Recorder(Path(folder) / "run.wire", LogHeader(sensors=entries, mono_ns=0, unix_ns=0), clock)
        chains = [SensorChain(family, rate_hz=rate_hz) for _ in paths]
        tee = TimedTee(chains)
        tee.start(recorder, chains, 0)
        reader = PortReader([PortLine(SerialPort(path, BAUD), i) for i, path in enumerate(paths)], tee, clock)
        reader.start()
        over = threading.Event()
        over.wait(SETTLE_S)
        began, cpu = time.monotonic(), time.process_time()
        sender.stdin.write("go\n")
        sender.stdin.flush()
        expected = 0

        def hear() -> None:
            nonlocal expected
            expected = int(sender.stdout.readline())  # type: ignore[union-attr]
            over.set()

        ear = threading.Thread(target=hear)
        ear.start()
        received = 0
        while not over.wait(LOOK_S):
            received += sum(len(block) for _, block in tee.blocks())
        took, used = time.monotonic() - began, time.process_time() - cpu
        ear.join()
        deadline = time.monotonic() + PATIENCE_S
        while len(tee.delays_us) < expected and time.monotonic() < deadline:
            threading.Event().wait(0.05)
        reader.stop()
        received += sum(len(block) for _, block in tee.blocks())
        recorder.close()
        recorded = sum(r.payload.count(b"\n") for r in read_log(recorder.path) if r.kind is RecordKind.DATA)
        sender.stdin.write("end\n")
    p50, p99 = np.percentile(tee.delays_us, [50, 99]) / 1000 if tee.delays_us else (np.inf, np.inf)
    return Figures(received, expected, recorded, used / took, float(p50), float(p99))


def send(ports: int, rate_hz: float, seconds: float) -> None:
    """Write frames to pseudo-terminals, with the ports evenly spread over each step; print the number of frames."""
    pairs = [pty.openpty() for _ in range(ports)]
    for _, slave in pairs:
        tty.setraw(slave)
    print(" ".join(os.ttyname(slave) for _, slave in pairs), flush=True)
    sys.stdin.readline()
    encoder = LineProtocolEncoder()
    steps = round(seconds * rate_hz)
    clock = SystemClock()
    began = clock.now_ns()
    for sequence in range(steps):
        for index, (master, _) in enumerate(pairs):
            clock.sleep_until_ns(began + round((sequence + index / ports) * 1e9 / rate_hz))
            frame = encoder.encode(
                sequence=sequence,
                device_us=clock.now_ns() // 1000,
                echo_us=1500.0,
                distance_m=0.258,
                temperature_c=21.0,
            )
            os.write(master, frame)
    print(steps * ports, flush=True)
    sys.stdin.readline()  # keep the ports open until everything is read


def main() -> int:
    """Send frames, or measure every plan; return 1 if a limit is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, metavar="S", help="of each plan (%(default)s)")
    parser.add_argument("--send", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--ports", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--rate", type=float, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.send:
        send(given.ports, given.rate, given.seconds)
        return 0
    broken = False
    for ports, rate_hz in PLANS:
        figures = measure(ports=ports, rate_hz=rate_hz, seconds=given.seconds)
        print(figures.line(f"{ports} x {rate_hz:g} Hz"), flush=True)
        broken = broken or figures.broken
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
