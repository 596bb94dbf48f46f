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
import shutil
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from acquisition.clock import Clock
from acquisition.events import Dropped, Event, StoredEvent
from acquisition.readings import Read
from storage.errors import DiskNearlyFull, NotALog, WriteFailed, one_line
from storage.wire_log.appending import LogFile, LogItem, WireLogWriter, open_log_file
from storage.wire_log.records import (
    HIGHEST_CHANNEL,
    MAX_PAYLOAD,
    RECORD_HEAD_BYTES,
    LogHeader,
    RecordKind,
    event_payload,
)
from storage.wire_log.scanning import LogContents, read_log

QUEUE_BYTES = 16 << 20
"""Size of the queue, bytes: half an hour of one sensor at 100 Hz, or two minutes of 16 sensors."""


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """The state of a recording. Counts of records include marks, events and the header.

    What is written to the log survives a killed process, what is synced survives a power cut. What is dropped was
    received but not recorded, because the queue was full or the recording had stopped. ``error`` is the one line about
    what stopped the recording; it is empty if nothing did.
    """

    records: int
    bytes: int
    synced_records: int
    synced_bytes: int
    queued_bytes: int
    dropped_records: int
    dropped_bytes: int
    error: str


class Recorder:
    """Records to a new wire log. It implements :class:`acquisition.live.reader.Sink`.

    The log is synced every ``sync_every_s``. Reads that arrive while the queue is full are dropped, and an event in the
    log counts them. Tests replace ``open_file``, which creates the log's file. Raises RunExists or WriteFailed if the
    log cannot be started.
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
        self._contents: LogContents | None = None
        with contextlib.suppress(NotALog):
            # Opened now, because the log may be renamed or deleted before it is read.
            self._contents = read_log(self.path)
        self._clock = clock
        self._sync_every_ns = int(sync_every_s * 1e9)
        self._limit = queue_bytes
        self._lock = threading.Lock()
        self._done = threading.Condition(self._lock)
        self._queue: list[LogItem] = []
        # Receives an item whenever the empty queue is filled. A Condition is written in Python and costs twice as much.
        self._wakeup: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._queued_bytes = 0
        self._taken: list[LogItem] = []  # what the disk has not answered yet
        # The reads that each channel has lost since the queue became full: time of the last one, and the event's facts.
        self._overflows: dict[int, tuple[int, dict[str, int]]] = {}
        self._dropped_records = self._dropped_bytes = 0
        self._error: WriteFailed | None = None
        self._closing = False
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
            pending = self._queued_bytes, self._dropped_records, self._dropped_bytes
            return RecorderStatus(*self._log.written, *self._log.synced, *pending, str(self._error or ""))

    def unwritten(self) -> tuple[int, int]:
        """Return the number of reads that the disk has not taken, and their bytes: they still wait, or were dropped."""
        with self._lock:
            waiting = [len(item[3]) for item in (*self._taken, *self._queue) if item[0] is RecordKind.DATA]
            return self._dropped_records + len(waiting), self._dropped_bytes + sum(waiting)

    def reads(self, reads: Sequence[Read]) -> None:
        """Record reads of ports. This never waits for the disk and never raises a disk error."""
        self._offer(RecordKind.DATA, reads)

    def mark(self, text: str, *, host_ns: int | None = None) -> None:
        """Record a mark."""
        now = self._clock.now_ns() if host_ns is None else host_ns
        self._offer(RecordKind.MARK, ((0, now, text.encode("utf-8", "replace")),))

    def event(self, channel: int, host_ns: int, event: StoredEvent | Event) -> None:
        """Record an event."""
        self._offer(RecordKind.EVENT, ((channel, host_ns, event_payload(event)),))

    def drain(self, *, sync: bool = False) -> RecorderStatus:
        """Wait until everything received so far is in the log (with ``sync``: on the disk) or the recording stops."""
        with self._done:
            self._done.wait_for(lambda: self._error or not (self._queue or self._overflows or self._taken))
        if sync:
            self._guarded(self._log.sync)
        return self.status

    def close(self) -> None:
        """Write the queue and the end record, sync and close. Further calls do nothing.

        Raises WriteFailed if any write has failed since the start. Everything written before that is kept.
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
        self._guarded(self._log.sync)
        self._guarded(self._log.close)
        if self._error is not None:
            raise self._error

    def contents(self) -> LogContents:
        """Return the recorded log, even if it was renamed or deleted. Call this after :meth:`close`."""
        contents = self._contents or read_log(self.path)
        contents.grow()
        return contents

    def _offer(self, kind: RecordKind, records: Sequence[Read]) -> None:
        for channel, _, _ in records:
            if not 0 <= channel <= HIGHEST_CHANNEL:
                raise ValueError(f"a channel must lie in 0 to {HIGHEST_CHANNEL}, got {channel}")
        with self._lock:
            accepting = self._error is None and not self._closing
            was_waiting = bool(self._queue or self._overflows)
            for channel, mono_ns, payload in _in_records(records):
                size = RECORD_HEAD_BYTES + len(payload)
                # After an overflow, its event comes first, so that the reads around the loss do not look consecutive.
                # Marks and events are never dropped: later readings cannot be decoded without those of ports.
                room = kind is not RecordKind.DATA or not (self._overflows or self._queued_bytes + size > self._limit)
                if accepting and room:
                    self._queue.append((kind, channel, mono_ns, payload))
                    self._queued_bytes += size
                    continue
                self._dropped_records += 1
                self._dropped_bytes += len(payload)
                if accepting:
                    none = {"records": 0, "bytes": 0, "first_ns": mono_ns}
                    lost = self._overflows.get(channel, (0, none))[1]
                    more = {"records": lost["records"] + 1, "bytes": lost["bytes"] + len(payload)}
                    self._overflows[channel] = mono_ns, lost | more
            if not was_waiting and (self._queue or self._overflows):
                self._wakeup.put(None)

    def _append_all(self) -> None:
        while items := self._take_queued():
            try:
                self._log.extend(items)
            except Exception as error:  # a defect must also stop the recording and not go unnoticed
                if not isinstance(error, WriteFailed):
                    problem = f"a record could not be appended ({one_line(error)})"
                    error = WriteFailed(self.path, problem, "report this defect")
                self._stop(error, items[self._log.extended :])
                return

    def _take_queued(self) -> list[LogItem]:
        """Wait for records and return all of them; return an empty list if the recording is closing and none are left.

        Overflow events follow the queued records and precede all later ones, because the lost reads belong there.
        """
        while True:
            with self._lock:
                items, self._queue, self._queued_bytes = self._queue, [], 0
                items += [
                    (RecordKind.EVENT, channel, mono_ns, event_payload(Dropped(**lost)))
                    for channel, (mono_ns, lost) in self._overflows.items()
                ]
                self._overflows.clear()
                self._taken = items
                if not items:
                    self._done.notify_all()
                if items or self._closing:
                    return items
            self._wakeup.get()

    def _stop(self, error: WriteFailed, pending: list[LogItem]) -> None:
        """Stop recording; records that were already appended can still be synced."""
        with self._lock:
            self._error = self._error or error
            pending += self._queue
            self._queue, self._taken, self._queued_bytes = [], [], 0
            self._dropped_records += len(pending)
            self._dropped_bytes += sum(len(payload) for *_, payload in pending)
            self._done.notify_all()
        self._guarded(self._log.sync)

    def _sync_often(self) -> None:
        due = self._clock.now_ns() + self._sync_every_ns
        # Wait for the event and not for the clock, so that closing does not wait for the next sync.
        while not self._stop_sync.wait(max(0, due - self._clock.now_ns()) * 1e-9):
            due = max(due, self._clock.now_ns()) + self._sync_every_ns
            if self._log.synced != self._log.written:
                self._guarded(self._log.sync)

    def _append_end(self) -> None:
        counts = {"records": self._log.written.records, "dropped_records": self._dropped_records}
        payload = json.dumps(counts | {"dropped_bytes": self._dropped_bytes}).encode("ascii")
        self._log.extend([(RecordKind.END, 0, self._clock.now_ns(), payload)])

    def _guarded(self, step: Callable[[], object]) -> None:
        """Run a step and keep the first error, which :meth:`close` raises."""
        try:
            step()
        except WriteFailed as error:
            with self._lock:
                self._error = self._error or error
                self._done.notify_all()


def _in_records(records: Sequence[Read]) -> Iterable[Read]:
    """Divide payloads that are longer than a record can be."""
    if all(len(payload) <= MAX_PAYLOAD for _, _, payload in records):
        return records
    return [
        (channel, mono_ns, payload[start : start + MAX_PAYLOAD])
        for channel, mono_ns, payload in records
        for start in range(0, len(payload), MAX_PAYLOAD)
    ]


def check_disk(path: Path, needed_bytes: int) -> None:
    """Raise DiskNearlyFull if the disk of a file has less space, and WriteFailed if the file's folder is missing."""
    try:
        free = shutil.disk_usage(path.absolute().parent).free
    except OSError as error:
        problem = f"its folder cannot be read ({error.strerror or one_line(error)})"
        raise WriteFailed(path, problem, "make the folder first") from error
    if free < needed_bytes:
        problem = f"the run needs {needed_bytes / 1e6:.1f} MB, but {free / 1e6:.1f} MB are free"
        raise DiskNearlyFull(path, problem, "free disk space, record for a shorter time or use another disk")
