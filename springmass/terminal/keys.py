"""Keys that put marks into a recording: the space bar alone, or a word with Enter."""

from __future__ import annotations

import contextlib
import os
import queue
import select
import sys
import threading
from collections.abc import Iterator

try:
    import termios
    import tty
except ImportError:  # Windows: a line with Enter is a mark there
    termios = None  # type: ignore[assignment]

__all__ = ["Marks", "marks_by_keys"]

PLAIN_MARK = "mark"
Marks = queue.SimpleQueue[str]


@contextlib.contextmanager
def marks_by_keys(*, watched: bool) -> Iterator[Marks | None]:
    """Give the marks that are typed while a recording runs; None where nobody can type.

    Parameters
    ----------
    watched : bool
        Whether a terminal shows what is typed. Else lines are marks, as the terminal itself hands them over.

    Notes
    -----
    Ctrl-C and Ctrl-Z stay the terminal's. A program in the background leaves the terminal alone: to touch it would
    stop the program.
    """
    descriptor = _foreground()
    if descriptor is None:
        yield None
        return
    marks: Marks = queue.SimpleQueue()
    if termios is None or not watched:
        threading.Thread(target=_lines, args=(marks,), name="springmass-marks", daemon=True).start()
        yield marks
        return
    before = termios.tcgetattr(descriptor)
    wake, end = os.pipe()
    thread = threading.Thread(target=_keys, args=(descriptor, wake, marks), name="springmass-marks", daemon=True)
    try:
        tty.setcbreak(descriptor, termios.TCSANOW)
        thread.start()
        yield marks
    finally:
        with contextlib.suppress(termios.error):  # a terminal that was closed has no modes any more
            termios.tcsetattr(descriptor, termios.TCSANOW, before)
        os.close(end)
        if thread.ident is not None:
            thread.join()
        os.close(wake)


def _foreground() -> int | None:
    """Return the descriptor of standard input where it is a terminal that this program may read."""
    try:
        if sys.stdin is None or not sys.stdin.isatty():
            return None
        descriptor = sys.stdin.fileno()
        if termios is not None and os.tcgetpgrp(descriptor) != os.getpgrp():
            return None
    except (OSError, ValueError):  # closed, or the terminal of another session
        return None
    return descriptor


def _lines(marks: Marks) -> None:
    with contextlib.suppress(OSError, ValueError):  # a terminal that was closed: no more marks come
        for text in sys.stdin:
            marks.put(text.strip() or PLAIN_MARK)


def _keys(descriptor: int, wake: int, marks: Marks) -> None:
    """Read keys until the other end of ``wake`` closes: text up to Enter is a mark, a space before any text too."""
    typed = b""
    with contextlib.suppress(OSError):  # a terminal that was closed: no more marks come
        while wake not in select.select([descriptor, wake], [], [])[0]:
            data = os.read(descriptor, 64)
            if not data:
                return
            for key in (data[i : i + 1] for i in range(len(data))):
                if key in b"\r\n" or (key == b" " and not typed):
                    marks.put(typed.decode(errors="replace").strip() or PLAIN_MARK)
                    typed = b""
                elif key in b"\x7f\x08":
                    typed = typed[:-1]
                elif key >= b" ":
                    typed += key
