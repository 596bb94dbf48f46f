"""Requests to end a recording: Ctrl-C, SIGTERM, a closed terminal, the page."""

from __future__ import annotations

import _thread
import contextlib
import enum
import signal
import threading
from collections.abc import Iterator

__all__ = ["EndReason", "Stops"]


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
    """Handles the signals that end a recording; used as a context manager.

    Before and after the recording, a signal raises KeyboardInterrupt at any point of the program. During the recording,
    within :meth:`counted`, it does so only in a wait, within :meth:`raised`, so that no step is left unfinished.

    Signals that were ignored before stay ignored: under ``nohup``, a recording outlives its terminal.

    Attributes
    ----------
    by : EndReason or None
        First reason for which the end was requested; None if there was no request.
    """

    def __init__(self) -> None:
        self.by: EndReason | None = None
        self._raises = True
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Stops:
        if threading.current_thread() is threading.main_thread():  # only the main thread can handle signals
            for number in (getattr(signal, name) for name in SIGNALS if hasattr(signal, name)):
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._before[number] = signal.signal(number, self._heard)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()

    @contextlib.contextmanager
    def counted(self) -> Iterator[None]:
        """Defer signals until the waits inside this context."""
        self._raises = False
        try:
            yield
        finally:
            self._raises = True

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
        self.by = self.by or by
        main = threading.main_thread().ident
        if hasattr(signal, "pthread_kill") and main is not None:
            signal.pthread_kill(main, signal.SIGINT)  # interrupts a wait, unlike a flag
        else:
            _thread.interrupt_main()

    def _heard(self, number: int, *_: object) -> None:
        self.by = self.by or SIGNALS[signal.Signals(number).name]
        if self._raises:
            raise KeyboardInterrupt
