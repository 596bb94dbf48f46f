"""From the records of a wire log to samples, through the chains that showed them live."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Protocol

from acquisition.block import F8, I8, Block, concatenate
from acquisition.readings import Read
from acquisition.source import SourceInfo
from storage.wire_log.records import Kind, Record, SensorEntry

__all__ = ["BREAKS", "Chain", "Chains", "Decoded", "chains_of", "decode_log"]

BREAKS = frozenset({"lost", "reopened", "timeout", "overflow"})
"""Events after which the bytes of a channel do not continue those before."""
READS = 32
"""So many reads are decoded together: where one of them is no whole frame, few go one by one for it."""
HELD_READS = 4096
"""Of so many reads samples are made at a time: a long run would be a heap of small arrays, or of readings."""


class Chain(Protocol):
    """One sensor's way from bytes to samples, as far as it is asked after the last byte."""

    def info(self, name: str, kind: str = "live") -> SourceInfo:
        """Return what is known of the source once its samples came."""
        ...

    def report(self, t: F8, host_ns: I8) -> Mapping[str, Any]:
        """Return faults, gaps and the clock's rate error as plain numbers; "faults" maps names to counts."""
        ...


class Chains(Protocol):
    """The ways of several sensors; :class:`acquisition.live.decoding.Chains` are the real ones."""

    @property
    def each(self) -> Sequence[Chain]:
        """By number."""
        ...

    def take(self, reads: Sequence[Read]) -> None:
        """Take reads in their order, by the sensor's number; one without bytes breaks off what came before it."""
        ...

    def blocks(self) -> Iterable[tuple[int, Block]]:
        """Return the samples that came since the last call, by number."""
        ...


def chains_of(sensors: Sequence[SensorEntry]) -> Chains:
    """Return the chains that the sensors' families name, with the calibrations noted in the log."""
    from acquisition.decoders.registry import get_family
    from acquisition.live import decoding as chain
    from acquisition.live.calibration import Calibration

    return chain.Chains(
        [
            chain.SensorChain(
                get_family(sensor.family),
                options=sensor.options,
                rate_hz=sensor.rate_hz,
                calibration=Calibration.from_mapping(sensor.calibration) if sensor.calibration else None,
            )
            for sensor in sensors
        ]
    )


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """One sensor's samples.

    Parameters
    ----------
    sensor : SensorEntry
    chain : Chain
        As it stands after the last byte.
    samples : Block
        All of them, ``first`` = 0.
    reads : int
        Reads of the port that the log holds.
    """

    sensor: SensorEntry
    chain: Chain
    samples: Block
    reads: int


def decode_log(
    log: Iterable[Record],
    sensors: Sequence[SensorEntry],
    chains_for: Callable[[Sequence[SensorEntry]], Chains] = chains_of,
) -> tuple[Decoded, ...]:
    """Return every sensor's samples, in the order of ``sensors``; other channels are passed over.

    Where records are missing, or a port went away, no frame is put together across the gap, and the first sample
    after it is flagged.
    """
    chains = chains_for(sensors)
    counts = [0] * len(sensors)
    gathered: list[list[Block]] = [[] for _ in sensors]

    def gather() -> None:
        for number, block in chains.blocks():
            gathered[number].append(block)

    reads = _reads(log, {sensor.channel: number for number, sensor in enumerate(sensors)}, counts)
    held = 0
    while piece := list(islice(reads, READS)):
        chains.take(piece)
        held += len(piece)
        if held >= HELD_READS:
            gather()
            held = 0
    gather()
    return tuple(
        Decoded(sensor, chain, concatenate(blocks), count)
        for sensor, chain, blocks, count in zip(sensors, chains.each, gathered, counts, strict=True)
    )


def _reads(log: Iterable[Record], numbers: Mapping[int, int], counts: list[int]) -> Iterator[Read]:
    """Yield what was read of the sensors, by number, count it, and tell of every break by a read without bytes."""
    for record in log:
        if record.lost_before:
            for number in numbers.values():
                yield number, record.mono_ns, b""
        if record.channel not in numbers:
            continue
        number = numbers[record.channel]
        if record.kind is Kind.DATA:
            counts[number] += 1
            if record.payload:
                yield number, record.mono_ns, record.payload
        elif record.kind is Kind.EVENT and record.json().get("kind") in BREAKS:
            yield number, record.mono_ns, b""
