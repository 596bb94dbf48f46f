"""A recording read by its format: its samples, the reader's remarks, and the bytes of the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from acquisition.block import Block
from acquisition.source import SourceInfo


@dataclass(frozen=True, slots=True)
class Original:
    """The bytes of a file, so that it can be restored bit for bit.

    Parameters
    ----------
    name : str
        The file's name without its folder.
    data : bytes
        Its content.
    """

    name: str
    data: bytes = field(repr=False)

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of the bytes."""
        import hashlib  # imported only here, because the import takes a twentieth of the start-up time

        return hashlib.sha256(self.data).hexdigest()


@dataclass(frozen=True, slots=True)
class Trap:
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
    traps : tuple of Trap
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
    traps: tuple[Trap, ...] = ()
    malformed_rows: int = 0
    originals: tuple[Original, ...] = ()
    title: str = ""
    run: str = ""
    start_time: str = ""

    def blocks(self, size: int = 1024) -> Iterator[Block]:
        """Yield the samples in blocks of at most ``size``."""
        for start in range(0, len(self.samples), size):
            yield self.samples[start : start + size]
