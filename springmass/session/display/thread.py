"""What is shown of a recording, on a separate thread that can neither delay nor end it.

The session rings once a second; a display that is still busy then misses the ring and shows the latest state at its
next turn. What it raises is counted, written into the run and shown if possible, and the display goes on.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence

from acquisition.block import Block
from springmass.session.display.progress import LiveState, Progress
from springmass.session.failures import Failures

__all__ = ["Display"]

LAST_S = 1.0
"""So long the end of a recording waits for a turn of the display that has begun."""

Samples = Sequence[tuple[int, Block]]


class Display:
    """Calls back about once a second on its own thread.

    Parameters
    ----------
    shown : LiveState
        This thread's alone from here on.
    show : callable
        Takes the progress.
    failures : Failures
    """

    def __init__(self, shown: LiveState, show: Callable[[Progress], None], failures: Failures) -> None:
        self._shown = shown
        self._show = show
        self._failures = failures
        # A ring is what samples to take and how to look at the state; None ends the thread.
        self._rings: queue.SimpleQueue[tuple[Callable[[], Samples], Callable[[LiveState], Progress]] | None] = (
            queue.SimpleQueue()
        )
        self._thread = threading.Thread(target=self._turns, name="springmass-display", daemon=True)
        try:
            self._thread.start()
        except RuntimeError as error:  # no memory for a thread
            failures.note("display", error)

    def ring(self, take: Callable[[], Samples], look: Callable[[LiveState], Progress]) -> None:
        """Ask for a turn: take samples, look at where the recording stands, show it. Never waits."""
        if self._rings.empty():
            self._rings.put((take, look))

    def close(self) -> None:
        """Ask for no more turns; return when the last has ended, or hangs, which is a failure too."""
        if self._thread.ident is None:
            return
        self._rings.put(None)
        self._thread.join(LAST_S)
        if self._thread.is_alive():
            self._failures.note("display", TimeoutError(f"the last turn has not ended after {LAST_S:g} s"))

    def _turns(self) -> None:
        while (ring := self._rings.get()) is not None:
            take, look = ring
            try:
                self._shown.push(take())
                self._show(look(self._shown))
            except BaseException as error:  # whatever it is, it is no reason to lose a reading
                self._failures.note("display", error)
