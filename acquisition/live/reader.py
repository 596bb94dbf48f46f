"""Read ports on one thread each, pass the bytes on unchanged, and reopen a lost port once it has returned.

Every read has the host time at which it returned. The loss of a port is reported with its time, and the port is opened
again when it comes back.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from acquisition.clock import Clock
from acquisition.decoders.sensor import Poll
from acquisition.errors import PortError
from acquisition.events import Event, Lost, Reopened, Shared, TimedOut
from acquisition.live.serial_port import SerialPort
from acquisition.readings import Read

REOPEN_EVERY_S = 0.5
WAIT_S = 0.25
SHARED_EVERY_NS = 10_000_000_000
"""Minimum time between two reports that another program reads a port, ns."""
POLLED_WAIT_S = 0.01
"""Maximum wait for bytes of a polled sensor, s, so that the next request is not late."""


class Sink(Protocol):
    """The receiver of the bytes; it is called on the threads of all ports, so it must not block."""

    def reads(self, reads: Sequence[Read]) -> None:
        """Receive reads of one port."""

    def event(self, channel: int, host_ns: int, event: Event) -> None:
        """Receive an event: a port is lost or came back, or a polled sensor did not answer."""


@dataclass(frozen=True, slots=True)
class PortLine:
    """A port, the number of its sensor within the run, how to poll it, and what makes it identify itself."""

    port: SerialPort
    channel: int = 0
    poll: Poll | None = None
    greeting: bytes = b""


class PortReader:
    """Reads open ports until it is stopped; the clock is the system clock, because real ports run in real time.

    ``failure`` is the last error of a thread, or None; it is a defect of the program or an error of the sink, and
    reading continues after it.
    """

    def __init__(self, lines: Sequence[PortLine], sink: Sink, clock: Clock) -> None:
        self._lines = list(lines)
        self._sink = sink
        self._clock = clock
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []
        self.failure: BaseException | None = None

    def start(self) -> None:
        """Start the reading threads."""
        for line in self._lines:
            thread = threading.Thread(target=self._guarded, args=(line,), name="springmass-io", daemon=True)
            thread.start()
            self._threads.append(thread)

    def stop(self) -> None:
        """Stop reading, close the ports and raise the last error of a thread, if any; further calls do nothing."""
        if self._stop.is_set():
            return
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for line in self._lines:
            line.port.close()
        if self.failure is not None:
            raise self.failure

    def _guarded(self, line: PortLine) -> None:
        while not self._stop.is_set():
            try:
                self._serve(line)
            except Exception as error:  # stop() raises the error in the caller's thread; reading continues
                self.failure = error
                self._stop.wait(REOPEN_EVERY_S)

    def _serve(self, line: PortLine) -> None:
        """Read a port until the end, over all of its losses."""
        while (why := self._read_until_lost(line)) is not None:
            lost_ns = self._clock.now_ns()
            self._sink.event(line.channel, lost_ns, Lost(port=line.port.name, why=why))
            sensor = None
            while sensor is None:
                if self._stop.wait(REOPEN_EVERY_S):
                    return
                sensor = self._reopened(line)
            now_ns = self._clock.now_ns()
            gap_s = (now_ns - lost_ns) * 1e-9
            self._sink.event(line.channel, now_ns, Reopened(port=line.port.name, gap_s=gap_s, sensor=sensor))

    def _read_until_lost(self, line: PortLine) -> str | None:
        """Pass on what a port sends until it is lost; return the reason, or None at the end."""
        asker = None if line.poll is None else _Asker(line, line.poll)
        wait_s, shared_ns = WAIT_S if asker is None else POLLED_WAIT_S, -SHARED_EVERY_NS
        while not self._stop.is_set():
            try:
                if asker is not None and asker.ask(now_ns := self._clock.now_ns()):
                    self._sink.event(line.channel, now_ns, TimedOut(after_s=asker.poll.timeout_s))
                data = line.port.read(wait_s)
            except PortError as error:
                return str(error)
            if line.port.shared and (now_ns := self._clock.now_ns()) - shared_ns >= SHARED_EVERY_NS:
                shared_ns, line.port.shared = now_ns, False
                self._sink.event(line.channel, now_ns, Shared(port=line.port.name))
            if data:
                now_ns = self._clock.now_ns()
                if asker is not None:
                    asker.received += len(data)
                self._sink.reads([(line.channel, now_ns, data)])
        return None

    def _reopened(self, line: PortLine) -> str | None:
        """Try to open a lost port; return which sensor is on it, or None if the port is still unavailable."""
        try:
            sensor = line.port.reopen()
            if line.greeting:
                line.port.write(line.greeting)
        except PortError:
            line.port.close()
            return None
        return sensor


class _Asker:
    """Sends the requests to a polled sensor on an absolute schedule, so that a late wake-up does not delay them all."""

    def __init__(self, line: PortLine, poll: Poll) -> None:
        self._port, self.poll = line.port, poll
        self._ask_ns = self._answer_by_ns = 0
        self.received = poll.reply_bytes  # number of bytes since the last request; before the first, nothing is missing

    def ask(self, now_ns: int) -> bool:
        """Send a request if one is due; return whether the last reply had not come, or only a part of it."""
        if now_ns < self._ask_ns or (not self.received and now_ns < self._answer_by_ns):
            return False
        missed = not self.received or self.received % self.poll.reply_bytes != 0
        if missed:
            # Without a header and a checksum, the end of a late reply would be read as the next reply.
            self._port.discard_input()
        self._port.write(self.poll.request)
        self.received = 0
        self._answer_by_ns = now_ns + int(self.poll.timeout_s * 1e9)
        step_ns = int(self.poll.interval_s * 1e9)
        self._ask_ns = max(self._ask_ns + step_ns, now_ns) if self._ask_ns else now_ns + step_ns
        return missed
