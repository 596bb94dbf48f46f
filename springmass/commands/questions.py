"""Word the answer to a reader's question as options of the command line, quoted for a shell."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence

from acquisition.recordings.questions import Question
from springmass.api.questions import is_given


def option_of(name: str) -> str:
    """Return the option for a keyword argument: ``--rate-hz`` for ``rate_hz``, ``--from`` for ``from_s``."""
    return f"--{name.removesuffix('_s').replace('_', '-')}"


def quoted(word: str) -> str:
    """Return a word quoted for a shell, with double quotes where they suffice, since these work on Windows too.

    >>> quoted("run.csv"), quoted("column 2"), quoted('5" disc')
    ('run.csv', '"column 2"', '\\'5" disc\\'')
    """
    if re.fullmatch(r"[\w.:/@%+=,-]+", word):
        return word
    return shlex.quote(word) if re.search(r'["$`\\!]', word) else f'"{word}"'


def option_words(answers: Mapping[str, object]) -> list[str]:
    """Return keyword arguments of :func:`springmass.load` as the words of a command line."""
    words = []
    for name, value in answers.items():
        if value is True:
            words.append(option_of(name))
        elif is_given(value):
            text = f"{value:.15g}" if isinstance(value, float) else str(value)
            # A value may begin with a minus sign only if it is joined to its option by an equals sign.
            words += [f"{option_of(name)}={text}"] if text.startswith("-") else [option_of(name), text]
    return words


def as_options(answers: Mapping[str, object]) -> str:
    """Return keyword arguments of :func:`springmass.load` as command-line options."""
    return " ".join(map(quoted, option_words(answers)))


def for_command(question: Question, words: Sequence[str]) -> str:
    """Return a command line with the answers to a question in place of those that it has."""
    end = words.index("--") if "--" in words else len(words)
    answered, kept = {option_of(name) for name in question.missing}, list[str]()
    for before, word in zip(("", *words), words[:end], strict=False):
        if before not in answered and word.partition("=")[0] not in answered:
            kept.append(word)
    return " ".join(map(quoted, [*kept, *option_words(question.examples), *words[end:]]))


def for_course(question: Question) -> str:
    """Return how to answer a question about one recording of a course: in the table of runs, or for all recordings."""
    columns = ", ".join(question.missing)
    return f"fill in {columns} in the table of runs, or give batch {as_options(question.examples)} for all recordings"
