"""What all decoders of lines or summed frames share: cut the stream, make a reading of each frame, count the rest."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from acquisition.decoders.lines import LineSplitter
from acquisition.decoders.sum_frames import SumFrames
from acquisition.readings import NO_READINGS, Reading, Readings

__all__ = ["FramedDecoder"]


class FramedDecoder(ABC):
    """A :class:`acquisition.decoders.family.Decoder` of frames; a family says in :meth:`reading` what one means.

    Parameters
    ----------
    frames : LineSplitter or SumFrames
        What cuts the stream.
    """

    def __init__(self, frames: LineSplitter | SumFrames) -> None:
        self._frames = frames

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what was no reading."""
        return MappingProxyType(self._frames.faults)

    @property
    def pending(self) -> int:
        """Bytes held until the frame they began is whole."""
        return self._frames.pending

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the readings whose frames these bytes complete, all stamped with the read that completed them."""
        found: list[Reading] = []
        self.extend(found, ((host_ns, data),))
        return Readings(found) if found else NO_READINGS

    def extend(self, found: list[Reading], reads: Iterable[tuple[int, bytes]]) -> None:
        """Append the readings of many reads, each of which has its own stamp."""
        split, reading = self._frames.split, self.reading
        for host_ns, data in reads:
            for frame in split(data):
                if (row := reading(host_ns, frame)) is not None:
                    found.append(row)

    def flush(self) -> None:
        """Forget a half-received frame."""
        self._frames.flush()

    @abstractmethod
    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return what a frame says; None where it says no distance, which :meth:`_count` counts if it should."""

    def _count(self, fault: str, garbage_bytes: int) -> None:
        """Count a fault, and the bytes that were part of no frame."""
        self._frames.faults[fault] += 1
        self._frames.faults["garbage_bytes"] += garbage_bytes
