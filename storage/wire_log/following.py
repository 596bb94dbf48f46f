"""Read a wire log while another process writes it, as the page of a recording does."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from storage.wire_log.records import Kind, Record
from storage.wire_log.scan import Scan
from storage.wire_log.scanning import NotALog, read_log
from storage.wire_log.window import Window

__all__ = ["LogFollower"]

AT_ONCE = 10_000
"""Maximum number of records per call: 100 s of a sensor at 100 Hz. A long log is therefore shown piece by piece."""


class LogFollower:
    """Returns each record of a growing log once.

    It only reads, so a failure here does not affect the recording. A record is returned once it is complete in the
    file, and damage is skipped, as by every reader of a log.

    Parameters
    ----------
    path : Path
        The log's first file.

    Attributes
    ----------
    header : LogHeader
    ended : bool
        Whether the end record has been read.

    Raises
    ------
    NotALog
        If the log does not exist or has no header.
    """

    def __init__(self, path: Path) -> None:
        contents = read_log(path)
        header = contents.header
        if header is None:
            raise NotALog(path, "expected a wire log with a header, got none", "name the log of a recording")
        self.header = header
        self.ended = False
        self._window = Window(contents.parts, live=True)
        self._scan = Scan(self._window, contents.number())
        self._records = self._scan.records()

    def close(self) -> None:
        """Close the file. Further calls do nothing."""
        self._window.close()

    def records(self) -> list[Record]:
        """Return the new records since the last call, at most ten thousand, without the header and its copies.

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
