"""Failures that do not end a recording: counted, written into the run once, and reported at its end.

A ``Worker`` does what may fail or wait, such as showing the recording, on a thread of its own.
"""

import contextlib
import queue
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from acquisition.events import StoredEvent
from springmass.typeset import count
from storage.errors import one_line

LAST_STEP_S = 1.0
"""Maximum time that the end of a recording waits for a worker's last step, s."""


class Failures:
    """Counts failures by component, error and the line that raised it; any thread may report a failure."""

    def __init__(self) -> None:
        self._tell: Callable[[StoredEvent], None] | None = None
        self._lock = threading.Lock()
        self._counts: dict[str, int] = {}

    @contextlib.contextmanager
    def told_to(self, tell: Callable[[StoredEvent], None]) -> Iterator[None]:
        """In this context, which is that of a recording, make an event of the first failure of each kind."""
        self._tell = tell
        try:
            yield
        finally:
            self._tell = None

    def note(self, what: str, error: BaseException) -> None:
        """Count a failure of a component, such as the display, a decoder or the reader."""
        where = raised_at(error)
        name = f"{what}: {type(error).__name__} at {where}"
        with self._lock:
            tell = None if name in self._counts else self._tell
            self._counts[name] = self._counts.get(name, 0) + 1
        if tell is not None:
            tell(StoredEvent(f"{what}_failed", {"error": type(error).__name__, "why": one_line(error), "where": where}))

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of failures of each kind."""
        with self._lock:
            return dict(self._counts)

    def describe(self) -> list[str]:
        """Return a readable line for each kind of failure."""
        return [
            f"during the recording, which went on, {count(times, 'time')}: {name}"
            for name, times in self.counts.items()
        ]


def raised_at(error: BaseException) -> str:
    """Return the file name, without its folder, and the line that raised an error."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "nowhere"


class Worker:
    """Takes steps in turn on a daemon thread; ``failed`` gets what a step raises, on that thread, and work goes on."""

    def __init__(self, name: str, failed: Callable[[BaseException], None]) -> None:
        self.failed = failed
        self._steps: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=f"springmass-{name}", daemon=True)
        try:
            self._thread.start()
        except RuntimeError as error:  # no memory for a thread
            failed(error)

    @property
    def idle(self) -> bool:
        """Whether no step waits for its turn."""
        return self._steps.empty()

    def put(self, step: Callable[[], object]) -> None:
        """Add a step, without waiting for it."""
        self._steps.put(step)

    def close(self, why: str) -> None:
        """Take no more steps, and wait for the last one; if it hangs, ``why`` is a failure."""
        if self._thread.ident is not None:
            self._steps.put(None)
            self._thread.join(LAST_STEP_S)
            if self._thread.is_alive():
                self.failed(TimeoutError(why))

    def _work(self) -> None:
        while (step := self._steps.get()) is not None:
            try:
                step()
            except BaseException as error:  # no error of a display may cost a reading
                self.failed(error)
