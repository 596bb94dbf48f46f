"""Read ports on I/O threads that pass the bytes on unchanged.

One thread serves all ports that cannot block. Every read has the host time of the wake-up of its thread. The loss of a
port is reported with its time; the run continues, and the port is reopened when it comes back.
"""

from __future__ import annotations

import os
import selectors
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.clock import Clock
from acquisition.decoders.family import Poll
from acquisition.errors import PortError
from acquisition.live.line import Line, Proof, Sink
from acquisition.live.serial_port import READ_BYTES
from acquisition.readings import Read

__all__ = ["PortReader"]

REOPEN_EVERY_NS = 500_000_000
IDLE_WAIT_S = 0.5
BLOCKING_WAIT_S = 0.25
POLLED_WAIT_S = 0.01


class PortReader:
    """Reads all lines on one thread with ``selectors``, except that each line that may block gets its own thread.

    A line may block if it has no descriptor (Windows, RFC 2217), or if it has a network address, because reopening it
    may take seconds.

    Parameters
    ----------
    lines : sequence of Line
        Lines to read; their ports must be open.
    sink : Sink
    clock : Clock
        The clock of the host times; use the system clock, because real ports run in real time.
    """

    def __init__(self, lines: Sequence[Line], sink: Sink, clock: Clock) -> None:
        self._lines = list(lines)
        self._sink = sink
        self._clock = clock
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []
        self._failure: BaseException | None = None
        # The pipe only ends a wait and is never read, so it may be blocking; Windows can change this only since 3.12.
        self._wake_read, self._wake_write = os.pipe()

    def start(self) -> None:
        """Start the reading threads."""
        shared = [line for line in self._lines if not _may_block(line)]
        loops = [(self._select_loop, shared)] if shared else []
        for line in filter(_may_block, self._lines):
            loops.append((self._select_loop if line.transport.fileno() >= 0 else self._blocking_loop, [line]))
        for target, lines in loops:
            thread = threading.Thread(target=self._guarded, args=(target, lines), name="springmass-io", daemon=True)
            self._threads.append(thread)
            thread.start()

    def stop(self) -> None:
        """Stop reading, close the ports and raise the last error of a thread, if any; further calls do nothing."""
        if self._stop.is_set():
            return
        self._stop.set()
        os.write(self._wake_write, b"x")
        for thread in self._threads:
            thread.join()
        for line in self._lines:
            line.transport.close()
        os.close(self._wake_read)
        os.close(self._wake_write)
        if self._failure is not None:
            raise self._failure

    @property
    def failure(self) -> BaseException | None:
        """The last error of a reading thread, or None; it is a defect of the program or an error of the sink."""
        return self._failure

    def _guarded(self, loop: Any, lines: list[Line]) -> None:
        while not self._stop.is_set():
            try:
                loop(lines)
            except Exception as error:  # stop() raises the error in the caller's thread; reading continues
                self._failure = error
                for line in lines:
                    if not line._closed and line.transport.fileno() < 0 and loop == self._select_loop:
                        line._closed = True
                self._stop.wait(IDLE_WAIT_S)

    def _select_loop(self, lines: list[Line]) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_read, selectors.EVENT_READ)
            for line in lines:
                if not line._closed:
                    selector.register(line.transport.fileno(), selectors.EVENT_READ, line)
            while not self._stop.is_set():
                ready = [key.data for key, _ in selector.select(self._wait_s(lines)) if key.data is not None]
                for line in self._read(ready, self._clock.now_ns()):
                    _leave(selector, line)
                for line in lines:
                    if line._closed:
                        if self._retry(line):
                            selector.register(line.transport.fileno(), selectors.EVENT_READ, line)
                    elif line.poll is not None and not self._ask(line, line.poll):
                        _leave(selector, line)

    def _blocking_loop(self, lines: list[Line]) -> None:
        (line,) = lines
        while not self._stop.is_set():
            if line._closed:
                if not self._retry(line):
                    self._stop.wait(IDLE_WAIT_S)
                continue
            if line.poll is not None and not self._ask(line, line.poll):
                line.transport.close()
                continue
            # Wait only a short time for a reply, so that the next request is not late.
            wait_s = BLOCKING_WAIT_S if line.poll is None else POLLED_WAIT_S
            if not self._wait_for(line, wait_s):
                line.transport.close()

    def _wait_s(self, lines: list[Line]) -> float:
        """Return the time until the next reopening or request may be due, s, limited to IDLE_WAIT_S."""
        now = self._clock.now_ns()
        wait = IDLE_WAIT_S
        for line in lines:
            if line._closed:
                wait = min(wait, (line._retry_ns - now) * 1e-9)
            elif line.poll is not None:
                wait = min(wait, (line._ask_ns - now) * 1e-9)
        return max(wait, 0.0)

    def _read(self, ready: Sequence[Line], now_ns: int) -> list[Line]:
        """Read the ports that are ready and pass their bytes on; return the lines whose port was lost."""
        reads: list[Read] = []
        gone: list[tuple[Line, str]] = []
        for line in ready:
            try:
                data = os.read(line.transport.fileno(), READ_BYTES)
            except BlockingIOError:
                continue
            except OSError as error:
                gone.append((line, str(error)))
                continue
            if not data:
                gone.append((line, "end of file"))
            elif line._proving is None:
                reads.append((line.channel, now_ns, data))
            elif (proven := self._prove(line, line._proving, now_ns, data)) is None:
                gone.append((line, ""))
            else:
                reads += proven
            line._answer_by_ns = None
        if reads:
            self._sink.reads(reads)
        for line, why in gone:
            self._gone(line, f"{line.transport.name}: the port was disconnected ({why})")
        return [line for line, _ in gone]

    def _prove(self, line: Line, proof: Proof, now_ns: int, data: bytes) -> list[Read] | None:
        """Return all reads of a reopened port once its sensor is confirmed, before that []; None for another device."""
        verdict = proof.feed(now_ns, data)
        line._unproven.append((line.channel, now_ns, data))
        if verdict is None:
            return []
        if not verdict:
            size = sum(len(unproven) for _, _, unproven in line._unproven)
            facts = {"port": line.transport.name, "why": "another device answered on the port", "bytes": size}
            self._sink.event(line.channel, now_ns, "refused", facts)
            return None
        self._came_back(line, now_ns, proof.facts)
        proven, line._unproven, line._proving = line._unproven, [], None
        return proven

    def _wait_for(self, line: Line, wait_s: float) -> bool:
        """Pass on the bytes that arrive within ``wait_s``; return False if the port was lost."""
        try:
            data = line.transport.read(wait_s)
        except PortError as error:
            self._gone(line, str(error))
            return False
        if data:
            line._answer_by_ns = None
            now = self._clock.now_ns()
            reads: list[Read] | None = [(line.channel, now, data)]
            if line._proving is not None and (reads := self._prove(line, line._proving, now, data)) is None:
                self._gone(line, "")
                return False
            if reads:
                self._sink.reads(reads)
        return True

    def _ask(self, line: Line, poll: Poll) -> bool:
        """If a request is due, discard a late reply and send the request; return False if the port was lost."""
        now = self._clock.now_ns()
        if now < line._ask_ns:
            return True
        try:
            decoder = None if line.decoder is None else line.decoder()
            short = decoder is not None and line._answer_by_ns is None and decoder.pending > 0
            if short or (line._answer_by_ns is not None and now >= line._answer_by_ns):
                # Without a header and a checksum, the end of a late reply would be read as the next reply.
                line.transport.discard_input()
                self._sink.event(line.channel, now, "timeout", {"after_s": poll.timeout_s})
                line._answer_by_ns = None
            if line._answer_by_ns is None:
                line.transport.write(poll.request if decoder is None else decoder.request)
                line._answer_by_ns = now + int(poll.timeout_s * 1e9)
        except PortError as error:
            self._gone(line, str(error))
            return False
        step = int(poll.interval_s * 1e9)
        # The schedule is absolute, so a late wake-up does not delay subsequent requests.
        line._ask_ns = max(line._ask_ns + step, now) if line._ask_ns else now + step
        return True

    def _gone(self, line: Line, why: str) -> None:
        now = self._clock.now_ns()
        line._closed, line._retry_ns = True, now + REOPEN_EVERY_NS
        line._answer_by_ns = line._proving = None
        line._unproven = []
        if line._lost_ns is None:  # a port that came back with another device is still lost
            line._lost_ns = now
            self._sink.event(line.channel, now, "lost", {"port": line.transport.name, "why": why})

    def _retry(self, line: Line) -> bool:
        now = self._clock.now_ns()
        if now < line._retry_ns:
            return False
        try:
            line.transport.reopen()
            if line.greeting:
                line.transport.write(line.greeting)
        except PortError:
            line.transport.close()
            line._retry_ns = now + REOPEN_EVERY_NS
            return False
        line._closed, line._ask_ns = False, 0
        line._proving = None if line.proof is None else line.proof()
        if line._proving is None:
            self._came_back(line, now, {})
        return True

    def _came_back(self, line: Line, now_ns: int, more: Mapping[str, Any]) -> None:
        """Report that the sensor is available again."""
        gap_s = 0.0 if line._lost_ns is None else (now_ns - line._lost_ns) * 1e-9
        line._lost_ns = None
        facts = {"port": line.transport.name, "gap_s": gap_s, **more}
        self._sink.event(line.channel, now_ns, "reopened", facts)


def _may_block(line: Line) -> bool:
    return line.transport.fileno() < 0 or "://" in line.transport.name


def _leave(selector: selectors.BaseSelector, line: Line) -> None:
    """Stop waiting on a lost port, and close it."""
    selector.unregister(line.transport.fileno())
    line.transport.close()
