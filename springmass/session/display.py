"""Show a recording on a separate thread that can neither delay nor end it.

The session requests an update once a second. A display that is still busy then skips the request and shows the latest
state at its next turn. Its exceptions are counted and written into the run, and the display continues.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence

from acquisition.block import Block
from springmass.session.failures import Failures
from springmass.session.progress import LiveState, Progress

LAST_S = 1.0
"""Maximum time that the end of a recording waits for the display's current turn, s."""

Samples = Sequence[tuple[int, Block]]


class Display:
    """Shows the progress on its own thread, which alone uses ``shown`` from now on."""

    def __init__(self, shown: LiveState, show: Callable[[Progress], None], failures: Failures) -> None:
        self._shown, self._show, self._failures = shown, show, failures
        # A request has a function that takes samples and one that reads the state; None ends the thread.
        self._rings: queue.SimpleQueue[tuple[Callable[[], Samples], Callable[[LiveState], Progress]] | None] = (
            queue.SimpleQueue()
        )
        self._thread = threading.Thread(target=self._turns, name="springmass-display", daemon=True)
        try:
            self._thread.start()
        except RuntimeError as error:  # no memory for a thread
            failures.note("display", error)

    def ring(self, take: Callable[[], Samples], look: Callable[[LiveState], Progress]) -> None:
        """Request a turn, which takes samples and shows the state of the recording; never wait."""
        if self._rings.empty():
            self._rings.put((take, look))

    def close(self) -> None:
        """Request no more turns, and wait for the last one to end; if it hangs, record a failure."""
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
            except BaseException as error:  # no error of the display may cost a reading
                self._failures.note("display", error)
