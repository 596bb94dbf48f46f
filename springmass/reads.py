"""Reads on their way from the port: to the recorder as they are, and into the session's queue."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from acquisition.decoders.base import Polled
from storage.recorder import Recorder

__all__ = ["Read", "Tee", "drained", "joined_reads"]


@dataclass(frozen=True, slots=True)
class Read:
    """The bytes of one read of a port, or an event of it ("lost", "reopened", "timeout").

    Parameters
    ----------
    channel : int
    host_ns : int, ns
    data : bytes
        Empty for an event.
    event : str
    facts : mapping
        Of the event.
    """

    channel: int
    host_ns: int
    data: bytes
    event: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)


class Tee:
    """Hands every read to the recorder, once there is one, and to the session's queue."""

    def __init__(self, askers: Mapping[int, Polled]) -> None:
        # On the reading thread, beside the session's own decoders: they say what a polled sensor is asked next.
        self._askers = askers
        self._lock = threading.Lock()
        self._recorder: Recorder | None = None
        self.items: queue.SimpleQueue[Read] = queue.SimpleQueue()

    def start(self, recorder: Recorder, before: Sequence[Read] | None) -> list[Read]:
        """Record from here on, no read twice and none left out; return the reads from before that belong to the run.

        What a polled sensor is asked begins anew, as the recorded bytes do.
        """
        with self._lock:
            waiting = drained(self.items)
            kept = [] if before is None else [item for item in (*before, *waiting) if item.data]
            for item in kept:
                recorder.data(item.channel, item.host_ns, item.data)
            self._recorder = recorder
            for asker in self._askers.values():
                asker.flush()
        return kept

    def stop(self) -> None:
        """Record no more."""
        with self._lock:
            self._recorder = None

    def data(self, channel: int, host_ns: int, data: bytes) -> None:
        """Take the bytes of one read; called on the reading thread."""
        with self._lock:
            if self._recorder is not None:
                self._recorder.data(channel, host_ns, data)
            if channel in self._askers:
                self._askers[channel].feed(host_ns, data)
            self.items.put(Read(channel, host_ns, data))

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Take an event; called on the reading thread."""
        with self._lock:
            if self._recorder is not None:
                self._recorder.event(channel, host_ns, kind, facts)
            if channel in self._askers:
                self._askers[channel].flush()
            self.items.put(Read(channel, host_ns, b"", kind, facts))


def drained(items: queue.SimpleQueue[Read]) -> list[Read]:
    """Return what waits in a queue."""
    found: list[Read] = []
    with contextlib.suppress(queue.Empty):
        while True:
            found.append(items.get_nowait())
    return found


def joined_reads(items: list[Read], has_device_time: Sequence[bool]) -> list[Read]:
    """Return items with neighbouring reads of one sensor as one, where its times do not come from the host's stamps."""
    joined: list[Read] = []
    for item in items:
        last = joined[-1] if joined else None
        mergeable = last is not None and last.channel == item.channel and last.data and item.data
        if last is not None and mergeable and has_device_time[item.channel]:
            joined[-1] = Read(item.channel, item.host_ns, last.data + item.data)
        else:
            joined.append(item)
    return joined
