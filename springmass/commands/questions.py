"""Word the answer to a reader's question, and what a command does not take, for the command line."""

import re
import shlex
from collections.abc import Mapping, Sequence

from cyclopts import CycloptsError, UnknownOptionError, UnusedCliTokensError
from cyclopts.argument import Argument

from acquisition.errors import NeedsAnswer
from acquisition.recordings.questions import Question
from springmass.loading.options import LOAD_FIELDS
from springmass.terminal.printing import option_of


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
        elif value is not None and value is not False:
            text = f"{value:.15g}" if isinstance(value, float) else str(value)
            # A value may begin with a minus sign only if it is joined to its option by an equals sign.
            words += [f"{option_of(name)}={text}"] if text.startswith("-") else [option_of(name), text]
    return words


def pair_words(answers: Mapping[str, object]) -> list[str]:
    """Return options of reading as the words of a command that takes them as ``--read KEY=VALUE``."""
    texts = {name: f"{value:.15g}" if isinstance(value, float) else str(value) for name, value in answers.items()}
    return [word for name, text in texts.items() for word in ("--read", f"{name}={text}")]


def for_command(question: Question, words: Sequence[str]) -> str:
    """Return a command line with the answers to a question in place of those that it has.

    A command that reads several files gets a line that keeps the answers next to the one that asks.
    """
    end = words.index("--") if "--" in words else len(words)
    declared = _arguments_of(next((word for word in words[1:] if not word.startswith("-")), ""))
    in_pairs = any("--read" in each.names for each in declared)
    if in_pairs and any(each.field_info.kind is each.field_info.VAR_POSITIONAL for each in declared):
        return _line_of("scene", question.path, question.examples)
    kept, others, answered = list[str](), iter(words[:end]), {option_of(name) for name in question.missing}
    for word in others:
        name, equals, value = word.partition("=")
        if name not in answered and name != "--read":
            kept.append(word)
            continue
        value = value if equals else next(others, "")
        if name == "--read" and option_of(value.partition("=")[0]) not in answered:
            kept += [name, value]
    answers = pair_words(question.examples) if in_pairs else option_words(question.examples)
    return " ".join(map(quoted, [*kept, *answers, *words[end:]]))


def for_one(error: NeedsAnswer, command: str, path: str, answers: Mapping[str, object]) -> NeedsAnswer:
    """Return the question about one of several inputs, with a command line for this input alone."""
    others = {name: value for name, value in answers.items() if name not in error.question.missing}
    return error.with_remedy(_line_of(command, path, others | error.question.examples))


def _line_of(command: str, path: str, answers: Mapping[str, object]) -> str:
    """Return a command line for one file."""
    path = f"./{path}" if path.startswith("-") else path
    return " ".join(map(quoted, ["springmass", command, path, *option_words(answers)]))


def _arguments_of(command: str) -> list[Argument]:
    from springmass.commands import COMMANDS, app

    return list(app[command].assemble_argument_collection()) if command in COMMANDS else []


def for_course(question: Question) -> str:
    """Return how to answer a question about one recording of a course: in the table of runs, or for all recordings."""
    columns, options = ", ".join(question.missing), " ".join(map(quoted, pair_words(question.examples)))
    return f"fill in {columns} in the table of runs, or give batch {options} for all recordings"


def refused_words(error: CycloptsError) -> str:
    """Return what a command does not take; an option that says how a file is read may be a key of ``--read``."""
    if isinstance(error, UnusedCliTokensError):
        return f"expected no more arguments, got {' '.join(map(quoted, error.unused_tokens or ()))}"
    if isinstance(error, UnknownOptionError):
        option = error.token.keyword or error.token.value
        taken = (argument.name for argument in error.argument_collection)
        key = option.lstrip("-").replace("-", "_")
        if "--read" in taken and key in LOAD_FIELDS:
            return f"{option}: state it as --read {key}={LOAD_FIELDS[key].metadata['metavar']}"
    return " ".join(str(error).split()).rstrip(".")
