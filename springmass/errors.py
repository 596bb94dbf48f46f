"""Exit codes of the program, the errors that lead to them, and its messages on stderr.

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

import contextlib
import logging
import sys
from collections.abc import Collection, Iterator

from failure import Error as Error

OK, SOME_FAILED, USAGE, UNREADABLE, SENSOR, REJECTED, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 4, 5, 70, 130
LOG = logging.getLogger("springmass")
"""What was done is of level INFO, steps that only ``-v`` prints are DEBUG, and problems that ``-q`` prints, WARNING."""
HINT = logging.INFO + 1
"""Level of the next command to type, which only a terminal shows."""
NO_MEMORY = "there is not enough memory; end other programs, or raise the limit"


def of_several(codes: Collection[int]) -> int:
    """Return the exit code of a command whose inputs ended with these."""
    failed = any(code not in (OK, REJECTED) for code in codes)
    return SOME_FAILED if failed and len({*codes}) > 1 else max(codes)


class ProgramError(Error):
    """An error for the user, with an exit code."""

    def __init__(self, problem: str, remedy: str = "", exit_code: int = USAGE, *, where: str = "") -> None:
        super().__init__(problem, remedy, where=where)
        self.exit_code = exit_code


class _Stderr(logging.Handler):
    """Prints each message as one line on stderr, whatever it is at the moment; a problem begins with the program."""

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if record.levelno >= logging.WARNING:  # a file name or a library's message may contain line breaks
            text = f"springmass: {' '.join(text.splitlines())}"
        elif record.levelno == HINT:
            text = f"next: {text}"
        _write(text, only_terminal=record.levelno == HINT)


_STDERR = _Stderr()


def print_messages(level: int) -> None:
    """Print messages of this level and above from now on, as a program does; a library leaves them to ``logging``."""
    LOG.addHandler(_STDERR)
    LOG.propagate = False
    LOG.setLevel(level)


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """Print messages until the ``with`` block ends."""
    with at_level(logging.INFO):
        print_messages(logging.INFO)
        try:
            yield
        finally:
            LOG.removeHandler(_STDERR)
            LOG.propagate = True


@contextlib.contextmanager
def at_level(level: int) -> Iterator[None]:
    """Leave out messages below a level until the ``with`` block ends."""
    before = LOG.level
    LOG.setLevel(level)
    try:
        yield
    finally:
        LOG.setLevel(before)


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


def _write(message: str, *, only_terminal: bool = False) -> None:
    from acquisition.errors import visible  # its package imports numpy, which `--help` does not need

    with contextlib.suppress(OSError, ValueError):  # stderr cannot be written; the exit code still reports the error
        if not only_terminal or (sys.stderr is not None and sys.stderr.isatty()):
            print(visible(message), file=sys.stderr)
