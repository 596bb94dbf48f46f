"""The error tree of acquisition.

::

    AcquisitionError
    |-- FormatError          a recording cannot be read        springmass exits with 3
    |   |-- UnknownFormat    no family recognises the content
    |   `-- NeedsAnswer      the file lacks something that must not be guessed (rate, unit, channel)
    |-- SourceError          a source failed during delivery
    |-- SensorError          an unknown family of rangefinders, or an option that it does not have
    |-- PortError            a port that cannot be opened: absent, busy, no permission   springmass exits with 4
    `-- CalibrationError     numbers that cannot be a calibration

Every message is one line: ``where: what is wrong, got VALUE; what to do``.
"""

from __future__ import annotations

import unicodedata
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from acquisition.recordings.questions import Question

__all__ = [
    "AcquisitionError",
    "CalibrationError",
    "FormatError",
    "NeedsAnswer",
    "PortError",
    "SensorError",
    "SourceError",
    "UnknownFormat",
    "visible",
]


def visible(text: str) -> str:
    """Return a text on one line, with an escape for each character that a terminal or a page would not print.

    Titles, names and units come from files. An escape sequence in them could clear the screen or fake a line, and a
    direction mark could reverse a name.

    Examples
    --------
    >>> visible("Bob\\x1b[2J 3\\n")
    'Bob\\\\x1b[2J 3\\\\n'
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    # Other blanks are harmless and occur between a number and its unit.
    return character if unicodedata.category(character) == "Zs" else character.encode("unicode_escape").decode()


class AcquisitionError(Exception):
    """Base class of the errors of acquisition. The message is one line for the user."""


class FormatError(AcquisitionError):
    """A recording that cannot be read.

    Parameters
    ----------
    path : str
        The file.
    problem : str
        What is wrong: what was expected and what was found.
    remedy : str
        What the user can do.
    line : int, optional
        One-based line of the fault.
    """

    def __init__(self, path: str, problem: str, remedy: str, *, line: int | None = None) -> None:
        self.path, self.problem, self.remedy, self.line = path, problem, remedy, line
        where = path if line is None else f"{path}, line {line}"
        text = f"{problem} {remedy}" if problem.endswith("?") else f"{problem}; {remedy}"
        # Names and units come from the file and may contain line ends. The path comes from the user and stays as it is.
        super().__init__(f"{where}: {visible(text)}")

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.path, self.problem, self.remedy, line=self.line), (), self.__dict__


class UnknownFormat(FormatError):
    """No family of recordings recognises the content of the file."""


class NeedsAnswer(FormatError):
    """The file lacks something that is never guessed, so the user must state it.

    Parameters
    ----------
    question : Question
        What is missing, and every possible answer, as data.
    remedy : str, optional
        How the user gives the answer; by default the neutral wording of the question.
    line : int, optional
        One-based line that shows what is missing.
    """

    def __init__(self, question: Question, remedy: str = "", *, line: int | None = None) -> None:
        super().__init__(question.path, question.sentence, remedy or question.remedy, line=line)
        self.question = question

    def with_remedy(self, remedy: str) -> NeedsAnswer:
        """Return the same question with another remedy."""
        return NeedsAnswer(self.question, remedy, line=self.line)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.question, self.remedy, line=self.line), (), self.__dict__


class SourceError(AcquisitionError):
    """A source failed during delivery; the blocks before are valid."""


class SensorError(AcquisitionError):
    """An unknown family of rangefinders, or an option that it does not have."""


class PortError(AcquisitionError):
    """A port that cannot be opened, or that does not deliver the expected data."""


class CalibrationError(AcquisitionError):
    """Numbers that cannot be a calibration: too few distances, a bob that moves, a ruler in the wrong unit."""
