"""The exceptions of acquisition; every message is one line: ``where: what is wrong, got VALUE; what to do``."""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

from failure import Error

if TYPE_CHECKING:
    from acquisition.recordings.questions import Question


def visible(text: str) -> str:
    """Return a text as one line, with every unprintable character replaced by its escape sequence.

    Titles, names and units come from files. A control sequence in them could clear the screen or fake a line, and
    a direction mark could reverse a name.
    """
    # Space characters other than " " are harmless; some files have them between a number and its unit.
    shown = (c if c.isprintable() or unicodedata.category(c) == "Zs" else repr(c)[1:-1] for c in text)
    return text if text.isprintable() else "".join(shown)


class AcquisitionError(Error):
    """Base class of the errors of acquisition; its message is one line, written for the user."""


class FormatError(AcquisitionError):
    """A recording that cannot be read.

    Parameters
    ----------
    path : str
        Path of the file.
    problem : str
        The problem: what was expected and what was found.
    remedy : str
        What the user can do.
    line : int, optional
        Number of the faulty line, counted from 1.
    """

    def __init__(self, path: str, problem: str, remedy: str, *, line: int | None = None) -> None:
        # Names and units come from the file and may contain line ends. The path comes from the user and is not escaped.
        where = f"{path}: " if line is None else f"{path}, line {line}: "
        super().__init__(visible(problem), visible(remedy), where=where)
        self.path, self.line = path, line


class UnknownFormat(FormatError):
    """No family of recordings recognises the content of the file."""


class NeedsAnswer(FormatError):
    """The file lacks something that is never guessed, so the user must state it.

    Parameters
    ----------
    question : Question
        The missing information and its possible answers, as data.
    remedy : str, optional
        How the user can give the answer; by default the neutral wording of the question.
    line : int, optional
        Number of the line that shows what is missing, counted from 1.
    """

    between = " "

    def __init__(self, question: Question, remedy: str = "", *, line: int | None = None) -> None:
        super().__init__(question.path, question.sentence, remedy or question.remedy, line=line)
        self.question = question

    def with_remedy(self, remedy: str) -> NeedsAnswer:
        """Return an error with the same question and another remedy."""
        return NeedsAnswer(self.question, remedy, line=self.line)


class SensorError(AcquisitionError):
    """An unknown family of rangefinders, or an option that the family lacks."""


class PortError(AcquisitionError):
    """A port that cannot be opened, or that does not deliver the expected data."""


class CalibrationError(AcquisitionError):
    """Numbers that cannot be a calibration: too few distances, a bob that moves, a ruler in the wrong unit."""
