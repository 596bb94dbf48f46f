"""Exit codes of the program and the errors that lead to them.

====  ================================================================
0     everything done
1     some inputs failed, others were done
2     usage: an invalid option or scene
3     an input that cannot be read or contains nothing to analyse
4     sensor, port or calibration error, or a nearly full disk
5     rejected under ``--strict``
70    internal error: a defect of the program
130   Ctrl-C, SIGTERM or SIGHUP
====  ================================================================
"""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Iterator

from failure import Error as Error

OK, SOME_FAILED, USAGE, UNREADABLE, SENSOR, REJECTED, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 4, 5, 70, 130
_log = logging.getLogger("springmass")
NO_MEMORY = "there is not enough memory; end other programs, or raise the limit"


class ProgramError(Error):
    """An error for the user: one line that says where, what is wrong, the value and what to do; and an exit code."""

    def __init__(self, message: str, exit_code: int = USAGE) -> None:
        super().__init__(message)
        self.exit_code = exit_code

    def __reduce__(self) -> tuple[type[ProgramError], tuple[str, int]]:
        """Return how to rebuild the error in another process that receives it."""
        return type(self), (str(self), self.exit_code)


def complain(message: object) -> None:
    """Report a problem as one line, even if a file name or a library's message contains line breaks."""
    _log.warning("%s", " ".join(str(message).splitlines()))


def tell(message: str) -> None:
    """Report what was done, which ``-q`` leaves out."""
    _log.info("%s", message)


def detail(message: str) -> None:
    """Report the current step, which only ``-v`` prints."""
    _log.debug("%s", message)


class _Stderr(logging.Handler):
    """Prints messages on stderr, whatever it is at the moment, with control characters made visible."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a line; a problem begins with the name of the program."""
        _write(f"{'springmass: ' if record.levelno >= logging.WARNING else ''}{record.getMessage()}")


_PRINTS = _Stderr()


def manner() -> tuple[bool, bool]:
    """Return whether this process prints only errors and warnings, and whether it also prints details."""
    return not _log.isEnabledFor(logging.INFO), _log.isEnabledFor(logging.DEBUG)


def adopt(quiet: bool, verbose: bool) -> None:
    """Print messages from now on: problems alone, or details too."""
    if _PRINTS not in _log.handlers:
        _log.addHandler(_PRINTS)
    _log.propagate = False
    _log.setLevel(logging.WARNING if quiet else logging.DEBUG if verbose else logging.INFO)


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """Print messages until the ``with`` block ends, as a program does; a library leaves them to ``logging``."""
    before, printed = _log.level, _PRINTS in _log.handlers
    adopt(quiet=False, verbose=False)
    try:
        yield
    finally:
        _log.setLevel(before)
        if not printed:
            _log.removeHandler(_PRINTS)
            _log.propagate = True


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Report only problems until the ``with`` block ends."""
    before = _log.level
    _log.setLevel(logging.WARNING)
    try:
        yield
    finally:
        _log.setLevel(before)


def internal_error(error: BaseException) -> str:
    """Return one line about a program defect; write its traceback to a file, or to stderr if that fails."""
    import tempfile
    import traceback

    trace = "".join(traceback.format_exception(error))
    what = " ".join(f"{type(error).__name__}: {error}".split())
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", errors="backslashreplace", prefix="springmass-error-", suffix=".txt", delete=False
        ) as file:
            file.write(trace)
    except OSError:
        _write(trace)
        return f"internal error: {what}; please report it with the lines above"
    return f"internal error: {what}; please report it, details in {file.name}"


def suggest(command: str) -> None:
    """Print the next command to type, if stderr is a terminal."""
    with contextlib.suppress(OSError, ValueError):
        if sys.stderr is not None and sys.stderr.isatty():
            tell(f"next: {command}")


def _write(message: str) -> None:
    from acquisition.errors import visible  # its package imports numpy, which `--help` does not need

    with contextlib.suppress(OSError, ValueError):  # stderr cannot be written; the exit code still reports the error
        print(visible(message), file=sys.stderr)
