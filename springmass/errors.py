"""Exit codes of the program, and which error leads to which.

====  ================================================================
0     everything done
1     some inputs failed, others were done
2     usage: an option or a scene that cannot be
3     an input that cannot be read or holds nothing to analyse
4     sensor or port, or a disk that takes nothing more of a recording
5     rejected under ``--strict``
70    internal error: a defect of the program
130   Ctrl-C, with the file closed cleanly
====  ================================================================
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator

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


class ProgramError(Exception):
    """One line for the user, and the exit code that goes with it.

    Parameters
    ----------
    message : str
        Where, what is wrong, the value, and what to do.
    exit_code : int
        One of the codes above.
    """

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code

    def __reduce__(self) -> tuple[type[ProgramError], tuple[str, int]]:
        """Return how it is made again where it arrives from another process."""
        return type(self), (str(self), self.exit_code)


def complain(message: object) -> None:
    """Write one line to stderr, also where a file's name or a library's message breaks over several."""
    _write(f"springmass: {' '.join(str(message).splitlines())}")


def tell(message: str) -> None:
    """Write one line to stderr, control characters in it made visible; nothing under ``-q``."""
    if not _quiet:
        _write(message)


def detail(message: str) -> None:
    """Write one line to stderr on what is being done, under ``-v`` only."""
    if _verbose:
        _write(message)


def manner() -> tuple[bool, bool]:
    """Return whether this process says but what is wrong, and whether it says what is done, too."""
    return _quiet, _verbose


def adopt(quiet: bool, verbose: bool) -> None:
    """Be as quiet or as verbose as :func:`manner` says of another command or of the process that began this one."""
    global _quiet, _verbose
    _quiet, _verbose = quiet, verbose


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Say nothing but what is wrong until the ``with`` ends."""
    global _quiet
    before, _quiet = _quiet, True
    try:
        yield
    finally:
        _quiet = before


def internal_error(error: BaseException) -> str:
    """Return one line on a defect of the program; its traceback goes to a file, or to stderr where none can be written.

    Parameters
    ----------
    error : BaseException
        As it was caught.
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
    """Say what to type next, where somebody watches."""
    with contextlib.suppress(OSError, ValueError):
        if sys.stderr is not None and sys.stderr.isatty():
            tell(f"next: {command}")


def _write(message: str) -> None:
    from acquisition.errors import visible  # its package imports numpy, which `--help` does not need

    with contextlib.suppress(OSError, ValueError):  # nobody hears it; the exit code still says what it was
        print(visible(message), file=sys.stderr)
