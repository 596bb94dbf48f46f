"""Cut the bytes of a port into lines or checksummed frames; the boundaries of reads do not affect them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from types import MappingProxyType

from acquisition.decoders.decoder import Decoder
from acquisition.readings import NO_READINGS, Reading, Readings


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
    other_ends : tuple of bytes
        Ends of which one is used instead if three of it come before the first ``end``.
    """

    def __init__(
        self,
        end: bytes,
        limit: int,
        faults: dict[str, int],
        *,
        skip_first: bool = False,
        other_ends: tuple[bytes, ...] = (),
    ) -> None:
        self._end = end
        self._other_ends = other_ends
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
        if self._other_ends:
            self._choose_end(data)
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

    def _choose_end(self, data: bytes) -> None:
        head, end, _ = data.partition(self._end)
        for other in self._other_ends:
            if head.count(other) >= 3:
                self._end, end = other, other
                break
        if end or self._overlong:
            self._other_ends = ()

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


def with_sum(body: bytes) -> bytes:
    """Return a frame that consists of the body and the low eight bits of its sum.

    Examples
    --------
    >>> with_sum(b"\\xff\\x07\\xa1").hex(" ")
    'ff 07 a1 a7'
    """
    return body + bytes([sum(body) & 0xFF])


class SumFrames:
    """Cuts a stream into frames that begin with a known byte and end with the sum of all bytes before.

    After an invalid frame the search continues at its second byte. So an incomplete frame causes the loss of itself and
    of at most the next frame.

    Parameters
    ----------
    size : int
        Size of a frame, bytes.
    starts : bytes
        Possible first bytes of a frame.
    plausible : callable
        Returns whether the sensor can send a frame whose sum is correct. One wrong frame in 256 has a correct eight-bit
        sum, and a constant distance can repeat it forever. This check keeps the decoder from staying misaligned.
    unsummed : tuple of int
        Possible numbers of first bytes that the sum leaves out. The first one is assumed until three frames, with no
        valid one between them, would be valid with another number.
    """

    def __init__(
        self, size: int, starts: bytes, plausible: Callable[[bytes], bool], unsummed: tuple[int, ...] = (0,)
    ) -> None:
        self._unsummed, self._left_out, self._otherwise = unsummed, unsummed[0], 0
        self._size = size
        self._starts = starts
        self._plausible = plausible
        self._held = b""
        self.faults = {"garbage_bytes": 0, "bad_checksum": 0, "bad_frame": 0}

    @property
    def pending(self) -> int:
        """Number of bytes of an incomplete frame."""
        return len(self._held)

    def split(self, data: bytes) -> list[bytes]:
        """Return the frames that the bytes complete."""
        data = self._held + data
        size, faults = self._size, self.faults
        frames: list[bytes] = []
        at = 0
        while at <= len(data) - size:
            if data[at] in self._starts:
                frame = data[at : at + size]
                if not self._sums_up(frame):
                    faults["bad_checksum"] += 1
                elif not self._plausible(frame):
                    faults["bad_frame"] += 1
                else:
                    frames.append(frame)
                    at += size
                    continue
            at += 1
        self._held = data[at:]
        faults["garbage_bytes"] += at - size * len(frames)
        return frames

    def _sums_up(self, frame: bytes) -> bool:
        """Return whether a frame ends in its sum; learn how many bytes the sum leaves out."""
        if sum(frame[self._left_out : -1]) & 0xFF == frame[-1]:
            self._otherwise = 0
            return True
        for number in self._unsummed:
            if sum(frame[number:-1]) & 0xFF == frame[-1] and self._plausible(frame):
                self._otherwise += 1
                if self._otherwise == 3:
                    self._left_out = number
                    return True
        return False

    def flush(self) -> None:
        """Discard an incomplete frame."""
        self.faults["garbage_bytes"] += len(self._held)
        self._held = b""


class FramedDecoder(Decoder):
    """A :class:`springmass.extend.Decoder` of frames; each family implements :meth:`reading`.

    Parameters
    ----------
    frames : LineSplitter or SumFrames
        Cuts the stream into frames.
    """

    def __init__(self, frames: LineSplitter | SumFrames) -> None:
        self._frames = frames

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of faults, by name."""
        return MappingProxyType(self._frames.faults)

    @property
    def pending(self) -> int:
        """Number of bytes of an incomplete frame."""
        return self._frames.pending

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the readings of the frames that the bytes complete, each with the host time of this read."""
        readings = [row for frame in self._frames.split(data) if (row := self.reading(host_ns, frame)) is not None]
        return Readings(readings) if readings else NO_READINGS

    def flush(self) -> None:
        """Discard an incomplete frame."""
        self._frames.flush()

    @abstractmethod
    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a frame, or None; count the fault of an invalid frame with :meth:`_count`."""

    def _count(self, fault: str, garbage_bytes: int) -> None:
        """Count one fault, and the number of bytes outside of frames that it caused."""
        self._frames.faults[fault] += 1
        self._frames.faults["garbage_bytes"] += garbage_bytes
