"""Requests that a recording shall end: Ctrl-C, SIGTERM, a closed terminal, the page."""

from __future__ import annotations

import _thread
import contextlib
import enum
import signal
import threading
from collections.abc import Iterator

__all__ = ["EndReason", "Stops"]


class EndReason(enum.StrEnum):
    """What ended a recording.

    The values stand in wire logs (event ``ended``) and never change.
    """

    SECONDS = "seconds"
    """The time that was asked for is over."""
    CTRL_C = "Ctrl-C"
    SIGTERM = "SIGTERM"
    HANGUP = "a closed terminal"
    PAGE = "the page"
    """The button or key of its page."""
    DISK = "the disk"
    """The disk took nothing more."""


SIGNALS = {"SIGINT": EndReason.CTRL_C, "SIGTERM": EndReason.SIGTERM, "SIGHUP": EndReason.HANGUP}


class Stops:
    """Takes the signals that end a recording; used in a ``with``.

    Before and after the recording a signal raises KeyboardInterrupt wherever the program is. While it records, within
    :meth:`counted`, it only does so in a wait, within :meth:`raised`: no step is left half done.

    What was ignored before stays ignored: under ``nohup`` a recording outlives its terminal.

    Attributes
    ----------
    by : EndReason or None
        What asked first for the end; None where nothing did.
    """

    def __init__(self) -> None:
        self.by: EndReason | None = None
        self._raises = True
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Stops:
        if threading.current_thread() is threading.main_thread():  # signals are the main thread's
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
        """Hold signals back for the waits within."""
        self._raises = False
        try:
            yield
        finally:
            self._raises = True

    @contextlib.contextmanager
    def raised(self) -> Iterator[None]:
        """Raise KeyboardInterrupt for a signal that came or comes."""
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
            signal.pthread_kill(main, signal.SIGINT)  # wakes a wait, which a flag would not
        else:
            _thread.interrupt_main()

    def _heard(self, number: int, *_: object) -> None:
        self.by = self.by or SIGNALS[signal.Signals(number).name]
        if self._raises:
            raise KeyboardInterrupt
