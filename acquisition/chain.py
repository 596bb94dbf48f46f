"""From the bytes of one port to blocks: decoder, timebase and calibration in a row.

Live view, recording, recovery and replay from wire bytes all use this one chain, so they cannot differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from acquisition.block import F8, I8, U8, Block, Flag
from acquisition.calibration import Calibration
from acquisition.decoders.base import Family
from acquisition.readings import NO_READINGS, Read, Reading, Readings
from acquisition.source import SourceInfo
from acquisition.timebase import Timebase, steady_times

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
        self.last = readings = self.decoder.feed(host_ns, data)
        self._held += readings
        return len(readings)

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

    def lost(self) -> None:
        """The port went away: a frame cut in half by that is no frame, and the next sample is flagged."""
        self.decoder.flush()
        self._breaks.append(len(self._held))

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
        from acquisition.timebase import fit_clock

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
    """

    def __init__(self, chains: Sequence[SensorChain]) -> None:
        self.each = tuple(chains)
        self._decoders = [chain.decoder for chain in chains]
        self._hold = [chain._held.append for chain in chains]
        kinds = {chain.family.whole for chain in chains}
        self._whole = kinds.pop() if len(kinds) == 1 else None

    def take(self, reads: Sequence[Read]) -> None:
        """Take reads in their order, many at a time where each is a whole frame and the family can.

        A read without bytes tells that the port went away.
        """
        if self._whole is not None and len(reads) >= FEW:
            channels, stamps_ns, frames = zip(*reads, strict=True)
            readings = self._whole([self._decoders[channel] for channel in channels], stamps_ns, frames)
            if readings is not None:
                for channel, reading in zip(channels, readings, strict=True):
                    self._hold[channel](reading)
                return
        for channel, host_ns, data in reads:
            if data:
                self.each[channel].take(host_ns, data)
            else:
                self.each[channel].lost()

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples held, by channel, of those sensors that have any."""
        found = [(channel, chain) for channel, chain in enumerate(self.each) if chain._held]
        counts = [len(chain._held) for _, chain in found]
        if sum(counts) < MANY:
            return [(channel, chain.block()) for channel, chain in found]
        chains = [chain for _, chain in found]
        readings = np.array(counts)
        held = [reading for chain in chains for reading in chain._held]
        host_ns, _, device_us, echo_us, distance_m, _ = zip(*held, strict=True)
        stamps_ns = np.array(host_ns)
        t, steady = steady_times([chain.timebase for chain in chains], readings, stamps_ns, np.array(device_us))
        distance = Calibration.distances(
            [chain.calibration for chain in chains], readings, np.array(echo_us), np.array(distance_m)
        )
        flags = np.where(np.isnan(distance), np.uint8(MISSING), np.uint8(0))
        blocks, end = [], 0
        for (channel, chain), count, is_steady in zip(found, counts, steady.tolist(), strict=True):
            start, end = end, end + count
            if is_steady:
                rows = slice(start, end)
                blocks.append((channel, chain._block(t[rows], distance[rows], flags[rows], stamps_ns[rows])))
            else:
                blocks.append((channel, chain.block()))
        return blocks
