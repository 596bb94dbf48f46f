"""The reading thread: what it hands on, and what may not hold it up."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from acquisition.clock import VirtualClock
from acquisition.errors import PortError
from acquisition.live.line import Line
from acquisition.live.reader import PortReader
from acquisition.readings import Read

WAIT_S = 60.0


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


class Heard:
    """A sink that notes what was handed on, each wake-up's reads together, and what happened."""

    def __init__(self) -> None:
        self.reads_of: list[list[int]] = []
        self.events: list[str] = []
        self.came = threading.Event()

    def reads(self, reads: Sequence[Read]) -> None:
        """Note what was read."""
        self.reads_of.append(sorted(channel for channel, _, _ in reads))
        self.came.set()

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Note an event."""
        self.events.append(f"{kind} {channel}")


def test_what_came_on_all_ports_is_handed_on_together() -> None:
    """Five ports that have something at one wake-up are read, each once, before any of it is handed on."""
    pipes, sink = [Pipe() for _ in range(5)], Heard()
    for pipe in pipes:
        os.write(pipe.end, b"x")
    reader = PortReader([Line(pipe, i) for i, pipe in enumerate(pipes)], sink, VirtualClock())
    reader.start()
    assert sink.came.wait(WAIT_S)
    reader.stop()
    assert sink.reads_of == [[0, 1, 2, 3, 4]]
    assert sink.events == []


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


def test_a_network_port_that_is_slow_to_open_holds_up_no_other() -> None:
    """While one address is being opened again, the ports on cables are read."""
    cable, remote, sink = Pipe(), Remote(), Heard()
    clock = VirtualClock()
    reader = PortReader([Line(cable, 0), Line(remote, 1)], sink, clock)
    reader.start()
    remote.hang_up()
    while not remote.opening.wait(0.01):
        clock.sleep_until_ns(clock.now_ns() + 500_000_000)
    os.write(cable.end, b"y")
    assert sink.came.wait(WAIT_S)
    assert sink.events == ["lost 1"]
    assert sink.reads_of == [[0]]
    remote.answer.set()
    reader.stop()
    os.close(remote.fileno())


class Odd(Pipe):
    """A transport that raises an unexpected error at the first reopening, and then opens."""

    def __init__(self) -> None:
        super().__init__()
        self.tries = 0

    def reopen(self) -> None:
        """Trip once."""
        if self.tries == 0:
            self.tries = 1
            raise RuntimeError("a defect")
        self._read, self.end = os.pipe()
        self.tries = 2


def test_a_defect_on_the_reading_thread_is_heard_of_and_the_reading_goes_on() -> None:
    """The port that tripped is tried again, another is read meanwhile, and stop raises what it was."""
    second, odd, sink, clock = Pipe(), Odd(), Heard(), VirtualClock()
    reader = PortReader([Line(second, 0), Line(odd, 1)], sink, clock)
    reader.start()
    end, odd.end = odd.end, os.open(os.devnull, os.O_WRONLY)  # for the transport to close
    os.close(end)
    while odd.tries < 2:
        clock.sleep_until_ns(clock.now_ns() + 500_000_000)
        threading.Event().wait(0.01)
    os.write(odd.end, b"x")
    os.write(second.end, b"x")
    heard: set[int] = set()
    while heard < {0, 1}:
        assert sink.came.wait(WAIT_S)
        sink.came.clear()
        heard = {channel for channels in sink.reads_of for channel in channels}
    assert sink.events == ["lost 1", "reopened 1"]
    with pytest.raises(RuntimeError, match="a defect"):
        reader.stop()


class WithoutDescriptor(Pipe):
    """A transport as Windows has it: read in small waits, with no descriptor to wait on."""

    def fileno(self) -> int:
        """Have none."""
        return -1

    def read(self, wait_s: float) -> bytes:
        """Return a byte at every call."""
        return b"x"


def test_a_system_that_cannot_make_a_pipe_non_blocking_reads_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows has no ``os.set_blocking`` before Python 3.12; its ports have no descriptor."""
    monkeypatch.delattr(os, "set_blocking")
    sink = Heard()
    reader = PortReader([Line(WithoutDescriptor(), 0)], sink, VirtualClock())
    reader.start()
    assert sink.came.wait(WAIT_S)
    reader.stop()
    assert sink.reads_of[0] == [0]
