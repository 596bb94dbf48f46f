"""What reading many ports costs: samples, processor time and delay, beside a thread per port, in one run.

``python benchmarks/ports.py --seconds 20 --ports 200 --rate 100``. Senders run in a process of their own and write the
line protocol to pseudo-terminals, with the moment of sending as the device's clock; so the processor time counted is
the reader's alone, and each sample tells how long it took from the wire.
"""

from __future__ import annotations

import argparse
import os
import pty
import resource
import select
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import serial

from acquisition.chain import SensorChain
from acquisition.clock import SystemClock
from acquisition.decoders.line_protocol import LineProtocolEncoder
from acquisition.decoders.registry import get_family
from acquisition.serial_port import SerialPort
from acquisition.wired import Line, PortReader

WRAP_US = 1 << 32
BAUD = 115200
SETTLE_S = 0.5
PATIENCE_S = 10.0


@dataclass(frozen=True)
class Figures:
    """What one design gave."""

    received: int
    expected: int
    cpu_share: float
    p50_ms: float
    p99_ms: float

    def line(self, name: str) -> str:
        """Return one row for people."""
        known = np.isfinite(self.p50_ms)
        delay = f"wire to sample p50 {self.p50_ms:.3f} ms, p99 {self.p99_ms:.3f} ms" if known else ""
        return f"{name:44} {self.received:8} of {self.expected:8}  {self.cpu_share:7.2%} of a core  {delay}".rstrip()


@dataclass
class Channel:
    """Decodes one port's bytes, or counts its lines only, and notes how late they are."""

    decode: bool
    rate_hz: float
    received: int = 0
    delays_us: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the chain."""
        self._chain = SensorChain(get_family("line-protocol"), rate_hz=self.rate_hz)

    def take(self, host_ns: int, data: bytes) -> None:
        """Take the bytes of one read."""
        if not self.decode:
            self.received += data.count(b"\n")
            return
        count = len(self._chain.feed(host_ns, data))
        if count:
            self.received += count
            now_us = time.monotonic_ns() // 1000
            self.delays_us.append((now_us - int(self._chain.last.device_us[-1])) % WRAP_US)


class Sink:
    """Hands bytes to their channel."""

    def __init__(self, channels: Sequence[Channel]) -> None:
        self._channels = channels

    def data(self, channel: int, host_ns: int, data: bytes) -> None:
        """Take the bytes of one read."""
        self._channels[channel].take(host_ns, data)

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Say so: nothing is lost in a benchmark."""
        print(f"port {channel}: {kind} at {host_ns} ns, {dict(facts)}", file=sys.stderr)


def one_thread(paths: Sequence[str], channels: Sequence[Channel]) -> Callable[[], None]:
    """Start this project's reader; return what stops it."""
    lines = [Line(SerialPort(path, BAUD), i) for i, path in enumerate(paths)]
    reader = PortReader(lines, Sink(channels), SystemClock())
    reader.start()
    return reader.stop


def thread_per_port(paths: Sequence[str], channels: Sequence[Channel]) -> Callable[[], None]:
    """Start a thread for each port that reads what is there or waits for a byte; return what stops them.

    The calls are those of pyserial's ``read(in_waiting or 1)``, but for ``poll`` in place of its ``select``, which
    refuses descriptors from 1024.
    """
    stop = threading.Event()
    ports = [serial.Serial(path, BAUD, timeout=0) for path in paths]

    def read(port: Any, channel: Channel) -> None:
        ready = select.poll()
        ready.register(port.fileno(), select.POLLIN)
        while not stop.is_set():
            size = port.in_waiting or 1
            if ready.poll(250):
                channel.take(time.monotonic_ns(), os.read(port.fileno(), size))

    pairs = zip(ports, channels, strict=True)
    threads = [threading.Thread(target=read, args=pair, daemon=True) for pair in pairs]
    for thread in threads:
        thread.start()

    def end() -> None:
        stop.set()
        for thread in threads:
            thread.join()
        for port in ports:
            port.close()

    return end


Design = Callable[[Sequence[str], Sequence[Channel]], Callable[[], None]]
DESIGNS: dict[str, Design] = {"one thread": one_thread, "thread per port": thread_per_port}


def measure(design: Design, *, ports: int, rate_hz: float, seconds: float, decode: bool) -> Figures:
    """Read so many ports for so long with one design."""
    command = [sys.executable, os.path.abspath(__file__), "--send"]
    command += ["--ports", str(ports), "--rate", str(rate_hz), "--seconds", str(seconds)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sender:
        assert sender.stdin is not None
        assert sender.stdout is not None
        paths = sender.stdout.readline().split()
        channels = [Channel(decode, rate_hz) for _ in paths]
        stop = design(paths, channels)
        threading.Event().wait(SETTLE_S)
        began, cpu = time.monotonic(), time.process_time()
        sender.stdin.write("go\n")
        sender.stdin.flush()
        expected = int(sender.stdout.readline())
        took, used = time.monotonic() - began, time.process_time() - cpu
        deadline = time.monotonic() + PATIENCE_S
        while sum(channel.received for channel in channels) < expected and time.monotonic() < deadline:
            threading.Event().wait(0.05)
        stop()
        sender.stdin.write("end\n")
    delays = np.concatenate([np.array(channel.delays_us) for channel in channels]) / 1000 if decode else np.empty(0)
    p50, p99 = np.percentile(delays, [50, 99]) if delays.size else (np.nan, np.nan)
    return Figures(sum(channel.received for channel in channels), expected, used / took, float(p50), float(p99))


def send(ports: int, rate_hz: float, seconds: float) -> None:
    """Write frames to pseudo-terminals, the ports evenly spread over each step; say how many."""
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
    sys.stdin.readline()  # the ports stay until everything is read


def allow_descriptors() -> None:
    """Take as many descriptors as the system gives: pyserial holds five for each port."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def main() -> int:
    """Print the figures of both designs, and of one port at 1 kHz."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ports", type=int, default=200)
    parser.add_argument("--rate", type=float, default=100.0, help="Hz")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--send", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    allow_descriptors()
    if given.send:
        send(given.ports, given.rate, given.seconds)
        return 0
    bad = 0
    shares = {}
    cases = [(1, 100.0, "one thread"), (1, 1000.0, "one thread")]
    cases += [(given.ports, given.rate, name) for name in DESIGNS]
    for decode in (True, False):
        for ports, rate_hz, name in cases:
            figures = measure(DESIGNS[name], ports=ports, rate_hz=rate_hz, seconds=given.seconds, decode=decode)
            shares[decode, ports, rate_hz, name] = figures.cpu_share
            what = "decoded" if decode else "read"
            print(figures.line(f"{ports} x {rate_hz:g} Hz {what}, {name}"), flush=True)
            bad += name == "one thread" and figures.received != figures.expected
        ours, theirs = (shares[decode, given.ports, given.rate, name] for name in DESIGNS)
        print(f"one thread over a thread per port: {ours / theirs:.2f} x", flush=True)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
