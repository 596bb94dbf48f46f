"""An old recording as its format read it: samples, what was seen on the way, and the file's own bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from acquisition.block import Block
from acquisition.source import SourceInfo

__all__ = ["Original", "Recording", "Trap"]


@dataclass(frozen=True, slots=True)
class Original:
    """A file's own bytes, so that it can be given back bit for bit.

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
        import hashlib  # a twentieth of a cold start that does not ask for it

        return hashlib.sha256(self.data).hexdigest()


@dataclass(frozen=True, slots=True)
class Trap:
    """Something in the file that a careless reader would have got wrong.

    Parameters
    ----------
    code : str
        A finding code of the program where one fits ("truncated_row", "nominal_clock", ...), else a word.
    message : str
        One sentence that names what was seen and what was done about it.
    count : int
        How many rows or samples it concerns.
    line : int, optional
        One-based line of the first.
    """

    code: str
    message: str
    count: int = 1
    line: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A recording, read whole.

    Parameters
    ----------
    format : str
        Name of the family that read it, as in the registry.
    path : str
        Where it was read from.
    info : SourceInfo
        Rate, quantum, clock; ``kind`` is "replay" unless the file says that it was simulated.
    channel : str
        The quantity or column taken as distance.
    samples : Block
        All samples, ``first`` = 0. Nothing that was a row of data is missing here: what could not be read is
        flagged.
    traps : tuple of Trap
        What was seen on the way.
    malformed_rows : int
        Rows that were not samples at all (text in the middle, a truncated last row).
    originals : tuple of Original
        The bytes of the file, or of the two files of a position and velocity pair.
    title : str
        The file's own title line, if any.
    run : str
        Name of the run inside the file; empty where it holds one without a name.
    start_time : str
        ISO 8601, as the file states it; empty where it does not.
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
