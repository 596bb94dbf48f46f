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
    chains = {sensor.channel: chain for sensor, chain in zip(sensors, chains_for(sensors), strict=True)}
    blocks: dict[int, list[Block]] = {channel: [] for channel in chains}
    reads = dict.fromkeys(chains, 0)
    for record in log:
        if record.lost_before:
            for each in chains.values():
                each.lost()
        channel = record.channel
        if (chain := chains.get(channel)) is None:
            continue
        if record.kind is _DATA:
            chain.take(record.mono_ns, record.payload)
            reads[channel] += 1
            if reads[channel] % HELD_READS == 0:
                blocks[channel].append(chain.block())
        elif record.kind is Kind.EVENT and record.json().get("kind") in BREAKS:
            chain.lost()
    return tuple(
        Decoded(sensor, chain, concatenate([*blocks[sensor.channel], chain.block()]), reads[sensor.channel])
        for sensor, chain in zip(sensors, chains.values(), strict=True)
    )
