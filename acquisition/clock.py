"""Clocks that are passed as arguments; acquisition, pipeline and storage read the system clock only here."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock with a method that waits until an absolute deadline."""

    def now_ns(self) -> int:
        """Return the monotonic time in nanoseconds."""

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Wait until :meth:`now_ns` reaches ``deadline_ns``; return immediately if the deadline has passed."""


class SystemClock:
    """The machine's monotonic clock; deadlines are absolute, so the errors of individual waits do not accumulate."""

    def now_ns(self) -> int:
        """Return ``time.monotonic_ns()``."""
        return time.monotonic_ns()

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Sleep until the deadline; after an early wake-up, sleep again."""
        while (remaining_ns := deadline_ns - time.monotonic_ns()) > 0:
            time.sleep(remaining_ns * 1e-9)


class VirtualClock:
    """A clock that never waits: a sleep only advances its time."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return the current virtual time."""
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Advance to the deadline; if it has passed, leave the time unchanged."""
        self._now_ns = max(self._now_ns, deadline_ns)
