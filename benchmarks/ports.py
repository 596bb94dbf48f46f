"""What reading many ports costs: samples, processor time and delay, beside a thread per port, in one run.

``python benchmarks/ports.py --seconds 20 --ports 200 --rate 100``. Senders run in a process of their own and write the
line protocol to pseudo-terminals, with the moment of sending as the device's clock; so the processor time counted is
the reader's alone, and each sample tells how long it took from the wire until it was parsed.

Each design gives a port's bytes to a chain of its own, from which the samples are taken ten times a second; or once a
second, beside a wire log, as `springmass record` does it, which then decodes many readings at a time. One design is
what `springmass record` does: one thread reads, then decodes (`springmass/session/reads.py`). Disturbances it stand two
with a thread
for each port that reads what is there and decodes it as it comes: pyserial's own `serial.threaded.ReaderThread`, and
the leanest such thread that we could write, which leaves out most of what pyserial does around each read.
"""

from __future__ import annotations

import argparse
import os
import pty
import resource
import select
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import serial
from serial.serialposix import PosixPollSerial
from serial.threaded import Protocol as PortProtocol
from serial.threaded import ReaderThread

from acquisition.block import I8, Block, concatenate
from acquisition.clock import Clock, SystemClock
from acquisition.decoders.base import Family
from acquisition.decoders.line_protocol import LineProtocolEncoder
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import Chains, SensorChain
from acquisition.live.reader import CADENCE_NS, Line, PortReader
from acquisition.live.serial_port import SerialPort
from acquisition.readings import NO_READINGS, Read, Readings
from springmass.session.reads import Tee
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, SensorEntry

WRAP_US = 1 << 32
BAUD = 115200
SETTLE_S = 0.5
PATIENCE_S = 10.0
LOOK_S, SELDOM_S = 0.1, 1.0
Parsed = tuple[int, int]
"""Host's stamp of the last read of a piece, and when that piece was parsed, ns."""
CADENCES_MS = (0.0, 0.25, 0.5, 0.9, 2.0, 5.0)


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


