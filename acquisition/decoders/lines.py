"""Cut a stream into lines with bounded memory; the boundaries of reads do not affect the lines."""

from __future__ import annotations


class LineSplitter:
    """Returns complete lines and keeps an incomplete one until its end arrives.

    Parameters
    ----------
    end : bytes
        The byte that ends a line.
    limit : int
        Maximum length of a line without its end, bytes. A longer line is dropped and counted as ``bad_frame``.
    faults : dict of str to int
        Counts of faults, which this object increases; ``garbage_bytes`` counts the bytes outside of frames.
    skip_first : bool
        Whether the first line after the start or after a flush is dropped and counted as ``partial_line``. Reading may
        have begun in the middle of that line, and a part of a number looks like a number.
    """

    def __init__(self, end: bytes, limit: int, faults: dict[str, int], *, skip_first: bool = False) -> None:
        self._end = end
        self._limit = limit
        self.faults = faults
        self._skip_first = skip_first
        self._skip = skip_first
        self._overlong = False
        self._held = b""

    @property
    def pending(self) -> int:
        """Number of bytes of the incomplete line."""
        return len(self._held)

    def split(self, data: bytes) -> list[bytes]:
        """Return the lines that the bytes complete, without their line ends."""
        if self._held:
            data = self._held + data
        lines = data.split(self._end)
        self._held = lines.pop()
        if len(data) <= self._limit and not (self._skip or self._overlong):
            return lines  # no line can be too long
        if lines and (self._skip or self._overlong):
            self._drop(lines.pop(0), "partial_line" if self._skip else "bad_frame")
            self._skip = self._overlong = False
        if self._overlong or len(self._held) > self._limit:
            self.faults["garbage_bytes"] += len(self._held)
            self._held = b""
            self._overlong = True
        for line in lines:
            if len(line) > self._limit:
                self._drop(line, "bad_frame")
        return [line for line in lines if len(line) <= self._limit]

    def flush(self) -> None:
        """Discard the incomplete line."""
        if self._held or self._overlong:
            self.faults["garbage_bytes"] += len(self._held)
            self.faults["bad_frame"] += 1
        self._held = b""
        self._overlong = False
        self._skip = self._skip_first

    def _drop(self, line: bytes, why: str) -> None:
        self.faults["garbage_bytes"] += len(line) + 1
        self.faults[why] += 1
