"""Decode the records of a wire log into samples, with the same chains as the live view."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from acquisition.block import Block, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from storage.wire_log.log_header import event_content
from storage.wire_log.records import Kind, Record, SensorEntry

__all__ = ["BREAKS", "LogDecoder", "chains_of", "decode_log"]

BREAKS = frozenset({"lost", "reopened", "timeout", "overflow"})
"""Events that interrupt the bytes of a channel."""
HELD_READS = 4096
"""Number of reads decoded at a time; more would take more memory, fewer would give many small arrays."""
HELD_BYTES = 1 << 18
"""Number of bytes at which fewer reads are decoded, because a read may contain many readings."""


def chains_of(sensors: Sequence[SensorEntry]) -> list[SensorChain]:
    """Return the decoding chain of each sensor, with its calibration from the log.

    Raises
    ------
    acquisition.errors.AcquisitionError
        If a family does not exist or does not have an option.
    """
    return [
        SensorChain(
            get_family(sensor.family),
            options=sensor.options,
            rate_hz=sensor.rate_hz,
            calibration=Calibration.from_mapping(sensor.calibration) if sensor.calibration else None,
            clock_ppm=sensor.clock_ppm,
        )
        for sensor in sensors
    ]


class LogDecoder:
    """Decodes the records of a log into samples, piece by piece.

    If records are missing or a port was lost, no frame spans the gap, and the first sample after it is flagged.
    The channels of other sensors are skipped.

    Parameters
    ----------
    sensors : sequence of SensorEntry
    chains : sequence of SensorChain
        One for each sensor.
    noted : callable
        Called with every record that is not data.

    Attributes
    ----------
    reads : list of int
        Number of reads of each sensor's port so far.
    last_ns : int
        Host time of the log's last record in any channel, ns; set at the end.
    """

    def __init__(
        self,
        sensors: Sequence[SensorEntry],
        chains: Sequence[SensorChain],
        noted: Callable[[Record], object] = lambda _: None,
    ) -> None:
        self.sensors, self.chains, self._noted = tuple(sensors), tuple(chains), noted
        self.reads = [0] * len(self.sensors)
        self.last_ns = 0
        self._held: list[list[tuple[int, bytes]]] = [[] for _ in self.sensors]

    def blocks(self, log: Iterable[Record]) -> Iterator[tuple[int, Block]]:
        """Yield the index of a sensor and its samples, as they are decoded; a later call may pass more records."""
        places = {sensor.channel: (number, held) for number, (sensor, held) in enumerate(self._places())}
        size = mono_ns = 0
        for record in log:
            _, _, mono_ns, kind, channel, payload, lost_before = record
            if lost_before:
                for number in range(len(self.chains)):
                    self._break(number)
            place = places.get(channel)
            if kind is not Kind.DATA:
                self._noted(record)
                if place is not None and kind is Kind.EVENT and event_content(payload)["kind"] in BREAKS:
                    self._break(place[0])
            elif place is not None:
                place[1].append((mono_ns, payload))
                size += len(payload)
                if len(place[1]) >= HELD_READS or size >= HELD_BYTES:
                    size = 0
                    yield from self._samples()
        self.last_ns = mono_ns
        yield from self._samples()

    def _places(self) -> Iterator[tuple[SensorEntry, list[tuple[int, bytes]]]]:
        return zip(self.sensors, self._held, strict=True)

    def _break(self, number: int) -> None:
        self._hand_over(number)
        self.chains[number].lost()

    def _hand_over(self, number: int) -> None:
        held = self._held[number]
        self.chains[number].take_all(held)
        self.reads[number] += len(held)
        held.clear()

    def _samples(self) -> Iterator[tuple[int, Block]]:
        for number, chain in enumerate(self.chains):
            self._hand_over(number)
            if len(chain):
                yield number, chain.block()


def decode_log(
    log: Iterable[Record],
    sensors: Sequence[SensorEntry],
    chains_for: Callable[[Sequence[SensorEntry]], Sequence[SensorChain]] = chains_of,
) -> list[Block]:
    """Return all samples of each sensor as one block; see :class:`LogDecoder`."""
    decoder = LogDecoder(sensors, chains_for(sensors))
    blocks: list[list[Block]] = [[] for _ in sensors]
    for number, block in decoder.blocks(log):
        blocks[number].append(block)
    return [concatenate(each) for each in blocks]
