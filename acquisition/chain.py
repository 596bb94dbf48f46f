"""From the bytes of one port to blocks: decoder, timebase and calibration in a row.

Live view, recording, recovery and replay from wire bytes all use this one chain, so they cannot differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from acquisition.block import Block, Flag
from acquisition.calibration import Calibration
from acquisition.decoders.base import Family
from acquisition.readings import NO_READINGS, Readings
from acquisition.source import SourceInfo
from acquisition.timebase import Timebase

__all__ = ["SensorChain"]

MISSING, GAP_BEFORE = int(Flag.MISSING), int(Flag.GAP_BEFORE)


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

    __slots__ = ("_broken", "_held", "_next", "calibration", "decoder", "family", "last", "timebase")

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
        self._broken = False
        self._next = 0
        self._held: list[tuple[float, float, int, int]] = []

    def __len__(self) -> int:
        """Return how many samples :meth:`block` would give."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Block:
        """Take the bytes of one read, return the samples they completed (perhaps none)."""
        self.take(host_ns, data)
        return self.block()

    def take(self, host_ns: int, data: bytes) -> int:
        """Take the bytes of one read, hold the samples they completed until :meth:`block`, and return how many.

        Notes
        -----
        A sample is held as plain numbers: arrays are made once for many of them.
        """
        self.last = readings = self.decoder.feed(host_ns, data)
        for reading in readings:
            t, flag = self.timebase.push(reading)
            distance = self.calibration.distance(reading.echo_us, reading.distance_m)
            if distance != distance:
                flag |= MISSING
            if self._broken:
                flag |= GAP_BEFORE
                self._broken = False
            self._held.append((t, distance, flag, host_ns))
        return len(readings)

    def block(self) -> Block:
        """Return the samples held, with the next indices of the run, and hold none."""
        held, self._held = self._held, []
        first = self._next
        self._next += len(held)
        t, distance, flags, host_ns = zip(*held, strict=True) if held else ((),) * 4
        return Block(
            first,
            np.array(t, np.float64),
            np.array(distance, np.float64),
            np.array(flags, np.uint8),
            np.array(host_ns, np.int64),
        )

    def lost(self) -> None:
        """The port went away: a frame cut in half by that is no frame, and the next sample is flagged."""
        self.decoder.flush()
        self._broken = True

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
