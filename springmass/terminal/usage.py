"""Describe errors in a command line in one line, worded from the fields of the parser's errors."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from cyclopts import (
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
    ValidationError,
)
from cyclopts.argument import Argument

__all__ = ["worded"]

ROOT_OPTIONS = ("--help", "--version", "--completion", "--quiet", "--verbose")


def worded(error: CycloptsError, commands: Iterable[str]) -> str:
    """Return a description of an error in a command line, with a remedy.

    Parameters
    ----------
    error : CycloptsError
    commands : iterable of str
        Names of all commands, from which the closest is suggested.
    """
    called = " ".join(("springmass", *(error.command_chain or ())))
    what = _what(error, called, commands)
    return what if what.endswith("?") else f"{what}; {called} --help shows what it takes"


def _what(error: CycloptsError, called: str, commands: Iterable[str]) -> str:
    match error:
        case UnknownCommandError():
            word = (error.unused_tokens or [""])[0]
            if word.startswith("-"):
                return f"{word} is no option of {called}{_near(word, ROOT_OPTIONS)}"
            return f"there is no command {word!r}{_near(word, commands)}"
        case UnknownOptionError():
            word = error.token.keyword or error.token.value
            names = [name for each in error.argument_collection if each.parse for name in each.names]
            known = [*(name for name in names if name.startswith("-")), "--help", "--quiet", "--verbose"]
            return f"{word} is no option of {called}{_near(word, known)}"
        case RepeatArgumentError():
            return f"{error.token.keyword} was given twice; give it once"
        case UnusedCliTokensError():
            return f"{called} takes fewer arguments, got {(error.unused_tokens or [''])[0]!r} too"
        case MissingArgumentError(argument=Argument() as argument):
            name = error.keyword or argument.name
            if not name.startswith("-"):
                return f"{name} is missing"
            if not error.unused_tokens:
                return f"{name} must be given"
            return f"{name} needs a value; one that begins with a minus is written {name}=-..."
        case ValidationError(argument=Argument() as argument):
            return f"{_name(argument)} {error.exception_message}, got {_got(argument)}"
        case CoercionError(argument=Argument() as argument):
            return f"{_name(argument)} {_demand(error, argument)}, got {_got(argument)}{_near_choice(error, argument)}"
        case _:
            return f"the words after {called} are no command line"


def _name(argument: Argument) -> str:
    """Return an option as typed, or the name of an argument."""
    return next((token.keyword for token in argument.tokens if token.keyword), argument.name)


def _got(argument: Argument) -> str:
    return ", ".join(repr(token.value) for token in argument.tokens)


def _demand(error: CoercionError, argument: Argument) -> str:
    if choices := argument.get_choices(force=True):
        return f"must be one of {', '.join(choices)}"
    if isinstance(error.__cause__, ValueError) and error.msg is not None:
        return str(error.msg)  # the message of one of this program's converters
    return "must be a whole number" if error.target_type is int else "must be a number"


def _near_choice(error: CoercionError, argument: Argument) -> str:
    return _near(error.token.value if error.token else "", argument.get_choices(force=True) or ())


def _near(word: str, known: Iterable[str]) -> str:
    near = get_close_matches(word, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""