class TimedChain(SensorChain):
    """The real chain, that keeps its blocks: what they tell of delays is worked out when all is over."""

    def __init__(self, family: Family, rate_hz: float) -> None:
        super().__init__(family, rate_hz=rate_hz)
        self.received = 0
        self.kept: list[Block] = []

    def _block(self, *columns: Any) -> Block:
        block = super()._block(*columns)
        self.received += len(block)
        self.kept.append(block)
        return block

    def delays_us(self, parsed: Sequence[Parsed]) -> I8:
        """Return how long it took from the moment of sending until a reading was parsed."""
        blocks = concatenate(self.kept)
        if not len(blocks):
            return np.empty(0, np.int64)
        # The device stamps each line with the moment of sending; its time axis begins with the first one.
        first_us = (self.timebase._last_raw or 0) - self.timebase._ticks
        sent_us = first_us + np.round(blocks.t * 1e6).astype(np.int64)
        until_ns, parsed_ns = np.array(parsed).T
        # Several pieces may hold reads of one wake-up; the last one is it then.
        at = np.searchsorted(until_ns, blocks.host_ns, side="right")
        at -= until_ns[at - 1] == blocks.host_ns
        return np.asarray((parsed_ns[at] // 1000 - sent_us) % WRAP_US)


class CountingChain(TimedChain):
    """Counts lines and decodes none."""

    def __init__(self, family: Family, rate_hz: float) -> None:
        super().__init__(replace(family, whole=None), rate_hz)

    def decode(self, host_ns: int, data: bytes) -> Readings:  # noqa: ARG002
        """Take the bytes of one read."""
        self.received += data.count(b"\n")
        return NO_READINGS


class TimedChains(Chains):
    """The real chains, that note when what was read of all ports at a time was parsed."""

    def __init__(self, chains: Sequence[SensorChain]) -> None:
        super().__init__(chains)
        self.parsed: list[Parsed] = []

    def take(self, reads: Sequence[Read]) -> None:
        """Take reads."""
        super().take(reads)
        if reads:
            self.parsed.append((reads[-1][1], time.monotonic_ns()))


def recorder(log: Path, paths: Sequence[str], clock: Clock) -> Recorder:
    """Return what a recording of these ports appends to."""
    entries = tuple(SensorEntry(i, "line-protocol", path, BAUD) for i, path in enumerate(paths))
    log.unlink(missing_ok=True)
    return Recorder(log, LogHeader(sensors=entries, mono_ns=0, unix_ns=0), clock, own_clocks=True)


class Running(Protocol):
    """A design at work."""

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples since the last call."""
        ...

    def parsed(self, channel: int) -> Sequence[Parsed]:
        """Return when what was read of a port was parsed."""
        ...

    def stop(self) -> None:
        """Come to an end."""
        ...


class OneThread:
    """What a recording does, with the cadence to be tried, and a recorder where there is to be one."""

    def __init__(
        self,
        paths: Sequence[str],
        chains: Sequence[SensorChain],
        *,
        cadence_ns: int = CADENCE_NS,
        log: Path | None = None,
    ) -> None:
        clock = SystemClock()
        lines = [Line(SerialPort(path, BAUD), i) for i, path in enumerate(paths)]
        timed = TimedChains(chains)
        tee = Tee(timed, {})
        tee.heard_enough()
        self._recorder = None
        if log is not None:
            self._recorder = recorder(log, paths, clock)
            tee.start(self._recorder, timed, 0)
        self._reader = PortReader(lines, tee, clock, decode=tee.decode, cadence_ns=cadence_ns)
        self._reader.start()
        self.blocks = tee.blocks
        self._parsed = timed.parsed

    def parsed(self, channel: int) -> Sequence[Parsed]:  # noqa: ARG002 - all were parsed together
        """Return when what was read was parsed."""
        return self._parsed

    def stop(self) -> None:
        """Stop reading."""
        self._reader.stop()
        if self._recorder is not None:
            self._recorder.close()


class LockedChains:
    """Chains that threads of their own feed, each behind a lock."""

    def __init__(self, chains: Sequence[SensorChain]) -> None:
        self._chains: list[tuple[SensorChain, threading.Lock, list[Parsed]]]
        self._chains = [(chain, threading.Lock(), []) for chain in chains]

    def take(self, channel: int, data: bytes) -> None:
        """Decode what one port sent."""
        chain, lock, parsed = self._chains[channel]
        with lock:
            read_ns = time.monotonic_ns()
            chain.take(read_ns, data)
            parsed.append((read_ns, time.monotonic_ns()))

    def parsed(self, channel: int) -> Sequence[Parsed]:
        """Return when what was read of a port was parsed."""
        return self._chains[channel][2]

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples since the last call."""
        found = []
        for channel, (chain, lock, _) in enumerate(self._chains):
            with lock:
                if len(chain):
                    found.append((channel, chain.block()))
        return found


class ReaderThreads:
    """pyserial's ReaderThread for each port, over its class that waits with ``poll``: ``select`` ends at 1024."""

    def __init__(self, paths: Sequence[str], chains: Sequence[SensorChain]) -> None:
        locked = LockedChains(chains)

        class Feeding(PortProtocol):  # type: ignore[misc]
            def __init__(self, channel: int) -> None:
                self._channel = channel

            def data_received(self, data: bytes) -> None:
                locked.take(self._channel, bytes(data))

        self._threads = [
            ReaderThread(PosixPollSerial(path, BAUD), partial(Feeding, channel)) for channel, path in enumerate(paths)
        ]
        for thread in self._threads:
            thread.start()
        self.blocks, self.parsed = locked.blocks, locked.parsed

    def stop(self) -> None:
        """Stop all threads."""
        for thread in self._threads:
            thread.close()


class LeanThreads:
    """A thread for each port that reads what is there or waits for a byte, and decodes it.

    The calls are those of pyserial's ``read(in_waiting or 1)``, but for ``poll`` in place of its ``select``, which
    refuses descriptors from 1024. With a log, each thread puts what it read into the recorder's queue first.
    """

    def __init__(self, paths: Sequence[str], chains: Sequence[SensorChain], *, log: Path | None = None) -> None:
        self._stop = threading.Event()
        self._recorder = None if log is None else recorder(log, paths, SystemClock())
        self._ports = [serial.Serial(path, BAUD, timeout=0) for path in paths]
        self._locked = LockedChains(chains)
        self._threads = [threading.Thread(target=self._read, args=(i,), daemon=True) for i in range(len(paths))]
        for thread in self._threads:
            thread.start()
        self.blocks, self.parsed = self._locked.blocks, self._locked.parsed

    def _read(self, channel: int) -> None:
        port = self._ports[channel]
        ready = select.poll()
        ready.register(port.fileno(), select.POLLIN)
        while not self._stop.is_set():
            size = port.in_waiting or 1
            if ready.poll(250):
                data = os.read(port.fileno(), size)
                if self._recorder is not None:
                    self._recorder.put(channel, time.monotonic_ns(), data)
                self._locked.take(channel, data)

    def stop(self) -> None:
        """Stop all threads."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for port in self._ports:
            port.close()
        if self._recorder is not None:
            self._recorder.close()


Design = Callable[[Sequence[str], Sequence[SensorChain]], Running]
THREADS: dict[str, Design] = {"pyserial's ReaderThread": ReaderThreads, "lean threads": LeanThreads}
DESIGNS: dict[str, Design] = {"one thread": OneThread, **THREADS}


def measure(
    design: Design, *, ports: int, rate_hz: float, seconds: float, decode: bool, look_s: float = LOOK_S
) -> Figures:
    """Read so many ports for so long with one design."""
    command = [sys.executable, os.path.abspath(__file__), "--send"]
    command += ["--ports", str(ports), "--rate", str(rate_hz), "--seconds", str(seconds)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sender:
        assert sender.stdin is not None
        assert sender.stdout is not None
        paths = sender.stdout.readline().split()
        family = get_family("line-protocol")
        chains = [(TimedChain if decode else CountingChain)(family, rate_hz) for _ in paths]
        running = design(paths, chains)
        taken = 0
        over = threading.Event()
        threading.Event().wait(SETTLE_S)
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
        while not over.wait(look_s):
            taken += sum(len(block) for _, block in running.blocks())
        took, used = time.monotonic() - began, time.process_time() - cpu
        ear.join()
        deadline = time.monotonic() + PATIENCE_S
        while sum(chain.received for chain in chains) < expected and time.monotonic() < deadline:
            threading.Event().wait(0.05)
            taken += sum(len(block) for _, block in running.blocks())
        running.stop()
        taken += sum(len(block) for _, block in running.blocks())
        sender.stdin.write("end\n")
    received = sum(chain.received for chain in chains)
    if decode and taken != received:
        raise AssertionError(f"{received} samples were parsed, and {taken} came in blocks")
    delays = np.concatenate([chain.delays_us(running.parsed(channel)) for channel, chain in enumerate(chains)])
    p50, p99 = np.percentile(delays, [50, 99]) if delays.size else (np.nan, np.nan)
    return Figures(received, expected, used / took, float(p50) / 1000, float(p99) / 1000)


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
    """Send, or compare."""
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
    return compare(given.ports, given.rate, given.seconds)


def compare(ports: int, rate_hz: float, seconds: float) -> int:
    """Print one port, every design on many, and the trade of the cadence; return 1 where this project lost samples."""

    def figures(name: str, design: Design, count: int = ports, rate: float = rate_hz, **how: Any) -> Figures:
        found = measure(design, ports=count, rate_hz=rate, seconds=seconds, **{"decode": True, **how})
        print(found.line(f"{count} x {rate:g} Hz {name}"), flush=True)
        return found

    ours = [figures("decoded, one thread", OneThread, 1, 100.0), figures("decoded, one thread", OneThread, 1, 1000.0)]
    for what, decode in (("decoded", True), ("read", False)):
        one = figures(f"{what}, one thread", OneThread, decode=decode)
        for name, design in THREADS.items():
            other = figures(f"{what}, {name}", design, decode=decode)
            print(f"  one thread over it: {one.cpu_share / other.cpu_share:.2f} x", flush=True)
        ours.append(one)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "run.wire"
        ours.append(figures("recorded and decoded", partial(OneThread, log=log)))
        one = figures("recorded, one thread", partial(OneThread, log=log), look_s=SELDOM_S)
        other = figures("recorded, lean threads", partial(LeanThreads, log=log), look_s=SELDOM_S)
        print(f"  one thread over lean threads: {one.cpu_share / other.cpu_share:.2f} x", flush=True)
        ours.append(one)
    references = {name: figures(f"decoded, {name}", design) for name, design in THREADS.items()}
    for cadence_ms in CADENCES_MS:
        one = figures(f"decoded, cadence {cadence_ms:g} ms", partial(OneThread, cadence_ns=round(cadence_ms * 1e6)))
        for name, reference in references.items():
            print(f"  over {name}: {one.cpu_share / reference.cpu_share:.2f} x", flush=True)
        ours.append(one)
    return int(any(one.received != one.expected for one in ours))


if __name__ == "__main__":
    sys.exit(main())
