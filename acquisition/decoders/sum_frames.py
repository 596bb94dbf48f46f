"""Find frames of fixed size that begin with a known byte and end with the sum of all preceding bytes."""

from __future__ import annotations

from collections.abc import Callable


def with_sum(body: bytes) -> bytes:
    """Return a frame that consists of the body and the low eight bits of its sum.

    Examples
    --------
    >>> with_sum(b"\\xff\\x07\\xa1").hex(" ")
    'ff 07 a1 a7'
    """
    return body + bytes([sum(body) & 0xFF])


class SumFrames:
    """Cuts a stream into frames, byte by byte from the left; the boundaries of reads do not affect the frames.

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
    """

    def __init__(self, size: int, starts: bytes, plausible: Callable[[bytes], bool]) -> None:
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
        size, starts, plausible = self._size, self._starts, self._plausible
        frames: list[bytes] = []
        at, last, bad_sum, bad_frame = 0, len(data) - size, 0, 0
        while at <= last:
            if data[at] in starts:
                frame = data[at : at + size]
                if (sum(frame) - frame[-1]) & 0xFF != frame[-1]:
                    bad_sum += 1
                elif not plausible(frame):
                    bad_frame += 1
                else:
                    frames.append(frame)
                    at += size
                    continue
            at += 1
        self._held = data[at:]
        faults = self.faults
        faults["garbage_bytes"] += at - size * len(frames)
        faults["bad_checksum"] += bad_sum
        faults["bad_frame"] += bad_frame
        return frames

    def flush(self) -> None:
        """Discard an incomplete frame."""
        self.faults["garbage_bytes"] += len(self._held)
        self._held = b""
