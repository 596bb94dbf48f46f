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
import weakref
from collections.abc import Callable, Iterator
from types import FrameType

from acquisition.clock import SystemClock
from acquisition.errors import visible
from springmass.errors import INTERRUPTED

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
    """The signals that end a command. Those ignored before stay ignored: under ``nohup``, a recording goes on.

    The first raises KeyboardInterrupt within :meth:`raised`, after the end of an import; outside, it waits for the next
    :meth:`raised`. The second ends the process at once, on a thread, because the main thread may wait for a disk. It
    calls ``leaving`` and prints ``last_words``, which must not wait for a disk. ``by`` is the first reason for the end.
    """

    def __init__(self) -> None:
        self._before: dict[int, object] = {}
        self.by: EndReason | None = None
        self.last_words: Callable[[], str] = lambda: "stopped immediately"
        self.leaving: list[Callable[[], object]] = []
        self._raises = self._signalled = self._postponed = False

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

    def _heard(self, number: int, frame: FrameType | None) -> None:
        if self._signalled:
            return
        self.by = self.by or SIGNALS[signal.Signals(number).name]
        if self._raises and _swallows(frame):
            self._postponed = True
            return
        self._signalled = True
        if self._raises:
            raise KeyboardInterrupt

    def _watch(self, woken: socket.socket) -> None:
        """Leave at the second signal. Python writes the number of each signal to ``woken``, whatever is going on."""
        clock, first_ns, again = SystemClock(), None, 0
        with woken:
            while True:
                try:
                    if not (number := woken.recv(1)):
                        return
                except TimeoutError:
                    if self._postponed:
                        self._postponed, again = False, again + 1
                        _interrupt_main()
                    continue
                if signal.Signals(number[0]).name not in SIGNALS:
                    continue
                if again:
                    again -= 1
                elif first_ns is None:
                    first_ns = clock.now_ns()
                    woken.settimeout(0.02)
                elif clock.now_ns() - first_ns > TOGETHER_NS:
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


_OF_CALLBACKS = (weakref.__file__, weakref.WeakSet.__init__.__code__.co_filename)
"""The modules that Python calls when an object is gone."""


def _swallows(frame: FrameType | None) -> bool:
    """Return whether Python drops or converts what a handler raises: in an import, a destructor or its callbacks."""
    while frame is not None:
        code = frame.f_code
        if code.co_filename.startswith("<frozen importlib") or code.co_filename in _OF_CALLBACKS:
            return True
        if code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


def _interrupt_main() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)  # interrupts a wait, unlike a flag
    else:
        _thread.interrupt_main()


STOPS = Stops()
"""The signals of this process."""
