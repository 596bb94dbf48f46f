"""From the bytes of one port to blocks: decoder, timebase and calibration in a row.

Live view, recording, recovery and replay from wire bytes all use this one chain, so they cannot differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from acquisition.block import F8, I8, Block, Flag
from acquisition.decoders.family import Family, Told
from acquisition.decoders.framed import FramedDecoder
from acquisition.live.calibration import Calibration
from acquisition.live.clock_fit import COUNTER_PPM, ClockSamples, fit_clock
from acquisition.live.timebase import WRAP_S, Timebase, demand_within
from acquisition.readings import NO_READINGS, Reading, Readings, carried
from acquisition.source import SourceInfo

__all__ = ["SensorChain"]

_NONE: tuple[tuple[float, ...], ...] = ((),) * len(Reading._fields)
CLOCKS_PPM = (0.0, 1e6)
"""What anybody may say of a clock: from one that is right to one that may stand still."""
JOIN_NS = 1_000_000_000
"""Stamps of so long on either side of a lost port tie the clocks: a burst behind it is over then."""
MOST_HELD = 1 << 15
"""So many readings are held for that at most: a log's stamps may stand still."""
RATE_READINGS = 1 << 16
"""Of so many the rate of the clock is fitted then, eleven minutes at 100 Hz: the reading thread waits meanwhile."""
AGREE_S = 0.01
"""A counter that is no further from the host's clock, whose uncertain rate comes on top, has gone on."""
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
        self._returns: list[int] = []  # of them, before which a port came back

    def __len__(self) -> int:
        """Return how many readings are held."""
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

    def block(self, *, final: bool = False) -> Block:
        """Return the samples of the readings held, with the next indices of the run.

        Those behind a port that came back are held until they span a second, for their time is told by all of these.

        Parameters
        ----------
        final : bool
            Whether no more come: none is held then.

        Notes
        -----
        A device clock is read when the ping leaves, and the distance is that at which the sound meets the bob, half of
        its time of flight later: a sample's time is that. Left at the ping, a bob of 50 mm and 0.76 s would show a
        second harmonic of 31 um, for the further it is the later it is met.
        """
        held, edges = self._released(final)
        host_ns, sequence, device_us, echo_us, distance_m, _ = zip(*held, strict=True) if held else _NONE
        stamps = np.array(host_ns, np.int64)
        counters = np.array(sequence, np.int64), np.array(device_us, np.int64)
        t, flags = np.empty(len(held)), np.zeros(len(held), np.uint8)
        for rows, returned in edges:
            columns = (stamps[rows], *(column[rows] for column in counters))
            if returned:
                self._tie(*columns)
            t[rows], flags[rows] = self.timebase.push_all(held[rows], *columns)
            self._clock.take(self._next + rows.start, t[rows], stamps[rows])
        echo = np.array(echo_us, np.float64)
        distance = self.calibration.distance(echo, np.array(distance_m, np.float64))
        if self.family.has_device_time:
            t = t + self._ways(0.5e-6 * echo)
            self._at_reflection |= self._way_s > 0.0
        flags[np.isnan(distance)] |= MISSING
        if self._breaks:
            flags[[at for at in self._breaks if at < len(held)]] |= GAP_BEFORE
            self._breaks = [at - len(held) for at in self._breaks if at >= len(held)]
        first = self._next
        self._next += len(held)
        return Block(first, t, distance, flags, stamps)

    def _released(self, final: bool) -> tuple[list[Reading], Iterator[tuple[slice, bool]]]:
        """Take the readings that may go, and return them with the rows of each stretch and whether a port came back."""
        held, returns = self._held, self._returns
        if returns and not final:
            back = held[returns[-1] :]
            if not back or (back[-1].host_ns - back[0].host_ns < JOIN_NS and len(back) < MOST_HELD):
                held = held[: returns[-1]]
        self._held = self._held[len(held) :]
        self._returns = [at - len(held) for at in returns if at >= len(held)]
        edges = sorted({0, *(at for at in returns if at < len(held)), len(held)})
        return held, ((slice(start, stop), start in returns) for start, stop in pairwise(edges))

    def _tie(self, host_ns: I8, sequence: I8, device_us: I8) -> None:
        """Have the host's clock tell the time of readings behind a port that came back, where the device's does not.

        Notes
        -----
        A stamp may be late, never early: of the readings of a second on either side, the least difference of stamp and
        device time tells how the clocks stand to each other. They run apart by the rate error known so far. A counter
        that agrees within the host's clock error has gone on, and its own step stands.
        """
        t = self.timebase.going_on(host_ns, sequence, device_us)
        before_t, before_ns = self._clock.columns()
        if t is None or not before_t.size:
            return
        clock = fit_clock(before_t[-RATE_READINGS:], before_ns[-RATE_READINGS:])
        u_ppm = min(clock.u_rate_error_ppm, self.clock_ppm)
        # A rate error within three of its uncertainties would only carry these over the gap: 2.2 of them, in a second
        # on a busy machine, once made 19 ms.
        known = 3.0 * u_ppm < abs(clock.rate_error_ppm) <= self.clock_ppm
        pace = 1.0 / (1.0 + 1e-6 * clock.rate_error_ppm) if known else 1.0
        zero_t, zero_ns = before_t[-1], before_ns[-1]
        error_s = AGREE_S + 3e-6 * u_ppm * float(host_ns[0] - zero_ns) * 1e-9
        if device_us[0] >= 0:
            t += WRAP_S * round(((host_ns[0] - zero_ns) * 1e-9 - (t[0] - zero_t)) / WRAP_S)

        def earliest(t: F8, stamps: I8) -> float:
            return float(np.min((stamps - zero_ns) * 1e-9 - pace * (t - zero_t)))

        near, behind = before_ns >= zero_ns - JOIN_NS, host_ns[: t.size] <= host_ns[0] + JOIN_NS
        late_s = earliest(t[behind], host_ns[: t.size][behind]) - earliest(before_t[near], before_ns[near])
        if abs(late_s) > error_s:
            self.timebase.join(float(t[0]) + late_s / pace)

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

    def returned(self) -> None:
        """The port came back: besides, the device's clock may be another one."""
        self.lost()
        self._returns.append(len(self._held))

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
            "joins": self.timebase.joins,
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
