"""From the bytes of one port to blocks: decoder, timebase and calibration in a row.

Live view, recording, recovery and replay from wire bytes all use this one chain, so they cannot differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from acquisition.block import F8, I8, U8, Block, Flag
from acquisition.decoders.base import Family
from acquisition.live.calibration import Calibration
from acquisition.live.timebase import Timebase, steady_times
from acquisition.readings import NO_READINGS, Read, Reading, Readings
from acquisition.source import SourceInfo

__all__ = ["Chains", "SensorChain"]

MISSING, GAP_BEFORE = int(Flag.MISSING), np.uint8(Flag.GAP_BEFORE)
MANY = 32
"""So many readings or more become samples together."""
FEW = 4
"""So many reads or more are decoded together: what that takes to begin with costs as much as decoding two."""


class SensorChain:
    """One sensor's way from bytes to samples.

    Parameters
    ----------
    family : Family
    options : mapping, optional
        Of the family's decoder.
    rate_hz : float, optional
        Readings per second that this sensor is set to; left out, the family's.
    calibration : Calibration, optional
    """

    __slots__ = ("_breaks", "_held", "_next", "calibration", "decoder", "family", "last", "timebase")

    def __init__(
        self,
        family: Family,
        *,
        options: Mapping[str, Any] | None = None,
        rate_hz: float | None = None,
        calibration: Calibration | None = None,
    ) -> None:
        family.demand_options(options or {})
        self.family = family
        self.calibration = calibration or Calibration()
        self.decoder = family.decoder(**(options or {}))
        self.timebase = Timebase(rate_hz or family.rate_hz)
        self.last: Readings = NO_READINGS
        self._next = 0
        self._held: list[Reading] = []
        self._breaks: list[int] = []  # numbers among those held of readings before which the stream was broken off

    def __len__(self) -> int:
        """Return how many samples :meth:`block` would give."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Block:
        """Take the bytes of one read, return the samples they completed (perhaps none)."""
        self.take(host_ns, data)
        return self.block()

    def take(self, host_ns: int, data: bytes) -> int:
        """Take the bytes of one read, hold the readings they completed until :meth:`block`, and return how many.

        Notes
        -----
        Times and distances are found, and arrays made, once for many readings: that takes a third of the time.
        """
        readings = self.decode(host_ns, data)
        self._held += readings
        return len(readings)

    def decode(self, host_ns: int, data: bytes) -> Readings:
        """Take the bytes of one read, return the readings they completed, for which somebody else will ask samples."""
        self.last = readings = self.decoder.feed(host_ns, data)
        return readings

    def block(self) -> Block:
        """Return the samples of the readings held, with the next indices of the run, and hold none."""
        push, distance_of = self.timebase.push, self.calibration.distance
        rows = []
        for reading in self._held:
            time_s, flag = push(reading)
            distance_m = distance_of(reading.echo_us, reading.distance_m)
            rows.append((time_s, distance_m, flag if distance_m == distance_m else flag | MISSING, reading.host_ns))
        t, distance, flags, host_ns = zip(*rows, strict=True) if rows else ((),) * 4
        return self._block(
            np.array(t, np.float64),
            np.array(distance, np.float64),
            np.array(flags, np.uint8),
            np.array(host_ns, np.int64),
        )

    def _block(self, t: F8, distance: F8, flags: U8, host_ns: I8) -> Block:
        """Return the block of all that is held, and hold none."""
        if self._breaks:
            flags[[at for at in self._breaks if at < t.size]] |= GAP_BEFORE
            self._breaks = [0] if self._breaks[-1] == t.size else []
        first = self._next
        self._next += t.size
        self._held.clear()
        return Block(first, t, distance, flags, host_ns)

    def lost(self, held: int = 0) -> None:
        """The port went away: a frame cut in half by that is no frame, and the next sample is flagged.

        Parameters
        ----------
        held : int
            How many readings :meth:`decode` gave that are to become samples before.
        """
        self.decoder.flush()
        self._breaks.append(held + len(self._held))

    def info(self, name: str, kind: str = "live") -> SourceInfo:
        """Return what is known of the source; the clock's kind once a reading came."""
        if kind not in ("live", "simulated", "replay"):
            raise ValueError(f"kind must be live, simulated or replay, got {kind!r}")
        return SourceInfo(
            kind,  # type: ignore[arg-type]
            name,
            self.timebase.rate_hz,
            quantum_m=self.family.resolution_m,
            clock=self.timebase.clock,
        )

    def report(
        self, t: np.ndarray[Any, np.dtype[np.float64]], host_ns: np.ndarray[Any, np.dtype[np.int64]]
    ) -> dict[str, Any]:
        """Return faults, gaps and the clock's rate error as plain numbers, for the run's provenance."""
        from acquisition.live.timebase import fit_clock

        clock = fit_clock(t, host_ns)
        known = np.isfinite(clock.rate_error_ppm)
        return {
            "faults": dict(self.decoder.faults),
            "gaps": [{"index": g.index, "length_s": g.length_s, "lost": g.lost} for g in self.timebase.gaps],
            "restarts": self.timebase.restarts,
            "clock": {
                "kind": self.timebase.clock,
                "rate_error_ppm": clock.rate_error_ppm if known else None,
                "u_rate_error_ppm": clock.u_rate_error_ppm if known else None,
                "host_jitter_s": clock.jitter_s if known else None,
            },
        }


