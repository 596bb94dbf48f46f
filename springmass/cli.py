"""The command line: parsing and exit codes here, arguments in ``springmass.terminal.arguments``, work in ``commands``.

Nothing heavier than argparse is imported before a command is known, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import os
import sys

from springmass import __version__
from springmass.errors import (
    INTERNAL,
    INTERRUPTED,
    NO_MEMORY,
    OK,
    SENSOR,
    SOME_FAILED,
    UNREADABLE,
    USAGE,
    adopt,
    complain,
    internal_error,
    manner,
)
from springmass.terminal.arguments import COMMANDS

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import NoReturn

__all__ = ["build_parser", "main"]


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = _Parser(
        prog="springmass",
        description="From a rangefinder's samples to period, spring constant and damping law, "
        "with uncertainties that hold.",
        epilog="exit codes: 0 done, 1 some inputs failed, 2 usage, 3 unreadable input, 4 sensor, port or recording "
        "disk, 5 rejected under --strict, 70 internal error, 130 Ctrl-C",
        formatter_class=_formatter,
    )
    parser.add_argument("--version", action="version", version=f"springmass {__version__}")
    parser.add_argument("-q", "--quiet", action="store_true", help="say on stderr what is wrong, and nothing else")
    parser.add_argument("-v", "--verbose", action="store_true", help="say on stderr what is read, used and written too")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (add, summary) in COMMANDS.items():
        described = summary[0].upper() + summary[1:] + "."
        add(commands.add_parser(name, help=summary, description=described, formatter_class=_formatter))
    return parser


class _Once(argparse.Action):
    """Keeps an option's value; a second one is refused, where argparse would forget the first in silence."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        given = namespace.__dict__.setdefault("_given", set())
        if self.option_strings and self.dest in given:
            parser.error(f"{option_string} was given twice; give it once")
        given.add(self.dest)
        setattr(namespace, self.dest, values)


class _Parser(argparse.ArgumentParser):
    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        self.register("action", None, _Once)
        self.register("action", "store", _Once)

    def error(self, message: str) -> NoReturn:
        if "invalid choice: " in message:
            from difflib import get_close_matches

            word, *choices = message.partition("invalid choice: ")[2].split("'")[1::2]
            if near := get_close_matches(word, choices, n=1):
                message += f"; did you mean {near[0]}?"
        elif message.endswith("required: COMMAND"):
            message = "which command? springmass --help lists them, springmass demo shows what comes of them"
        from acquisition.errors import visible  # not at the top: `--help` has nothing to show

        super().error(visible(message))


def _formatter(prog: str) -> argparse.HelpFormatter:
    """Help as wide as the terminal; argparse would import shutil and three compressors to find that out."""
    try:
        columns = int(os.environ.get("COLUMNS") or os.get_terminal_size(1).columns)
    except (OSError, ValueError):
        columns = 80
    return argparse.HelpFormatter(prog, width=max(columns, 40) - 2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code; a user's mistake is one line on stderr, and so is a defect."""
    before = manner()
    try:
        return _run(arguments)
    finally:
        adopt(*before)


def _run(arguments: Sequence[str] | None) -> int:
    # A title or a name that the terminal's code lacks is shown escaped. Line by line, so that both streams come in the
    # order they were written in where they go to one place.
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace", line_buffering=True)
    try:
        options = build_parser().parse_args(arguments)
        options.words = sys.argv[1:] if arguments is None else list(arguments)
        adopt(options.quiet, options.verbose)
        from importlib import import_module

        return int(import_module(f"springmass.commands.{options.command}").run(options))
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except ImportError as error:
        complain(f"{error}; this installation is not whole, springmass doctor says what is wrong with it")
        return SOME_FAILED
    except MemoryError:
        complain(NO_MEMORY)
        return UNREADABLE
    except BrokenPipeError:
        # The reader of our output went away (`| head`): nothing is left to say, not even at exit.
        _abandon_output()
        return OK
    except Exception as error:
        if isinstance(error, RuntimeError) and "start new thread" in str(error):
            complain("no memory for another thread; end other programs, or raise the limit")
            return UNREADABLE
        if isinstance(error, OSError) and error.filename is None and error.errno in _OUTPUT_FULL:
            _abandon_output()
            complain(f"standard output cannot be written: {error.strerror}; write to another disk")
            return USAGE
        code = _exit_code(error)
        if code is None:
            complain(internal_error(error))
            return INTERNAL
        complain(error)
        return code


_OUTPUT_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""Why a system refuses to write to standard output."""


def _abandon_output() -> None:
    """Send what is left of standard output nowhere, so that Python's own exit does not fail on it."""
    with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor has nothing that could fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _exit_code(error: Exception) -> int | None:
    """Exit code of an error that is meant for the user; None for a defect of the program."""
    from springmass.errors import ProgramError

    if isinstance(error, ProgramError):
        return error.exit_code
    from acquisition.errors import AcquisitionError, CalibrationError, PortError, SensorError
    from pipeline.errors import DynamicsError, PipelineError, SceneError
    from storage.disk import DiskNearlyFull
    from storage.errors import QueryRefused, StorageError, WriteFailed

    if isinstance(error, PortError | CalibrationError | DiskNearlyFull):
        return SENSOR
    if isinstance(error, SceneError | DynamicsError | WriteFailed | SensorError | QueryRefused):
        return USAGE
    return UNREADABLE if isinstance(error, AcquisitionError | PipelineError | StorageError) else None
