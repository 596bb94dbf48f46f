"""The base class of decoders for lines or checksummed frames; it cuts the stream into frames and counts faults."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType

from acquisition.decoders.lines import LineSplitter
from acquisition.decoders.sum_frames import SumFrames
from acquisition.readings import NO_READINGS, Reading, Readings


class FramedDecoder(ABC):
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