class Chains:
    """The chains of several sensors, fed with what was read of their ports.

    Parameters
    ----------
    chains : sequence of SensorChain
        By channel.

    Attributes
    ----------
    each : tuple of SensorChain

    Notes
    -----
    The readings of all sensors are held together, by columns, until their samples are asked for: many ports then cost
    no list each that has to be filled and emptied.
    """

    def __init__(self, chains: Sequence[SensorChain]) -> None:
        self.each = tuple(chains)
        self._decoders = [chain.decoder for chain in chains]
        kinds = {chain.family.whole for chain in chains}
        self._whole = kinds.pop() if len(kinds) == 1 else None
        self._channels: list[int] = []  # of the readings held
        self._columns: tuple[list[Any], ...] = tuple([] for _ in Reading._fields)

    def __len__(self) -> int:
        """Return how many samples :meth:`blocks` would give."""
        return len(self._channels)

    def take(self, reads: Sequence[Read]) -> None:
        """Take reads in their order, many at a time where each is a whole frame and the family can.

        A read without bytes tells that the port went away.
        """
        if self._whole is not None and len(reads) >= FEW:
            channels, stamps_ns, frames = zip(*reads, strict=True)
            columns = self._whole([self._decoders[channel] for channel in channels], stamps_ns, frames)
            if columns is not None:
                self._hold(channels, columns)
                return
        for channel, host_ns, data in reads:
            if not data:
                self.lost(channel)
            elif readings := self.each[channel].decode(host_ns, data):
                self._hold([channel] * len(readings), zip(*readings, strict=True))

    def lost(self, channel: int) -> None:
        """A port went away: a frame cut in half by that is no frame, and the next sample is flagged."""
        self.each[channel].lost(self._channels.count(channel))

    def _hold(self, channels: Sequence[int], columns: Iterable[Iterable[Any]]) -> None:
        self._channels += channels
        for held, column in zip(self._columns, columns, strict=True):
            held += column

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples held, by channel, of those sensors that have any."""
        if not self._channels:
            return []
        channels = np.fromiter(self._channels, np.int64, len(self))
        order = np.argsort(channels, kind="stable")
        every = np.bincount(channels)
        found = np.flatnonzero(every).tolist()
        chains, counts = [self.each[channel] for channel in found], every[found]
        ends = np.cumsum(counts).tolist()
        cuts = list(map(slice, [0, *ends], ends))
        together = self._together(order, chains, counts, cuts) if order.size >= MANY else [None] * len(found)
        blocks = []
        for channel, chain, cut, block in zip(found, chains, cuts, together, strict=True):
            if block is None:
                chain._held += [Reading(*(held[i] for held in self._columns)) for i in order[cut].tolist()]
            blocks.append((channel, chain.block() if block is None else block))
        for held in (self._channels, *self._columns):
            held.clear()
        return blocks

    def _together(
        self, order: I8, chains: Sequence[SensorChain], counts: I8, cuts: Sequence[slice]
    ) -> list[Block | None]:
        """Return the blocks of all sensors that are steady, None for the others."""
        stamps, _, clocks, echoes, stated, _ = self._columns
        host_ns, device_us = (np.fromiter(held, np.int64, order.size)[order] for held in (stamps, clocks))
        echo_us, distance_m = (np.fromiter(held, np.float64, order.size)[order] for held in (echoes, stated))
        t, steady = steady_times([chain.timebase for chain in chains], counts, host_ns, device_us)
        distance = Calibration.distances([chain.calibration for chain in chains], counts, echo_us, distance_m)
        flags = np.where(np.isnan(distance), np.uint8(MISSING), np.uint8(0))
        return [
            chain._block(t[cut], distance[cut], flags[cut], host_ns[cut]) if is_steady else None
            for chain, cut, is_steady in zip(chains, cuts, steady.tolist(), strict=True)
        ]
