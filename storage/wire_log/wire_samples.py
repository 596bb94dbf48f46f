"""From the records of a wire log to samples, through the chains that showed them live."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from acquisition.block import Block, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from storage.wire_log.records import Kind, Record, SensorEntry

__all__ = ["BREAKS", "Decoded", "chains_of", "decode_log"]

_DATA = Kind.DATA  # looked up once, and not for each record

BREAKS = frozenset({"lost", "reopened", "timeout", "overflow"})
"""Events after which the bytes of a channel do not continue those before."""
HELD_READS = 4096
"""Of so many reads samples are made at a time: a long run would be a heap of small arrays, or of readings."""


def chains_of(sensors: Sequence[SensorEntry]) -> list[SensorChain]:
    """Return the chains that the sensors' families name, with the calibrations noted in the log."""
    return [
        SensorChain(
            get_family(sensor.family),
            options=sensor.options,
            rate_hz=sensor.rate_hz,
            calibration=Calibration.from_mapping(sensor.calibration) if sensor.calibration else None,
        )
        for sensor in sensors
    ]


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """One sensor's samples.

    Parameters
    ----------
    sensor : SensorEntry
    chain : SensorChain
        As it stands after the last byte.
    samples : Block
        All of them, ``first`` = 0.
    reads : int
        Reads of the port that the log holds.
    """

    sensor: SensorEntry
    chain: SensorChain
    samples: Block
    reads: int


def decode_log(
    log: Iterable[Record],
    sensors: Sequence[SensorEntry],
    chains_for: Callable[[Sequence[SensorEntry]], Sequence[SensorChain]] = chains_of,
) -> tuple[Decoded, ...]:
    """Return every sensor's samples, in the order of ``sensors``; other channels are passed over.

    Where records are missing, or a port went away, no frame is put together across the gap, and the first sample
    after it is flagged.
    """
    ways = [_Way(chain) for chain in chains_for(sensors)]
    by_channel = {sensor.channel: way for sensor, way in zip(sensors, ways, strict=True)}
    for record in log:
        if record.lost_before:
            for way in ways:
                way.chain.lost()
        if (sensor_way := by_channel.get(record.channel)) is None:
            continue
        if record.kind is _DATA:
            sensor_way.take(record)
        elif record.kind is Kind.EVENT and record.json().get("kind") in BREAKS:
            sensor_way.chain.lost()
    return tuple(
        Decoded(sensor, way.chain, way.samples(), way.reads) for sensor, way in zip(sensors, ways, strict=True)
    )


class _Way:
    """One sensor's chain, and what came out of it so far."""

    def __init__(self, chain: SensorChain) -> None:
        self.chain = chain
        self.reads = 0
        self._blocks: list[Block] = []

    def take(self, record: Record) -> None:
        self.reads += 1
        self.chain.take(record.mono_ns, record.payload)
        if self.reads % HELD_READS == 0:
            self._blocks.append(self.chain.block())

    def samples(self) -> Block:
        return concatenate([*self._blocks, self.chain.block()])
