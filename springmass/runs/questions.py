"""How a reader's question is answered: by options of the command that was typed, or by keyword arguments in Python."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence

from acquisition.recordings.questions import Missing, Question

__all__ = ["as_arguments", "as_options", "for_command", "for_course", "for_python", "option_of", "quoted"]


def option_of(name: str) -> str:
    """Return the option of a keyword argument: ``--rate-hz`` of ``rate_hz``."""
    return f"--{name.replace('_', '-')}"


def quoted(word: str) -> str:
    """Return a word as a shell takes it; double quotes where they are enough, for these work on Windows too.

    Examples
    --------
    >>> quoted("run.csv"), quoted("column 2"), quoted('5" disc')
    ('run.csv', '"column 2"', '\\'5" disc\\'')
    """
    if re.fullmatch(r"[\w.:/@%+=,-]+", word):
        return word
    return shlex.quote(word) if re.search(r'["$`\\!]', word) else f'"{word}"'


def as_options(answers: Mapping[str, object]) -> str:
    """Return keyword arguments of :func:`springmass.load` as options of a command.

    Examples
    --------
    >>> as_options({"channel": "column 2", "rate_hz": 50.0, "unverified": False, "unit": None})
    '--channel "column 2" --rate-hz 50'
    """
    words = []
    for name, value in answers.items():
        if value is True:
            words.append(option_of(name))
        elif _is_given(value):
            text = f"{value:.15g}" if isinstance(value, float) else str(value)
            # An option's value may begin with a minus only where it hangs on the option.
            words.append(f"{option_of(name)}{'=' if text.startswith('-') else ' '}{quoted(text)}")
    return " ".join(words)


def as_arguments(answers: Mapping[str, object]) -> str:
    """Return keyword arguments of :func:`springmass.load` as they are written in Python.

    Examples
    --------
    >>> as_arguments({"channel": "column 2", "rate_hz": 50.0})
    'channel="column 2", rate_hz=50.0'
    """
    return ", ".join(f"{name}={_literal(value)}" for name, value in answers.items() if _is_given(value))


def for_command(question: Question, words: Sequence[str], given: Mapping[str, object]) -> str:
    """Return the command line that answers a question.

    Parameters
    ----------
    question : Question
    words : sequence of str
        The command with the file and all that does not say how to read it: ``["springmass", "convert", "a.csv",
        "a.h5"]``.
    given : mapping
        What the user gave already, as :func:`springmass.load` takes it. What the question asks again is left out.

    Examples
    --------
    >>> from acquisition.recordings.questions import MissingItem
    >>> question = Question("run.csv", (MissingItem(Missing.UNIT, ("m", "rad"), "rad", of="theta"),))
    >>> for_command(question, ["springmass", "convert", "run.csv", "run.h5"], {"channel": "theta"})
    'springmass convert run.csv run.h5 --channel theta --unit rad'
    """
    kept = as_options(_without(given, question))
    if "--" in words:
        # Options follow, so a file's name that begins with a minus is written as one that does not.
        at = list(words).index("--")
        words = [*words[:at], *(f"./{word}" if word.startswith("-") else word for word in words[at + 1 :])]
    return " ".join(each for each in (*map(quoted, words), kept, _examples_as_options(question)) if each)


def for_course(question: Question) -> str:
    """Return how the question of one recording of a course is answered: in the table of runs, or for all of them."""
    columns = ", ".join(question.missing)
    return f"fill in {columns} in the table of runs, or give batch {_examples_as_options(question)} for all recordings"


def for_python(question: Question, function: str, given: Mapping[str, object]) -> str:
    """Return the call in Python that answers a question.

    Parameters
    ----------
    question : Question
    function : str
        Name of the function that was called, which takes the path and the answers: ``springmass.load``.
    given : mapping
        As :func:`for_command`.

    Examples
    --------
    >>> from acquisition.recordings.questions import MissingItem
    >>> question = Question("run.csv", (MissingItem(Missing.UNIT, ("m", "rad"), "rad", of="theta"),))
    >>> for_python(question, "springmass.load", {"channel": "theta"})
    'springmass.load("run.csv", channel="theta", unit="rad")'
    """
    kept = as_arguments(_without(given, question))
    examples = ", ".join(
        f"{name}=R" if name == Missing.RATE_HZ else as_arguments({name: value})
        for name, value in question.examples.items()
    )
    return f"{function}({', '.join(each for each in (_literal(question.path), kept, examples) if each)})"


def _examples_as_options(question: Question) -> str:
    # An example of a rate would be copied as if it were the file's.
    return " ".join(
        f"{option_of(name)} R" if name == Missing.RATE_HZ else as_options({name: value})
        for name, value in question.examples.items()
    )


def _without(given: Mapping[str, object], question: Question) -> dict[str, object]:
    return {name: value for name, value in given.items() if name not in question.missing}


def _is_given(value: object) -> bool:
    return value is not None and value is not False


def _literal(value: object) -> str:
    if isinstance(value, bool | int | float):
        return repr(value)
    text = str(value)
    return repr(text) if '"' in text or "\\" in text or not text.isprintable() else f'"{text}"'
