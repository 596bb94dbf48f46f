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
import sys
from collections.abc import Iterator

from failure import Error as Error

__all__ = [
    "INTERNAL",
    "INTERRUPTED",
    "NO_MEMORY",
    "OK",
    "REJECTED",
    "SENSOR",
    "SOME_FAILED",
    "UNREADABLE",
    "USAGE",
    "ProgramError",
    "adopt",
    "complain",
    "detail",
    "internal_error",
    "manner",
    "quietly",
    "suggest",
    "tell",
]

_quiet = False
_verbose = False
OK, SOME_FAILED, USAGE, UNREADABLE, SENSOR, REJECTED, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 4, 5, 70, 130


NO_MEMORY = "there is not enough memory; end other programs, or raise the limit"


class ProgramError(Error):
    """An error for the user: a message of one line and an exit code.

    Parameters
    ----------
    message : str
        Where the error is, what is wrong, the value, and what to do.
    exit_code : int
        One of the codes above.
    """

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code

    def __reduce__(self) -> tuple[type[ProgramError], tuple[str, int]]:
        """Return how to rebuild the error in another process that receives it."""
        return type(self), (str(self), self.exit_code)


def complain(message: object) -> None:
    """Write a message to stderr as one line, even if a file name or a library's message contains line breaks."""
    _write(f"springmass: {' '.join(str(message).splitlines())}")


def tell(message: str) -> None:
    """Write one line to stderr with control characters made visible, unless ``-q`` is set."""
    if not _quiet:
        _write(message)


def detail(message: str) -> None:
    """Write one line about the current step to stderr, only under ``-v``."""
    if _verbose:
        _write(message)


def manner() -> tuple[bool, bool]:
    """Return whether this process prints only errors and warnings, and whether it also prints details."""
    return _quiet, _verbose


def adopt(quiet: bool, verbose: bool) -> None:
    """Set quiet and verbose to what :func:`manner` returned earlier, or in the process that started this one."""
    global _quiet, _verbose
    _quiet, _verbose = quiet, verbose


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Print only errors and warnings until the ``with`` block ends."""
    global _quiet
    before, _quiet = _quiet, True
    try:
        yield
    finally:
        _quiet = before


def internal_error(error: BaseException) -> str:
    """Return one line about a program defect; write its traceback to a file, or to stderr if that fails.

    Parameters
    ----------
    error : BaseException
        The exception that was caught.
    """
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
