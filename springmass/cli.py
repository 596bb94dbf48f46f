"""The program: it calls a command, reports an error as one line on stderr, and returns the exit code."""

import contextlib
import errno
import os
import sys
from collections.abc import Sequence

from springmass import errors
from springmass.stops import STOPS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code; a user's error and a program defect each give one line on stderr."""
    STOPS.begin()
    try:
        with errors.printing():
            return _run(arguments)
    finally:
        STOPS.end(program=arguments is None)


def _run(arguments: Sequence[str] | None) -> int:
    # Characters that the terminal's encoding lacks are shown escaped. Line buffering keeps the order of both streams
    # when they go to the same place.
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace", line_buffering=True)
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        return _call(words)
    except KeyboardInterrupt:
        errors.LOG.warning("interrupted")
        return errors.INTERRUPTED
    except ImportError as error:
        errors.LOG.warning(f"{error}; this installation is not whole, springmass doctor says what is wrong with it")
        return errors.SOME_FAILED
    except MemoryError:
        errors.LOG.warning(errors.NO_MEMORY)
        return errors.UNREADABLE
    except BrokenPipeError:
        # The reader of the output has closed the pipe (`| head`): print nothing more, not even at exit.
        _abandon_output()
        return errors.OK
    except Exception as error:
        if isinstance(error, RuntimeError) and "start new thread" in str(error):
            errors.LOG.warning("no memory for another thread; end other programs, or raise the limit")
            return errors.UNREADABLE
        if isinstance(error, OSError) and error.filename is None and error.errno in _OUTPUT_FULL:
            _abandon_output()
            errors.LOG.warning(f"standard output cannot be written: {error.strerror}; write to another disk")
            return errors.USAGE
        code = _exit_code(error)
        if code is None:
            errors.LOG.warning(errors.internal_error(error))
            return errors.INTERNAL
        errors.LOG.warning(error)
        return code


def _call(words: Sequence[str]) -> int:
    """Call a command; answer command-line errors and a reader's questions, because both need the command line."""
    from cyclopts import CycloptsError, UnknownCommandError

    from springmass.commands import COMMANDS, call

    try:
        with STOPS.raising(True):
            return call(words)
    except UnknownCommandError as error:
        from difflib import get_close_matches

        # The library's own message ends its list after eight commands.
        word = (error.unused_tokens or words)[0]
        near = "".join(f"did you mean {name}? " for name in get_close_matches(word, COMMANDS, n=1))
        errors.LOG.warning(f"unknown command {word!r}; {near}the commands are {', '.join(COMMANDS)}")
        return errors.USAGE
    except CycloptsError as error:
        from springmass.commands.questions import refused_words

        what = refused_words(error)
        called = " ".join(("springmass", *(error.command_chain or ())))
        errors.LOG.warning(f"{what}{' ' if what.endswith('?') else '; '}{called} --help shows what it takes")
        return errors.USAGE
    except Exception as error:
        from acquisition.errors import NeedsAnswer

        if not isinstance(error, NeedsAnswer):
            raise
        from springmass.commands.questions import for_command

        raise error.with_remedy(for_command(error.question, ["springmass", *words])) from None


_OUTPUT_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""Error numbers with which a system refuses to write to standard output."""


def _abandon_output() -> None:
    """Redirect the rest of standard output to the null device, so that Python's exit does not fail on it."""
    with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor has nothing that could fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _exit_code(error: Exception) -> int | None:
    """Return the exit code of an error that is meant for the user, or None for a defect of the program."""
    if isinstance(error, errors.ProgramError):
        return error.exit_code
    from acquisition.errors import AcquisitionError, CalibrationError, PortError, SensorError
    from pipeline.errors import DynamicsError, PipelineError, SceneError
    from storage.errors import DiskNearlyFull, StorageError, WriteFailed

    if isinstance(error, PortError | CalibrationError | DiskNearlyFull):
        return errors.SENSOR
    if isinstance(error, SceneError | DynamicsError | WriteFailed | SensorError):
        return errors.USAGE
    return errors.UNREADABLE if isinstance(error, AcquisitionError | PipelineError | StorageError) else None
