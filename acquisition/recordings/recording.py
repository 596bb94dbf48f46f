"""The interface of a format of recordings, and a recording that it has read: samples, remarks, bytes of the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from acquisition.block import Block, SourceInfo
from acquisition.recordings.reading import READ_DEFAULTS, ReadOptions


@dataclass(frozen=True, slots=True)
class Original:
    """The name of a file without its folder, and its bytes, so that it can be restored bit for bit."""

    name: str
    data: bytes = field(repr=False)

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of the bytes."""
        import hashlib  # imported only here, because the import takes a twentieth of the start-up time

        return hashlib.sha256(self.data).hexdigest()


@dataclass(frozen=True, slots=True)
class FormatIssue:
    """A peculiarity of a file that is easy to misread; the analysis reports it as a finding.

    Parameters
    ----------
    code : str
        The code of the finding ("truncated_row", "nominal_clock", ...), or another word.
    message : str
        One sentence that states the peculiarity and how it was treated.
    count : int
        Number of rows or samples that are affected.
    line : int, optional
        One-based line number of the first affected row or sample.
    """

    code: str
    message: str
    count: int = 1
    line: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A recording that was read completely.

    Parameters
    ----------
    format : str
        Name of the family that read it, as in the registry.
    path : str
        The path of the file.
    info : SourceInfo
        Rate, quantum, clock; ``kind`` is "replay" unless the file states that it was simulated.
    channel : str
        The quantity or column whose values are the samples.
    samples : Block
        All samples, ``first`` = 0. Every row of data is a sample; samples that could not be read are flagged.
    traps : tuple of FormatIssue
        Remarks by the reader.
    malformed_rows : int
        Number of rows that could not be read (text between rows, a truncated last row), including those that are kept
        as missing samples.
    originals : tuple of Original
        The bytes of the file, or of the two files of a position and velocity pair.
    title : str
        The title line of the file, if any.
    run : str
        Name of the run inside the file; empty for a single run without a name.
    start_time : str
        Start time in ISO 8601 if the file states it; else empty.
    """

    format: str
    path: str
    info: SourceInfo
    channel: str
    samples: Block
    traps: tuple[FormatIssue, ...] = ()
    malformed_rows: int = 0
    originals: tuple[Original, ...] = ()
    title: str = ""
    run: str = ""
    start_time: str = ""


@runtime_checkable
class Format(Protocol):
    """A family of recordings. Files are identified by content, not by suffix."""

    @property
    def name(self) -> str:
        """Name in the registry and on the command line."""

    @property
    def title(self) -> str:
        """One line for the user."""

    def recognises(self, head: bytes) -> bool:
        """Return whether the first 8192 bytes of a file show that it belongs to this family.

        This must be fast and never raise.
        """

    def read(self, path: str, data: bytes, reading: ReadOptions = READ_DEFAULTS) -> Recording:
        """Read one channel of one run of a file, with what the user states about it."""


@dataclass(frozen=True, slots=True)
class Survey:
    """One channel of a file, as far as the file describes it.

    ``rate_hz`` and ``span_s`` (from the earliest to the latest sample) are None if they cannot be determined, for
    example because the user must give the rate.
    """

    run: str
    channel: str
    unit: str
    samples: int
    rate_hz: float | None
    traps: tuple[FormatIssue, ...]
    span_s: float | None = None


@runtime_checkable
class SurveyFormat(Protocol):
    """A family that states why it recognises a file and lists the channels of the file."""

    def evidence(self, head: bytes) -> str:
        """Return a few words on why a file belongs to this family, or an empty text if it does not."""

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
