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

__all__ = [
    "AcquisitionError",
    "CalibrationError",
    "FormatError",
    "NeedsAnswer",
    "PortError",
    "SensorError",
    "SourceError",
    "UnknownFormat",
]


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
        said = f"{demand}; {remedy}"
        # Names and units come out of the file, line ends and all. The path is the user's own and stays as it is.
        said = said if said.isprintable() else "".join(c if c.isprintable() else "\ufffd" for c in said)
        super().__init__(f"{where}: {said}")


class UnknownFormat(FormatError):
    """No family of recordings recognises the file's content."""


class NeedsAnswer(FormatError):
    """The file lacks something that is never guessed: the user must name it."""


class SourceError(AcquisitionError):
    """A source failed while it was delivering; what came before it stands."""


class SensorError(AcquisitionError):
    """A family of rangefinders that is not known, or an option that it does not take."""


class PortError(AcquisitionError):
    """A port that cannot be opened, or that does not carry what was expected."""


class CalibrationError(AcquisitionError):
    """Numbers that calibrate nothing: too few distances, a bob that moves, a ruler in the wrong unit."""
