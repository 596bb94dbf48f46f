"""A wire log read while it is written, as the page of a recording does: by a process of its own, from the file."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from storage.wire_log.records import Kind, Record
from storage.wire_log.scan import Scan
from storage.wire_log.scanning import NotALog, read_log
from storage.wire_log.window import Window

__all__ = ["LogFollower"]

AT_ONCE = 10_000
"""Records that one call returns at most, 100 s of a sensor at 100 Hz: a long log is shown a stretch at a time."""


class LogFollower:
    """Gives a growing log's records, each once.

    It only reads: whatever becomes of it, the recording goes on. A record counts when it is whole in the file, so the
    log has taken what it gives. Damage is passed over, as by every reader of a log.

    Parameters
    ----------
    path : Path
        The log's first file.

    Attributes
    ----------
    header : LogHeader
    ended : bool
        Whether the end record came.

    Raises
    ------
    NotALog
        If there is no log, or none with a header.
    """

    def __init__(self, path: Path) -> None:
        contents = read_log(path)
        header = contents.header
        if header is None:
            raise NotALog(path, "a log with a header was demanded, got none", "name the log of a recording")
        self.header = header
        self.ended = False
        self._window = Window(contents.parts, live=True)
        self._scan = Scan(self._window, contents.number())
        self._records = self._scan.records()

    def close(self) -> None:
        """Close the file; again does no harm."""
        self._window.close()

    def records(self) -> list[Record]:
        """Return the records that came since the last call, ten thousand at most, without the header and its copies.

        Raises
        ------
        NotALog
            If the log cannot be read any further.
        """
        came = list(islice(self._records, AT_ONCE))
        if len(came) < AT_ONCE:
            self._records = self._scan.records()
        self.ended = self._scan.damage().ended
        return [record for record in came if record.kind is not Kind.HEADER]
