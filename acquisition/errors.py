"""The error tree of acquisition.

::

    AcquisitionError
    |-- FormatError          a recording cannot be read        springmass exits with 3
    |   |-- UnknownFormat    no family recognises the content
    |   `-- NeedsAnswer      the file leaves something out that must not be guessed (rate, unit, channel)
    |-- SourceError          a source failed while it was delivering
    |-- SensorError          a family of rangefinders that is not known, or an option it does not take
    |-- PortError            a port that cannot be opened: absent, busy, no permission   springmass exits with 4
    `-- CalibrationError     numbers that calibrate nothing

Every message is one line: what was demanded, what was got, where, and what to do.
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
    """Return a text on one line with nothing hidden in it: what would steer a terminal or a page stands as an escape.

    Titles, names and units come out of files. An escape sequence among them could clear the screen or print a line of
    its own, and a mark of direction turn a name around.

    Examples
    --------
    >>> visible("Bob\\x1b[2J 3\\n")
    'Bob\\\\x1b[2J 3\\\\n'
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    # Blanks that are not the plain one hide nothing, and hold a number and its unit together.
    return character if unicodedata.category(character) == "Zs" else character.encode("unicode_escape").decode()


class AcquisitionError(Exception):
    """Anything that acquisition refuses; its text is a single line meant for the user."""


class FormatError(AcquisitionError):
    """A recording that cannot be read.

    Parameters
    ----------
    path : str
        The file.
    demand : str
        What was expected there and what was found instead.
    remedy : str
        What the user can do.
    line : int, optional
        One-based line of the offence.
    """

    def __init__(self, path: str, demand: str, remedy: str, *, line: int | None = None) -> None:
        self.path, self.demand, self.remedy, self.line = path, demand, remedy, line
        where = path if line is None else f"{path}, line {line}"
        said = f"{demand} {remedy}" if demand.endswith("?") else f"{demand}; {remedy}"
        # Names and units come out of the file, line ends and all. The path is the user's own and stays as it is.
        super().__init__(f"{where}: {visible(said)}")

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.path, self.demand, self.remedy, line=self.line), (), self.__dict__


class UnknownFormat(FormatError):
    """No family of recordings recognises the file's content."""


class NeedsAnswer(FormatError):
    """The file lacks something that is never guessed: the user must name it.

    Parameters
    ----------
    question : Question
        What is missing, and every answer that can be given, as data.
    remedy : str, optional
        How the user gives the answer, where somebody knows; left out, the question's own neutral words.
    line : int, optional
        One-based line that shows what is missing.
    """

    def __init__(self, question: Question, remedy: str = "", *, line: int | None = None) -> None:
        super().__init__(question.path, question.sentence, remedy or question.remedy, line=line)
        self.question = question

    def with_remedy(self, remedy: str) -> NeedsAnswer:
        """Return the same question with how the user answers it."""
        return NeedsAnswer(self.question, remedy, line=self.line)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.question, self.remedy, line=self.line), (), self.__dict__


class SourceError(AcquisitionError):
    """A source failed while it was delivering; what came before it stands."""


class SensorError(AcquisitionError):
    """A family of rangefinders that is not known, or an option that it does not take."""


class PortError(AcquisitionError):
    """A port that cannot be opened, or that does not carry what was expected."""


class CalibrationError(AcquisitionError):
    """Numbers that calibrate nothing: too few distances, a bob that moves, a ruler in the wrong unit."""
