"""Read wire logs: return every valid record, even of a badly damaged file, and count the missing records.

Damage to a file raises no error. After damage the reader continues at the next magic whose record has a correct
checksum, the number of the log and an increasing sequence number. The bytes between are counted, never interpreted.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from storage.schema import ValueRefused
from storage.wire_log.records import HEAD_BYTES, Kind, LogHeader, Record
from storage.wire_log.scan import Damage, Scan
from storage.wire_log.window import LogPart, NotALog, TakeBytes, Window

__all__ = ["Damage", "LogContents", "NotALog", "Record", "parse_log", "read_log"]


class LogContents:
    """The records of a log. Every iteration reads the log again, with memory that does not grow with the log.

    Parameters
    ----------
    path : Path
        Name of the log in messages.
    parts : sequence of LogPart
        The files of the log, in order, each with its size at the time of opening.
    """

    def __init__(self, path: Path, parts: Sequence[LogPart]) -> None:
        self.path = path
        self.parts = tuple(parts)
        self._damage: Damage | None = None

    @property
    def size(self) -> int:
        """Total size of all parts, bytes."""
        return sum(part.size for part in self.parts)

    def __iter__(self) -> Iterator[Record]:
        return self.records()

    def records(self, take_bytes: TakeBytes = lambda *_: None) -> Iterator[Record]:
        """Yield the records in order.

        Parameters
        ----------
        take_bytes : callable
            Called with the number of the part and the bytes of the log, in order, as they are read. A copy made from
            these calls contains exactly the bytes that were decoded.

        Raises
        ------
        NotALog
            If a file can no longer be read.
        """
        with contextlib.closing(Window(self.parts, take_bytes)) as window:
            scan = Scan(window, self.number())
            yield from scan.records()
        self._damage = scan.damage()

    def number(self) -> int | None:
        """Return the log number of the first record, which was on the disk before the run began.

        If that record is lost, return the most frequent number of the first thousand valid records. The first of them
        alone may come from a device's data or from an old log whose disk blocks reappeared. Return None if there is no
        valid record.
        """
        with contextlib.closing(Window(self.parts)) as window:
            if (first := window.record(None)) is not None:
                return first[2]
            numbers: Counter[int] = Counter()
            while numbers.total() < 1000:
                if (record := window.record(None)) is not None:
                    numbers.update([record[2]])
                    window.at += HEAD_BYTES + len(record[-1])
                elif not window.seek(None):
                    break
        return numbers.most_common(1)[0][0] if numbers else None

    @property
    def damage(self) -> Damage:
        """The damage found by the last complete iteration; if there was none, the log is read first."""
        if self._damage is None:
            for _ in self:
                pass
        assert self._damage is not None
        return self._damage

    @property
    def header(self) -> LogHeader | None:
        """The first header; None if every copy is lost.

        Raises
        ------
        NotALog
            If the header has a value that is not allowed.
        """
        for record in self:
            if record.kind is Kind.HEADER:
                try:
                    return LogHeader.decode(record.payload)
                except ValueRefused as error:
                    raise NotALog(
                        self.path, str(error), "springmass does not write such logs; ask where it comes from"
                    ) from error
        return None


def read_log(path: str | os.PathLike[str]) -> LogContents:
    """Open a log, whether finished, damaged or still being written.

    Version 0.1.0 continued a log in further files, ``run.001.wire`` and so on. They are read with the first file. A
    file with such a name but the records of another log is ignored.

    Parameters
    ----------
    path : str or PathLike
        The first file of the log.

    Returns
    -------
    LogContents
        The records of the file; a file that is not a log has none.

    Raises
    ------
    NotALog
        If the file cannot be read.
    """
    path = Path(path)
    first = LogContents(path, [LogPart.at(path)])
    further = [LogPart.at(path_of_part) for path_of_part in _further(path)]
    if not further:
        return first
    numbers = [LogContents(part.path, [part]).number() for part in further]
    log = next((number for number in (first.number(), *numbers) if number is not None), None)
    matching = [part for part, number in zip(further, numbers, strict=True) if number in (log, None)]
    return LogContents(path, [*first.parts, *matching])


def _further(path: Path) -> list[Path]:
    """Return the files next to a log whose names are those of its further parts, in order."""
    form = re.compile(re.escape(path.stem) + r"\.([0-9]{3,9})" + re.escape(path.suffix))
    try:
        names = os.listdir(path.absolute().parent)
    except OSError:  # a folder whose files can be opened but not listed
        tried = (path.with_name(f"{path.stem}.{number:03d}{path.suffix}") for number in itertools.count(1))
        return list(itertools.takewhile(Path.exists, tried))
    numbered = [(int(match[1]), name) for name in names if (match := form.fullmatch(name))]
    return [path.with_name(name) for _, name in sorted(numbered)]


def parse_log(data: bytes, path: str | os.PathLike[str] = "log") -> LogContents:
    """Read a log from memory; ``path`` is its name in messages."""
    return LogContents(Path(path), [LogPart(Path(path), len(data), lambda: io.BytesIO(data))])
