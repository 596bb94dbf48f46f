"""From the bytes of one port to blocks: decoder, timebase and calibration in a row.

Live view, recording, recovery and replay from wire bytes all use this one chain, so they cannot differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from acquisition.block import F8, Block, Flag
from acquisition.decoders.family import Family, Told
from acquisition.decoders.framed import FramedDecoder
from acquisition.live.calibration import Calibration
from acquisition.live.clock_fit import COUNTER_PPM, ClockSamples, fit_clock
from acquisition.live.timebase import Timebase, demand_within
from acquisition.readings import NO_READINGS, Reading, Readings, carried
from acquisition.source import SourceInfo

__all__ = ["SensorChain"]

_NONE: tuple[tuple[float, ...], ...] = ((),) * len(Reading._fields)
CLOCKS_PPM = (0.0, 1e6)
"""What anybody may say of a clock: from one that is right to one that may stand still."""
MISSING, GAP_BEFORE = np.uint8(Flag.MISSING), np.uint8(Flag.GAP_BEFORE)


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
    clock_ppm : float, optional
        What its clock may be off at most, ppm; left out, the family's, or a counter's 100 000.

    Raises
    ------
    SensorError
        If an option, the rate or the clock is none that a sensor can have.
    """

    def __init__(
        self,
        family: Family,
        *,
        options: Mapping[str, Any] | None = None,
        rate_hz: float | None = None,
        calibration: Calibration | None = None,
        clock_ppm: float | None = None,
    ) -> None:
        family.demand_options(options or {})
        self.family = family
        self.calibration = calibration or Calibration()
        self.decoder = family.decoder(**(options or {}))
        self.timebase = Timebase(family.rate_hz if rate_hz is None else rate_hz)
        if clock_ppm is not None:
            demand_within("clock_ppm", clock_ppm, *CLOCKS_PPM)
        self._clock_ppm = clock_ppm
        self.last: Readings = NO_READINGS
        self._next = 0
        self._way_s = 0.0  # of the last sound from the sensor to what it met
        self._clock = ClockSamples()
        self._at_reflection = False
        self._held: list[Reading] = []
        self._breaks: list[int] = []  # numbers among those held of readings before which the stream was broken off

    def __len__(self) -> int:
        """Return how many samples :meth:`block` would give."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Block:
        """Take the bytes of one read, return the samples they completed (perhaps none)."""
        self.take(host_ns, data)
        return self.block()

    def take(self, host_ns: int, data: bytes) -> None:
        """Take the bytes of one read, and hold the readings they completed until :meth:`block`.

        Notes
        -----
        Times and distances are found, and arrays made, once for many readings: that takes a third of the time.
        """
        self.last = readings = self.decoder.feed(host_ns, data)
        self._held += readings

    def take_all(self, reads: Iterable[tuple[int, bytes]]) -> None:
        """Take the bytes of many reads, each with its stamp, as :meth:`take` does those of one."""
        if isinstance(self.decoder, FramedDecoder):
            self.decoder.extend(self._held, reads)
            return
        for host_ns, data in reads:
            self._held += self.decoder.feed(host_ns, data)

    def block(self) -> Block:
        """Return the samples of the readings held, with the next indices of the run, and hold none.

        Notes
        -----
        A device clock is read when the ping leaves, and the distance is that at which the sound meets the bob, half of
        its time of flight later: a sample's time is that. Left at the ping, a bob of 50 mm and 0.76 s would show a
        second harmonic of 31 um, for the further it is the later it is met.
        """
        held, self._held = self._held, []
        host_ns, sequence, device_us, echo_us, distance_m, _ = zip(*held, strict=True) if held else _NONE
        stamps = np.array(host_ns, np.int64)
        t, flags = self.timebase.push_all(held, stamps, np.array(sequence, np.int64), np.array(device_us, np.int64))
        echo = np.array(echo_us, np.float64)
        distance = self.calibration.distance(echo, np.array(distance_m, np.float64))
        self._clock.take(self._next, t, stamps)
        if self.family.has_device_time:
            t = t + self._ways(0.5e-6 * echo)
            self._at_reflection |= self._way_s > 0.0
        flags[np.isnan(distance)] |= MISSING
        if self._breaks:
            flags[[at for at in self._breaks if at < len(held)]] |= GAP_BEFORE
            self._breaks = [0] if self._breaks[-1] == len(held) else []
        first = self._next
        self._next += len(held)
        return Block(first, t, distance, flags, stamps)

    def _ways(self, ways_s: F8) -> F8:
        """Return how long after its ping each reading (n,) met the bob, s; one without an echo as long as the last.

        Sound that was on its way for longer than a period belongs to an earlier ping.
        """
        ways_s = carried(ways_s, ways_s < 0.5 / self.timebase.rate_hz, self._way_s)
        self._way_s = float(ways_s[-1]) if ways_s.size else self._way_s
        return ways_s

    def lost(self) -> None:
        """The port went away: a frame cut in half by that is no frame, and the next sample is flagged."""
        self.decoder.flush()
        self._breaks.append(len(self._held))

    @property
    def clock_ppm(self) -> float:
        """What the sensor's clock may be off at most, ppm; of a counter once a reading came."""
        if self._clock_ppm is not None:
            return self._clock_ppm
        return COUNTER_PPM if self.timebase.counts else self.family.clock_ppm

    @property
    def told(self) -> Told:
        """What the device said besides its readings."""
        return Told.by(self.decoder)

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

    def report(self) -> dict[str, Any]:
        """Return faults, gaps and the clock's rate error as plain numbers, for the run's provenance."""
        clock, told = fit_clock(*self._clock.columns()), self.told
        known, left_out = np.isfinite(clock.rate_error_ppm), self.timebase.gaps_left_out
        return {
            "faults": dict(self.decoder.faults),
            **({"conditions": dict(told.conditions)} if told.conditions else {}),
            **({"identity": asdict(told.identity)} if told.identity else {}),
            "gaps": [{"index": g.index, "length_s": g.length_s, "lost": g.lost} for g in self.timebase.gaps],
            **({"gaps_left_out": dict(left_out)} if left_out["count"] else {}),
            "restarts": self.timebase.restarts,
            "clock": {
                "kind": self.timebase.clock,
                "moment": "reflection" if self._at_reflection else "reading",
                "rate_error_ppm": clock.rate_error_ppm if known else None,
                "u_rate_error_ppm": clock.u_rate_error_ppm if known else None,
                "host_jitter_s": clock.jitter_s if known else None,
                "limit_ppm": self.clock_ppm,
                "stalls": clock.stalls,
                "held_readings": clock.held,
                "longest_stall_s": clock.longest_stall_s,
                "steps": clock.steps,
                "span_s": clock.span_s,
            },
        }
