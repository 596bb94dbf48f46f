"""From the records of a wire log to samples, through the chain that showed them live."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from acquisition.block import F8, I8, Block, Flag, concatenate
from acquisition.source import SourceInfo
from storage.wire_layout import Kind, Record, SensorEntry

__all__ = ["BREAKS", "Chain", "Decoded", "chain_of", "decode_log"]

BREAKS = frozenset({"lost", "reopened", "timeout", "overflow"})
"""Events after which the bytes of a channel do not continue those before."""


class Chain(Protocol):
    """One sensor's way from bytes to samples; :class:`acquisition.chain.SensorChain` is the real one."""

    def feed(self, host_ns: int, data: bytes) -> Block:
        """Take the bytes of one read, return the samples they completed (perhaps none)."""
        ...

    def lost(self) -> None:
        """Forget a half-received frame: what comes next does not continue it."""
        ...

    def info(self, name: str, kind: str = "live") -> SourceInfo:
        """Return what is known of the source once its samples came."""
        ...

    def report(self, t: F8, host_ns: I8) -> Mapping[str, Any]:
        """Return faults, gaps and the clock's rate error as plain numbers; "faults" maps names to counts."""
        ...


def chain_of(sensor: SensorEntry) -> Chain:
    """Return the chain that the sensor's family names, with the calibration noted in the log."""
    from acquisition.calibration import Calibration
    from acquisition.chain import SensorChain
    from acquisition.decoders.registry import get_family

    calibration = Calibration.from_mapping(sensor.calibration) if sensor.calibration else None
    family = get_family(sensor.family)
    return SensorChain(family, options=sensor.options, rate_hz=sensor.rate_hz, calibration=calibration)


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


@dataclass(slots=True)
class _Gathered:
    """Samples on their way: small blocks are joined by the thousand, or a long run would hold millions of them."""

    small: list[Block] = field(default_factory=list)
    large: list[Block] = field(default_factory=list)
    reads: int = 0
    broken: bool = False

    def add(self, block: Block) -> None:
        if not len(block):
            return
        if self.broken:
            flags = block.flags.copy()
            flags[0] |= np.uint8(Flag.GAP_BEFORE)
            block = dataclasses.replace(block, flags=flags)
            self.broken = False
        self.small.append(block)
        if len(self.small) == 4096:
            self.large.append(concatenate(self.small))
            self.small.clear()

    def whole(self) -> Block:
        return concatenate([*self.large, *self.small])


def decode_log(
    log: Iterable[Record],
    sensors: Sequence[SensorEntry],
    chain_for: Callable[[SensorEntry], Chain] = chain_of,
) -> tuple[Decoded, ...]:
    """Return every sensor's samples, in the order of ``sensors``; other channels are passed over.

    Where records are missing, or a port went away, no frame is put together across the gap, and the first sample
    after it is flagged.
    """
    chains = {sensor.channel: chain_for(sensor) for sensor in sensors}
    gathered = {channel: _Gathered() for channel in chains}

    def break_off(channels: Iterable[int]) -> None:
        for channel in channels:
            chains[channel].lost()
            gathered[channel].broken = True

    for record in log:
        if record.lost_before:
            break_off(chains)
        if record.channel not in chains:
            continue
        if record.kind is Kind.EVENT and record.json().get("kind") in BREAKS:
            break_off([record.channel])
        if record.kind is Kind.DATA:
            gathered[record.channel].reads += 1
            gathered[record.channel].add(chains[record.channel].feed(record.mono_ns, record.payload))
    return tuple(
        Decoded(sensor, chains[sensor.channel], gathered[sensor.channel].whole(), gathered[sensor.channel].reads)
        for sensor in sensors
    )
