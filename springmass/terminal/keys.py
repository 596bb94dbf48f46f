"""Put marks into a recording by keys: the space bar alone, or text with Enter."""

import contextlib
import os
import select
import sys
import threading
from collections.abc import Iterator

from springmass.session.session import Marks
from springmass.stops import STOPS

try:
    import termios
    import tty
except ImportError:  # on Windows, only a line with Enter is a mark
    termios = None  # type: ignore[assignment]

PLAIN_MARK = "mark"


@contextlib.contextmanager
def marks_by_keys(marks: Marks, *, watched: bool) -> Iterator[bool]:
    """Put what is typed during a recording into the queue of marks; yield whether anything can be typed.

    If stderr is ``watched`` on a terminal, keys are read singly; otherwise, each line with Enter is a mark. The
    terminal still handles Ctrl-C and Ctrl-Z. A program in the background does not access the terminal, because this
    would stop the program.
    """
    descriptor = _foreground()
    if descriptor is None:
        yield False
        return
    if termios is None or not watched:
        threading.Thread(target=_lines, args=(marks,), name="springmass-marks", daemon=True).start()
        yield True
        return
    before = termios.tcgetattr(descriptor)
    wake, end = os.pipe()
    thread = threading.Thread(target=_keys, args=(descriptor, wake, marks), name="springmass-marks", daemon=True)

    def restore() -> None:
        termios.tcsetattr(descriptor, termios.TCSANOW, before)

    try:
        with STOPS.leaving(restore):
            tty.setcbreak(descriptor, termios.TCSANOW)
            thread.start()
            yield True
    finally:
        with contextlib.suppress(termios.error):  # a closed terminal has no modes
            restore()
        os.close(end)
        if thread.ident is not None:
            thread.join()
        os.close(wake)


def _foreground() -> int | None:
    """Return the descriptor of standard input if it is a terminal that this program may read, else None."""
    try:
        if sys.stdin is None or not sys.stdin.isatty():
            return None
        descriptor = sys.stdin.fileno()
        if termios is not None and os.tcgetpgrp(descriptor) != os.getpgrp():
            return None
    except (OSError, ValueError):  # standard input is closed, or is the terminal of another session
        return None
    return descriptor


def _lines(marks: Marks) -> None:
    with contextlib.suppress(OSError, ValueError):  # a terminal that was closed: no more marks come
        for text in sys.stdin:
            marks.put(text.strip() or PLAIN_MARK)


def _keys(descriptor: int, wake: int, marks: Marks) -> None:
    """Read keys until the other end of ``wake`` closes; text up to Enter is a mark, as is a space before any text."""
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
