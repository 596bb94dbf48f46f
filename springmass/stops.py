"""Requests to end the work: Ctrl-C, SIGTERM, a closed terminal, the page of a recording."""

import contextlib
import enum
import os
import select
import signal
import socket
import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from types import FrameType

from acquisition.clock import SystemClock
from acquisition.errors import visible
from springmass.errors import INTERRUPTED

TOGETHER_NS = 100_000_000
"""Signals within this time count as one: `timeout` and some terminals send each of them twice."""
AGAIN_S = 0.02


class EndReason(enum.StrEnum):
    """The reason for the end of a recording; wire logs hold these values (event ``ended``), which must never change."""

    SECONDS = "seconds"
    CTRL_C = "Ctrl-C"
    SIGTERM = "SIGTERM"
    HANGUP = "a closed terminal"
    PAGE = "the page"
    DISK = "the disk"


SIGNALS = {"SIGINT": EndReason.CTRL_C, "SIGTERM": EndReason.SIGTERM, "SIGHUP": EndReason.HANGUP}


class Stops:
    """Whether a command runs, ends or leaves. Signals ignored before stay ignored: ``nohup`` keeps a recording alive.

    It runs while ``by`` is None. It ends, for the reason ``by``, after the first signal or a request of the page: the
    signal raises KeyboardInterrupt within :meth:`raising`, or waits for its next context. It leaves at the second
    signal, on a thread, because the main thread may wait for a disk.
    """

    def __init__(self) -> None:
        self.by: EndReason | None = None
        self._steps: list[Callable[[], str | None]] = []
        self._raises = self._answered = False  # whether signals raise now, and whether one was answered
        self._before: dict[int, object] = {}

    def begin(self) -> None:
        """Handle signals from now on, if this is the main thread; no other can."""
        vars(self).update(vars(Stops()))  # a new command
        if threading.current_thread() is not threading.main_thread():
            return
        for number in (getattr(signal, name) for name in SIGNALS if hasattr(signal, name)):
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[int(number)] = signal.signal(number, self._heard)
        if not self._before:
            return
        woken, self._wake = socket.socketpair()
        self._wake.setblocking(False)
        self._woken_before = signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        threading.Thread(target=self._watch, args=(woken,), name="springmass-signals", daemon=True).start()

    def end(self, *, program: bool = False) -> None:
        """Handle signals as before; as the last act of the program, ignore them: while Python ends, they would kill."""
        if not self._before:
            return
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.set_wakeup_fd(self._woken_before)
        self._wake.close()
        before, self._before = self._before, {}
        for number, handler in before.items():  # the last step, because an earlier handler may raise
            signal.signal(number, signal.SIG_IGN if program else handler)  # type: ignore[arg-type]

    @contextlib.contextmanager
    def raising(self, now: bool) -> Iterator[None]:
        """Raise KeyboardInterrupt for signals in this context and requests made before it, or defer them.

        With ``now`` false, signals wait for the next context inside with ``now``; if none follows, they raise nothing.
        """
        before, self._raises = self._raises, now
        try:
            if now and not before and self.by:
                raise KeyboardInterrupt
            yield
        finally:
            self._raises = before

    @contextlib.contextmanager
    def leaving(self, step: Callable[[], str | None]) -> Iterator[None]:
        """Call a step if the program leaves in this context, and print its words; it must not wait for a disk."""
        self._steps.append(step)
        try:
            yield
        finally:
            self._steps.remove(step)

    def ask(self, by: EndReason) -> None:
        """End the recording at its next wait; any thread may ask."""
        self.by = self.by or by

    def _heard(self, number: int, frame: FrameType | None) -> None:
        if not self._answered:
            self.by = self.by or SIGNALS[signal.Signals(number).name]
            self._answer(0, frame)

    def _answer(self, _: int, frame: FrameType | None) -> None:
        if self._raises and _swallows(frame):
            signal.signal(signal.SIGALRM, self._answer)
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
            return
        self._answered = True
        if self._raises:
            raise KeyboardInterrupt

    def _watch(self, woken: socket.socket) -> None:
        """Leave at the second signal. Python writes the number of each signal to ``woken``, whatever is going on."""
        clock, first_ns = SystemClock(), None
        with woken:
            while number := woken.recv(1):
                if signal.Signals(number[0]).name not in SIGNALS:
                    continue
                if first_ns is None:
                    first_ns = clock.now_ns()
                elif clock.now_ns() - first_ns > TOGETHER_NS:
                    self._leave()

    def _leave(self) -> None:
        try:
            words = [said for step in self._steps if (said := step())] or ["stopped immediately"]
            line, stderr = f"springmass: {visible(words[0])}\n", sys.stderr.fileno()
            if os.isatty(stderr):
                line = f"\r\n\x1b[?25h{line}"  # with the cursor that a display has hidden
            if os.name == "nt" or select.select([], [stderr], [], 0.0)[1]:  # otherwise nobody reads, and a write waits
                os.write(stderr, line.encode(errors="backslashreplace"))
        finally:
            os._exit(INTERRUPTED)


_OF_CALLBACKS = (weakref.__file__, weakref.WeakSet.__init__.__code__.co_filename)
"""The modules that Python calls when an object is gone."""


def _swallows(frame: FrameType | None) -> bool:
    """Return whether Python drops or converts what a handler raises: in an import, a destructor or its callbacks.

    Without this, 2 of 200 signals at random moments of ``springmass batch`` became the ImportError of an extension
    module, and the course kept a row with an internal error (the trial in tests/faults/test_signals.py).
    """
    while frame is not None and hasattr(signal, "setitimer"):
        code = frame.f_code
        if code.co_filename.startswith("<frozen importlib") or code.co_filename in _OF_CALLBACKS:
            return True
        if code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


STOPS = Stops()
"""The signals of this process."""
