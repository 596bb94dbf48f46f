"""Take records from the reading thread and write them to the disk.

Three threads share the work. The reading thread only puts the records of all sensors into a queue. The second thread
takes them from the queue and immediately appends them to the wire log, so that a killed process loses at most the last
read. The third calls fdatasync once a second. A sync may take long, but neither of the other threads waits for it.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from acquisition.clock import Clock
from acquisition.readings import Read
from storage.errors import WriteFailed, one_line
from storage.wire_log.appending import Item, LogFile, WireLogWriter, open_log_file
from storage.wire_log.held_log import HeldLog
from storage.wire_log.records import HEAD_BYTES, HIGHEST_CHANNEL, Kind, LogHeader, event_payload
from storage.wire_log.scanning import LogContents, read_log

__all__ = ["Recorder", "RecorderStatus"]

QUEUE_BYTES = 16 << 20
"""Size of the queue, bytes: half an hour of one sensor at 100 Hz, or two minutes of 16 sensors."""

MAX_NOTES = 10_000
"""Maximum number of marks and events kept while the queue is full; nobody makes this many while a disk hangs."""
GIVE_UP_S = 1.0
"""Maximum time that :meth:`Recorder.give_up` waits for the disk, s; a user who gives up does not want to wait."""


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """The state of a recording. Counts of records include marks, events and the header.

    Parameters
    ----------
    records, bytes : int
        Amount written to the log. It survives a killed process.
    synced_records, synced_bytes : int
        Amount synced to the disk. It survives a power cut: records with numbers below ``synced_records`` are safe.
    queued_records, queued_bytes : int
        Amount that waits in the queue.
    dropped_records, dropped_bytes : int
        Amount received but not recorded, because the queue was full or the recording had stopped.
    error : str
        The error that stopped the recording, one line; empty if there is none.
    closed : bool
    astray : str
        Says that the log was deleted, renamed or replaced during the recording; empty if its path still leads to it.
    """

    records: int
    bytes: int
    synced_records: int
    synced_bytes: int
    queued_records: int
    queued_bytes: int
    dropped_records: int
    dropped_bytes: int
    error: str
    closed: bool
    astray: str = ""


@dataclass(slots=True)
class _Overflow:
    """The reads that one channel has lost since the queue became full."""

    first_ns: int
    last_ns: int
    records: int = 0
    bytes: int = 0

    def add(self, mono_ns: int, size: int) -> None:
        self.last_ns = mono_ns
        self.records += 1
        self.bytes += size

    def event(self, channel: int) -> Item:
        facts = {"records": self.records, "bytes": self.bytes, "first_ns": self.first_ns}
        return Kind.EVENT, channel, self.last_ns, event_payload("overflow", facts)


class Recorder:
    """Records to a new wire log. It implements :class:`acquisition.live.line.Sink`.

    Parameters
    ----------
    path : str or PathLike
        The log to create; its folder must exist.
    header : LogHeader
    clock : Clock
        Schedules the syncs, and supplies the time of marks and events that come without one.
    sync_every_s : float
        Time between syncs, s.
    queue_bytes : int
        Size of the queue, bytes. Reads that arrive while it is full are dropped, and an event in the log counts them.
    open_file : callable
        Creates the log's file; tests replace it.

    Attributes
    ----------
    path : Path
        The path under which the log was created.

    Raises
    ------
    RunExists, WriteFailed
        If the log cannot be started.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        header: LogHeader,
        clock: Clock,
        *,
        sync_every_s: float = 1.0,
        queue_bytes: int = QUEUE_BYTES,
        open_file: Callable[[Path], LogFile] = open_log_file,
    ) -> None:
        self._log = WireLogWriter(path, header, open_file=open_file)
        self.path = self._log.path
        self._held: HeldLog | None = None
        if os.name != "nt":
            with contextlib.suppress(OSError):  # the recording goes on, and the log is read by its name
                self._held = HeldLog(self.path)
        self._astray = ""
        self._clock = clock
        self._sync_every_ns = int(sync_every_s * 1e9)
        self._limit = queue_bytes
        self._lock = threading.Lock()
        self._done = threading.Condition(self._lock)
        self._queue: list[Item] = []
        # Receives an item whenever the empty queue is filled. A Condition is written in Python and costs twice as much.
        self._wakeup: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._queued_bytes = 0
        self._appending = False
        self._taken: list[Item] = []
        self._gave_up = False
        self._overflows: dict[int, _Overflow] = {}
        self._notes: list[Item] = []  # marks and events since the queue became full
        self._dropped_records = self._dropped_bytes = 0
        self._error: WriteFailed | None = None
        self._closing = self._closed = False
        self._stop_sync = threading.Event()
        self._appender = threading.Thread(target=self._append_all, name="springmass-log", daemon=True)
        self._syncer = threading.Thread(target=self._sync_often, name="springmass-sync", daemon=True)
        try:
            self._syncer.start()
            self._appender.start()
        except RuntimeError as error:
            self._stop_sync.set()
            self._log.close()
            self.path.unlink()
            raise MemoryError("no memory for the threads that write the log") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def status(self) -> RecorderStatus:
        """The state of the recording; any thread may read it."""
        with self._lock:
            written, synced = self._log.written, self._log.synced
            log = (written.records, written.bytes, synced.records, synced.bytes)
            queue = (len(self._queue), self._queued_bytes, self._dropped_records, self._dropped_bytes)
            return RecorderStatus(*log, *queue, str(self._error or ""), self._closed, self._astray)

    def reads(self, reads: Sequence[Read]) -> None:
        """Record reads of ports. This never waits for the disk and never raises a disk error."""
        self._offer(Kind.DATA, reads)

    def put(self, channel: int, host_ns: int, data: bytes) -> None:
        """Record the bytes of one read of a port."""
        self.reads(((channel, host_ns, data),))

    def mark(self, text: str, *, host_ns: int | None = None, channel: int = 0) -> None:
        """Record a mark."""
        now = self._clock.now_ns() if host_ns is None else host_ns
        self._offer(Kind.MARK, ((channel, now, text.encode("utf-8", "replace")),))

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Record "lost", "reopened", "timeout", "trigger", "calibration" or another event, with facts about it."""
        self._offer(Kind.EVENT, ((channel, host_ns, event_payload(kind, facts)),))

    def drain(self, *, sync: bool = False) -> RecorderStatus:
        """Wait until everything received so far is in the log (with ``sync``: on the disk) or the recording stops."""
        with self._done:
            self._done.wait_for(lambda: self._error or not (self._waiting or self._appending))
        if sync:
            self._sync()
        return self.status

    def close(self) -> None:
        """Write the queue and the end record, sync and close. Further calls do nothing.

        Raises
        ------
        WriteFailed
            If any write has failed since the start. Everything written before that is kept.
        """
        with self._lock:
            if self._closing:
                return
            self._closing = True
            self._wakeup.put(None)
        self._appender.join()
        self._stop_sync.set()
        self._syncer.join()
        if self._error is None:
            self._guarded(self._append_end)
        self._sync()
        self._guarded(self._log.close)
        self._look_for_name()
        with self._lock:
            self._closed = True
        if self._error is not None:
            raise self._error

    def contents(self) -> LogContents:
        """Return the recorded log, even if it was renamed or deleted. Call this after :meth:`close`.

        Raises
        ------
        NotALog
            If the log cannot be read.
        """
        return read_log(self.path) if self._held is None else self._held.contents()

    def give_up(self) -> bool:
        """End immediately: count the reads that are not in the log, and write the counts even if another write hangs.

        Queued marks and events are written with the counts. Use this when the user no longer waits for :meth:`close`.

        Returns
        -------
        bool
            Whether the counts were written within a second.
        """
        with self._lock:
            self._closing = self._gave_up = True
            self._wakeup.put(None)
            pending = self._taken[self._log.stop() :] + self._queue
            self._queue, self._queued_bytes = [], 0
            lost: dict[int, _Overflow] = {}
            for _, channel, mono_ns, payload in [item for item in pending if item[0] is Kind.DATA]:
                lost.setdefault(channel, _Overflow(mono_ns, mono_ns)).add(mono_ns, len(payload))
            self._dropped_records += sum(each.records for each in lost.values())
            self._dropped_bytes += sum(each.bytes for each in lost.values())
            # Overflowed records are newer than the queued ones and have already been counted.
            items = [item for item in pending if item[0] is not Kind.DATA]
            items += [each.event(channel) for channel, each in (*lost.items(), *self._overflows.items())]
            items += self._notes
            self._overflows, self._notes = {}, []
            items.append((Kind.END, 0, self._clock.now_ns(), self._end_payload()))
        self._stop_sync.set()
        written = threading.Event()

        def write() -> None:
            with contextlib.suppress(OSError):  # the return value reports it
                self._look_for_name()
                if not self._astray:
                    self._log.append_beside(items)
                    written.set()

        # In a separate thread, because the disk may hang here too.
        threading.Thread(target=write, name="springmass-counts", daemon=True).start()
        return written.wait(GIVE_UP_S)

    def _offer(self, kind: Kind, records: Sequence[Read]) -> None:
        for channel, _, _ in records:
            if not 0 <= channel <= HIGHEST_CHANNEL:
                raise ValueError(f"a channel must lie in 0 to {HIGHEST_CHANNEL}, got {channel}")
        with self._lock:
            accepting = self._error is None and not self._closing
            was_waiting = self._waiting
            for channel, mono_ns, payload in records:
                size = HEAD_BYTES + len(payload)
                # After an overflow, queue its event first, so that the records around the loss do not look consecutive.
                if accepting and not (self._overflows or self._notes) and self._queued_bytes + size <= self._limit:
                    self._queue.append((kind, channel, mono_ns, payload))
                    self._queued_bytes += size
                    continue
                # Events of ports and sensors are never dropped: later readings cannot be decoded without them.
                if accepting and kind is not Kind.DATA and len(self._notes) < MAX_NOTES:
                    self._notes.append((kind, channel, mono_ns, payload))
                    continue
                self._dropped_records += 1
                self._dropped_bytes += len(payload)
                if accepting:
                    self._overflows.setdefault(channel, _Overflow(mono_ns, mono_ns)).add(mono_ns, len(payload))
            if not was_waiting and self._waiting:
                self._wakeup.put(None)

    @property
    def _waiting(self) -> bool:
        return bool(self._queue or self._overflows or self._notes)

    def _append_all(self) -> None:
        while items := self._take_queued():
            try:
                self._log.extend(items)
            except Exception as error:  # a defect must also stop the recording and not go unnoticed
                if self._gave_up:  # give_up has counted the rest
                    return
                self._stop(self._one_line(error), items[self._log.extended :])
                return

    def _take_queued(self) -> list[Item]:
        """Wait for records and return all of them; return an empty list if the recording is closing and none are left.

        Overflow events follow the queued records and precede all later ones, because the lost reads belong there.
        """
        while True:
            with self._lock:
                items, self._queue, self._queued_bytes = self._queue, [], 0
                items += [lost.event(channel) for channel, lost in self._overflows.items()] + self._notes
                self._overflows.clear()
                self._notes = []
                self._appending = bool(items)
                self._taken, self._log.extended = items, 0
                if not items:
                    self._done.notify_all()
                if items or self._closing:
                    return items
            self._wakeup.get()

    def _one_line(self, error: Exception) -> WriteFailed:
        if isinstance(error, WriteFailed):
            return error
        return WriteFailed(self.path, f"a record could not be appended ({one_line(error)})", "report this defect")

    def _stop(self, error: WriteFailed, pending: list[Item]) -> None:
        """Stop recording; records that were already appended can still be synced."""
        with self._lock:
            self._error = self._error or error
            pending += self._queue
            self._queue, self._taken = [], []  # counted here, so give_up must not count them again
            self._queued_bytes = 0
            self._dropped_records += len(pending)
            self._dropped_bytes += sum(len(payload) for *_, payload in pending)
            self._done.notify_all()
        self._sync()

    def _sync_often(self) -> None:
        due = self._clock.now_ns() + self._sync_every_ns
        # Wait for the event and not for the clock, so that closing does not wait for the next sync.
        while not self._stop_sync.wait(max(0, due - self._clock.now_ns()) * 1e-9):
            due = max(due, self._clock.now_ns()) + self._sync_every_ns
            if self._look_for_name():
                self.event(0, self._clock.now_ns(), "astray", {"what": self._astray})
            if self._log.synced != self._log.written:
                self._sync()

    def _look_for_name(self) -> bool:
        """Check whether the log was deleted, renamed or replaced; return whether this call is the first to detect it.

        The check may wait for the disk, so the reading thread never calls it.
        """
        if self._held is None or self._astray:
            return False
        self._astray = self._held.astray()
        return bool(self._astray)

    def _sync(self) -> None:
        self._guarded(self._log.sync)

    def _append_end(self) -> None:
        self._log.append(Kind.END, self._end_payload(), mono_ns=self._clock.now_ns())

    def _end_payload(self) -> bytes:
        counts = {"records": self._log.written.records, "dropped_records": self._dropped_records}
        return json.dumps(counts | {"dropped_bytes": self._dropped_bytes}).encode("ascii")

    def _guarded(self, step: Callable[[], object]) -> None:
        """Run a step and keep the first error, which :meth:`close` raises."""
        try:
            step()
        except WriteFailed as error:
            with self._lock:
                self._error = self._error or error
                self._done.notify_all()
