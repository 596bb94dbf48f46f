"""Reading wire logs: every sound record, whatever happened to the file around it, and what is missing.

Nothing that a file holds raises. After damage the reader is back in step at the next magic whose record has a true
checksum, the log's own number and a sequence number that goes forward; what lies between is counted, never guessed.
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
from storage.wire_log.window import LogPart, NotALog, Taken, Window

__all__ = ["Damage", "LogContents", "NotALog", "Record", "parse_log", "read_log"]


class LogContents:
    """A log's records, found anew at every iteration, in memory that does not grow with the log.

    Parameters
    ----------
    path : Path
        For messages.
    parts : sequence of LogPart
        Its files, in order; as much of each as there was when it was opened.
    """

    def __init__(self, path: Path, parts: Sequence[LogPart]) -> None:
        self.path = path
        self.parts = tuple(parts)
        self._damage: Damage | None = None

    @property
    def size(self) -> int:
        """Bytes of all parts."""
        return sum(part.size for part in self.parts)

    def __iter__(self) -> Iterator[Record]:
        return self.records()

    def records(self, taken: Taken = lambda *_: None) -> Iterator[Record]:
        """Yield the records, one after the other.

        Parameters
        ----------
        taken : callable
            Given every byte of the log once, in order, as it is read, with the number of its part: what is kept of a
            log is then what was decoded.

        Raises
        ------
        NotALog
            If a file cannot be read any more.
        """
        with contextlib.closing(Window(self.parts, taken)) as window:
            scan = Scan(window, self.number())
            yield from scan.records()
        self._damage = scan.damage()

    def number(self) -> int | None:
        """Return the number of the log: that of its first record, which was on the disk before the run began.

        Where that is lost, most of the sound records decide: the first of them may be one that a device sent, or one
        of an old log whose blocks show through. None where there are none.
        """
        with contextlib.closing(Window(self.parts)) as window:
            if (first := window.record(None)) is not None:
                return first[2]
            numbers: Counter[int] = Counter()
            while numbers.total() < 1000:
                if (found := window.record(None)) is not None:
                    numbers.update([found[2]])
                    window.at += HEAD_BYTES + len(found[-1])
                elif not window.seek(None):
                    break
        return numbers.most_common(1)[0][0] if numbers else None

    @property
    def damage(self) -> Damage:
        """What is missing, of the last iteration that came to the end; reads the log where there was none."""
        if self._damage is None:
            for _ in self:
                pass
        assert self._damage is not None
        return self._damage

    @property
    def header(self) -> LogHeader | None:
        """The first header; None where every copy is lost.

        Raises
        ------
        NotALog
            If it says what no header may say.
        """
        for record in self:
            if record.kind is Kind.HEADER:
                try:
                    return LogHeader.decode(record.payload)
                except ValueRefused as error:
                    raise NotALog(
                        self.path, str(error), "springmass writes no such log; ask where it comes from"
                    ) from error
        return None


def read_log(path: str | os.PathLike[str]) -> LogContents:
    """Open a log, finished, torn or still being written.

    Version 0.1.0 went on in further files, ``run.001.wire`` and so on, each a stretch of the same log. They are read
    with the first; a file of such a name that holds records of another log is none of it.

    Parameters
    ----------
    path : str or PathLike
        The log, its first file.

    Returns
    -------
    LogContents
        Of any file whatever; one that is no log has no records.

    Raises
    ------
    NotALog
        If there is no file that can be read.
    """
    path = Path(path)
    first = LogContents(path, [LogPart.at(path)])
    others = [LogPart.at(other) for other in _further(path)]
    if not others:
        return first
    numbers = [LogContents(part.path, [part]).number() for part in others]
    log = next((number for number in (first.number(), *numbers) if number is not None), None)
    mine = [part for part, number in zip(others, numbers, strict=True) if number in (log, None)]
    return LogContents(path, [*first.parts, *mine])


def _further(path: Path) -> list[Path]:
    """Return the files beside a log that have the names of its further parts, in order."""
    form = re.compile(re.escape(path.stem) + r"\.([0-9]{3,9})" + re.escape(path.suffix))
    try:
        names = os.listdir(path.absolute().parent)
    except OSError:  # a folder whose files may be read and not listed
        tried = (path.with_name(f"{path.stem}.{number:03d}{path.suffix}") for number in itertools.count(1))
        return list(itertools.takewhile(Path.exists, tried))
    numbered = [(int(match[1]), name) for name in names if (match := form.fullmatch(name))]
    return [path.with_name(name) for _, name in sorted(numbered)]


def parse_log(data: bytes, path: str | os.PathLike[str] = "log") -> LogContents:
    """Read a log from memory; ``path`` is what messages call it."""
    return LogContents(Path(path), [LogPart(Path(path), len(data), lambda: io.BytesIO(data))])
