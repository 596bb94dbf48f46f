"""Requests to end the work: Ctrl-C, SIGTERM, a closed terminal, the page of a recording."""

from __future__ import annotations

import _thread
import contextlib
import enum
import os
import select
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator

from acquisition.clock import SystemClock
from acquisition.errors import visible
from springmass.errors import INTERRUPTED

__all__ = ["STOPS", "EndReason", "Stops"]

TOGETHER_NS = 100_000_000
"""Signals within this time count as one: `timeout` and some terminals send each of them twice."""


class EndReason(enum.StrEnum):
    """The reason for the end of a recording.

    The values are stored in wire logs (event ``ended``) and must never change.
    """

    SECONDS = "seconds"
    """The given duration is over."""
    CTRL_C = "Ctrl-C"
    SIGTERM = "SIGTERM"
    HANGUP = "a closed terminal"
    PAGE = "the page"
    """The button or key of the recording's page was pressed."""
    DISK = "the disk"
    """Nothing more could be written to the disk."""


SIGNALS = {"SIGINT": EndReason.CTRL_C, "SIGTERM": EndReason.SIGTERM, "SIGHUP": EndReason.HANGUP}


class Stops:
    """The signals that end a command, in two states.

    The first raises KeyboardInterrupt within :meth:`raised`; outside, it waits for the next :meth:`raised`. The second
    ends the process at once. This is the work of a thread, because the main thread may wait for a disk that hangs.
    Signals that were ignored before stay ignored: under ``nohup``, a recording outlives its terminal.

    Attributes
    ----------
    by : EndReason or None
        First reason for which the end was requested; None if there was no request.
    last_words : callable
        Returns the line that the second signal prints. It must not wait for a disk.
    leaving : list of callable
        Called before the second signal ends the process.
    """

    def __init__(self) -> None:
        self._before: dict[int, object] = {}
        self._reset()

    def _reset(self) -> None:
        self.by: EndReason | None = None
        self.last_words: Callable[[], str] = lambda: "stopped immediately"
        self.leaving: list[Callable[[], object]] = []
        self._raises = self._signalled = False

    def begin(self) -> None:
        """Handle signals from now on, if this is the main thread; no other can."""
        self._reset()
        if threading.current_thread() is not threading.main_thread():
            return
        for number in (getattr(signal, name) for name in SIGNALS if hasattr(signal, name)):
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[int(number)] = signal.signal(number, self._heard)
        if not self._before:
            return
        self._dropped_before, sys.unraisablehook = sys.unraisablehook, self._dropped
        woken, self._wake = socket.socketpair()
        self._wake.setblocking(False)
        self._woken_before = signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        threading.Thread(target=self._watch, args=(woken,), name="springmass-signals", daemon=True).start()

    def end(self, *, program: bool = False) -> None:
        """Handle signals as before; as the last act of the program, ignore them: while Python ends, they would kill."""
        if not self._before:
            return
        sys.unraisablehook = self._dropped_before
        signal.set_wakeup_fd(self._woken_before)
        self._wake.close()
        before, self._before = self._before, {}
        for number, handler in before.items():  # the last step, because an earlier handler may raise
            signal.signal(number, signal.SIG_IGN if program else handler)  # type: ignore[arg-type]

    @contextlib.contextmanager
    def counted(self) -> Iterator[None]:
        """Defer signals until the waits inside this context, and forget those that come after the last of them."""
        before, self._raises = self._raises, False
        try:
            yield
        finally:
            self._raises = before

    @contextlib.contextmanager
    def raised(self) -> Iterator[None]:
        """Raise KeyboardInterrupt for a deferred signal, or for one that arrives in this context."""
        before, self._raises = self._raises, True
        try:
            if self.by and not before:
                raise KeyboardInterrupt
            yield
        finally:
            self._raises = before

    def ask(self, by: EndReason) -> None:
        """End the recording from another thread, as the first signal would."""
        if self.by is not None:
            return
        self.by = by
        _interrupt_main()

    def _dropped(self, dropped: sys.UnraisableHookArgs) -> None:
        """Deliver a signal again that came in a destructor, for example of an import: Python drops what they raise."""
        if not isinstance(dropped.exc_value, KeyboardInterrupt):
            self._dropped_before(dropped)
            return
        self._signalled = False
        threading.Timer(0.01, _interrupt_main).start()  # not from here, where it would be dropped as well

    def _heard(self, number: int, _: object) -> None:
        if self._signalled:
            return
        self._signalled = True
        self.by = self.by or SIGNALS[signal.Signals(number).name]
        if self._raises:
            raise KeyboardInterrupt

    def _watch(self, woken: socket.socket) -> None:
        """Leave at the second signal. Python writes the number of each signal to ``woken``, whatever is going on."""
        clock, first_ns = SystemClock(), None
        with woken:
            while number := woken.recv(1):
                if signal.Signals(number[0]).name not in SIGNALS:
                    continue
                now_ns = clock.now_ns()
                if first_ns is None:
                    first_ns = now_ns
                elif now_ns - first_ns > TOGETHER_NS:
                    self._leave()

    def _leave(self) -> None:
        try:
            for step in self.leaving:
                step()
            line, stderr = f"springmass: {visible(self.last_words())}\n", sys.stderr.fileno()
            if os.isatty(stderr):
                line = f"\r\n\x1b[?25h{line}"  # with the cursor that a display has hidden
            if os.name == "nt" or select.select([], [stderr], [], 0.0)[1]:  # otherwise nobody reads, and a write waits
                os.write(stderr, line.encode(errors="backslashreplace"))
        finally:
            os._exit(INTERRUPTED)


def _interrupt_main() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)  # interrupts a wait, unlike a flag
    else:
        _thread.interrupt_main()


STOPS = Stops()
"""The signals of this process."""
