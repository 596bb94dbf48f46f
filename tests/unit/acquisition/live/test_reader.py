"""The reading thread: how often it looks, and when it decodes."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from acquisition.clock import VirtualClock
from acquisition.errors import PortError
from acquisition.live.reader import CADENCE_NS, Line, PortReader
from acquisition.readings import Read

WAIT_S = 10.0


class Pipe:
    """A transport over a pipe."""

    name = "pipe"

    def __init__(self) -> None:
        self._read, self.end = os.pipe()

    def fileno(self) -> int:
        """Return the end to wait on."""
        return self._read

    def read(self, wait_s: float) -> bytes:
        """Refuse: what has a descriptor is read through it."""
        raise AssertionError(wait_s)

    def write(self, data: bytes) -> None:
        """Refuse: nothing is asked here."""
        raise AssertionError(data)

    def discard_input(self) -> None:
        """Hold nothing."""

    def reopen(self) -> None:
        """Be open."""

    def close(self) -> None:
        """Close both ends."""
        os.close(self._read)
        os.close(self.end)


class Order:
    """A sink and its decoding, that notes what was called in which order."""

    def __init__(self, pieces: int = 1) -> None:
        self.calls: list[str] = []
        self.decoded = threading.Event()
        self._pieces = pieces
        self._left = 0

    def reads(self, reads: Sequence[Read]) -> None:
        """Note what was read."""
        self.calls += [f"read {channel}" for channel, _, _ in reads]
        self._left = self._pieces

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Refuse: nothing is lost here."""
        raise AssertionError(kind)

    def decode(self) -> bool:
        """Note a piece of decoding."""
        if self._left:
            self._left -= 1
            self.calls.append("decode")
            if not self._left:
                self.decoded.set()
        return self._left > 0


@contextmanager
def reading(ports: int, sink: Order) -> Iterator[tuple[list[Pipe], VirtualClock]]:
    """Read pipes, into each of which something was written before."""
    pipes, clock = [Pipe() for _ in range(ports)], VirtualClock(1_000_000_000)
    for pipe in pipes:
        os.write(pipe.end, b"x")
    reader = PortReader([Line(pipe, i) for i, pipe in enumerate(pipes)], sink, clock, decode=sink.decode)
    reader.start()
    try:
        assert sink.decoded.wait(WAIT_S)
        yield pipes, clock
    finally:
        reader.stop()


def test_every_port_is_read_before_anything_is_decoded() -> None:
    """What came on all ports is handed on first; then decoding goes on piece by piece until none is left."""
    sink = Order(pieces=3)
    with reading(5, sink):
        assert sorted(sink.calls[:5]) == [f"read {i}" for i in range(5)]
        assert sink.calls[5:] == ["decode"] * 3


@pytest.mark.parametrize("ports", [1, 2])
def test_only_several_busy_ports_are_looked_at_in_turns(ports: int) -> None:
    """A port alone is read as soon as it speaks; of several, one wake-up soon after another is put off."""
    sink = Order()
    with reading(ports, sink) as (pipes, clock):
        for _ in range(3):  # the clock stands still but for rests: the next wake-up comes at once
            sink.decoded.clear()
            os.write(pipes[0].end, b"x")
            assert sink.decoded.wait(WAIT_S)
        rested_ns = clock.now_ns() - 1_000_000_000
    assert rested_ns == 0 if ports == 1 else rested_ns >= CADENCE_NS


class Remote(Pipe):
    """A transport at a network address, whose other side takes its time to answer again once it hung up."""

    name = "socket://bench:4000"

    def __init__(self) -> None:
        super().__init__()
        self.opening = threading.Event()
        self.answer = threading.Event()

    def reopen(self) -> None:
        """Wait for the other side."""
        self.opening.set()
        self.answer.wait(WAIT_S)
        raise PortError("socket://bench:4000: cannot be opened")

    def hang_up(self) -> None:
        """Be gone."""
        os.close(self.end)

    def close(self) -> None:
        """Keep the end that is read, which the test closes."""


class Lossy(Order):
    """A sink that expects losses."""

    def __init__(self) -> None:
        super().__init__()
        self.came = threading.Event()

    def reads(self, reads: Sequence[Read]) -> None:
        """Note what was read."""
        super().reads(reads)
        self.came.set()

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Note an event."""
        self.calls.append(f"{kind} {channel}")


def test_a_network_port_that_is_slow_to_open_holds_up_no_other() -> None:
    """While one address is being opened again, the ports on cables are read."""
    cable, remote, sink = Pipe(), Remote(), Lossy()
    clock = VirtualClock()
    reader = PortReader([Line(cable, 0), Line(remote, 1)], sink, clock)
    reader.start()
    remote.hang_up()
    while not remote.opening.wait(0.01):
        clock.sleep_until_ns(clock.now_ns() + 500_000_000)
    os.write(cable.end, b"y")
    assert sink.came.wait(WAIT_S)
    assert sink.calls[0] == "lost 1"
    assert "read 0" in sink.calls
    remote.answer.set()
    reader.stop()
    os.close(remote.fileno())
