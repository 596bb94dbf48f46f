"""Turn the bytes of one port into blocks, through a decoder, a timebase and a calibration.

Live view, recording, recovery and replay from wire bytes all use this chain, so they give identical samples.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from acquisition.block import F8, I8, Block, Flag
from acquisition.decoders.family import DeviceStatus, Family
from acquisition.live.calibration import Calibration
from acquisition.live.clock_fit import COUNTER_PPM, ClockSamples, fit_clock
from acquisition.live.timebase import WRAP_S, Timebase, demand_within
from acquisition.readings import NO_READINGS, Reading, Readings, carried
from acquisition.source import SourceInfo

__all__ = ["SensorChain"]

CLOCKS_PPM = (0.0, 1e6)
"""Allowed range of ``clock_ppm``, the maximum rate error of a clock, ppm."""
JOIN_NS = 1_000_000_000
"""Duration of the readings, before and after a port loss, that align the clocks, ns; a burst is shorter."""
MAX_HELD = 1 << 15
"""Maximum number of readings held for the alignment, because host times in a damaged log may not advance."""
RATE_READINGS = 1 << 16
"""Maximum number of samples in a fit of the clock rate, 11 min at 100 Hz; more would delay the reading thread."""
AGREE_S = 0.01
"""Maximum deviation from the host's clock, beyond the rate uncertainty, of a clock that has continued, s."""
MISSING, GAP_BEFORE = np.uint8(Flag.MISSING), np.uint8(Flag.GAP_BEFORE)


class SensorChain:
    """Turns the bytes of one sensor into samples.

    Parameters
    ----------
    family : Family
    options : mapping, optional
        Options of the family's decoder.
    rate_hz : float, optional
        Readings per second to which the sensor is set; by default the rate of the family.
    calibration : Calibration, optional
    clock_ppm : float, optional
        Maximum rate error of the sensor's clock, ppm; by default that of the family, or 100 000 for a counter.

    Raises
    ------
    SensorError
        If the family does not have an option, or if ``rate_hz`` or ``clock_ppm`` is out of range.
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
        self._travel_s = 0.0  # one-way travel time of the last ping, from the sensor to the bob
        self._clock = ClockSamples()
        self._at_reflection = False
        self._held: list[Reading] = []
        self._breaks: list[int] = []  # indices of the held readings that follow an interruption
        self._returns: list[int] = []  # the subset of these indices that follow the return of a port

    def __len__(self) -> int:
        """Return the number of held readings."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Block:
        """Decode the bytes of one read and return the completed samples, if any."""
        self.take(host_ns, data)
        return self.block()

    def take(self, host_ns: int, data: bytes) -> None:
        """Decode the bytes of one read, and hold the completed readings until :meth:`block` is called.

        Notes
        -----
        :meth:`block` computes times and distances for many readings together, in a third of the time that the same
        computation for single readings takes.
        """
        self.last = readings = self.decoder.feed(host_ns, data)
        self._held += readings

    def take_all(self, reads: Iterable[tuple[int, bytes]]) -> None:
        """Decode the bytes of several reads, given as pairs of host time and bytes; see :meth:`take`."""
        for host_ns, data in reads:
            self.take(host_ns, data)

    def block(self, *, final: bool = False) -> Block:
        """Return the samples of the held readings, with the next sample indices of the run.

        After a port came back, readings are held until they span a second, because their times are determined from all
        of them together.

        Parameters
        ----------
        final : bool
            Whether no further readings will come; if so, no reading is held back.

        Notes
        -----
        The device reads its clock when the ping is sent. The distance refers to the moment when the sound is reflected
        by the bob, half the time of flight later; this moment is the time of the sample. With the time of the ping
        instead, a bob with an amplitude of 50 mm and a period of 0.76 s would show a second harmonic of 31 um.
        """
        held, edges = self._released(final)
        stamps, t, flags = held.host_ns, np.empty(len(held)), np.zeros(len(held), np.uint8)
        for rows, returned in edges:
            if returned:
                self._align_clocks(held[rows], stamps[rows])
            for row in range(rows.start, rows.stop):
                t[row], flags[row] = self.timebase.push(held[row])
            self._clock.take(self._next + rows.start, t[rows], stamps[rows])
        echo = held.echo_us
        distance = self.calibration.distance(echo, held.distance_m)
        if self.family.has_device_time:
            t = t + self._travel_times(0.5e-6 * echo)
            self._at_reflection |= self._travel_s > 0.0
        flags[np.isnan(distance)] |= MISSING
        if self._breaks:
            flags[[at for at in self._breaks if at < len(held)]] |= GAP_BEFORE
            self._breaks = [at - len(held) for at in self._breaks if at >= len(held)]
        first = self._next
        self._next += len(held)
        return Block(first, t, distance, flags, stamps)

    def _released(self, final: bool) -> tuple[Readings, Iterator[tuple[slice, bool]]]:
        """Return the readings to release, and for each stretch its rows and whether a port came back before it."""
        held, returns = self._held, self._returns
        if returns and not final:
            back = held[returns[-1] :]
            if not back or (back[-1].host_ns - back[0].host_ns < JOIN_NS and len(back) < MAX_HELD):
                held = held[: returns[-1]]
        self._held = self._held[len(held) :]
        self._returns = [at - len(held) for at in returns if at >= len(held)]
        edges = sorted({0, *(at for at in returns if at < len(held)), len(held)})
        return Readings(held), ((slice(start, stop), start in returns) for start, stop in pairwise(edges))

    def _align_clocks(self, readings: Sequence[Reading], host_ns: I8) -> None:
        """Set the time after a port came back by the host's clock, unless the device's clock has continued.

        Notes
        -----
        A host time may be late but never early. So the minimum difference between host time and device time, among the
        readings of one second before and after the interruption, gives the offset between the clocks. During the
        interruption the clocks drift apart by the rate error estimated so far. A device clock that agrees with the
        host's clock within its error has continued and is kept.
        """
        t = self.timebase.continued_times(readings)
        before_t, before_ns = self._clock.columns()
        if t is None or not before_t.size:
            return
        clock = fit_clock(before_t[-RATE_READINGS:], before_ns[-RATE_READINGS:])
        u_ppm = min(clock.u_rate_error_ppm, self.clock_ppm)
        # A rate error of less than three standard uncertainties u is ignored, because it would add mostly noise over
        # the gap: for example 19 ms with a rate error of 2.2 u, measured within a second on a busy computer.
        known = 3.0 * u_ppm < abs(clock.rate_error_ppm) <= self.clock_ppm
        pace = 1.0 / (1.0 + 1e-6 * clock.rate_error_ppm) if known else 1.0
        zero_t, zero_ns = before_t[-1], before_ns[-1]
        error_s = AGREE_S + 3e-6 * u_ppm * float(host_ns[0] - zero_ns) * 1e-9
        if readings[0].device_us >= 0:
            t += WRAP_S * round(((host_ns[0] - zero_ns) * 1e-9 - (t[0] - zero_t)) / WRAP_S)

        def earliest(t: F8, stamps: I8) -> float:
            return float(np.min((stamps - zero_ns) * 1e-9 - pace * (t - zero_t)))

        near, behind = before_ns >= zero_ns - JOIN_NS, host_ns[: t.size] <= host_ns[0] + JOIN_NS
        late_s = earliest(t[behind], host_ns[: t.size][behind]) - earliest(before_t[near], before_ns[near])
        if abs(late_s) > error_s:
            self.timebase.join(float(t[0]) + late_s / pace)

    def _travel_times(self, travel_s: F8) -> F8:
        """Return the (n,) times from ping to reflection, s; without an echo, the time of the previous reading is used.

        An echo that takes longer than a period belongs to an earlier ping and is ignored here.
        """
        travel_s = carried(travel_s, travel_s < 0.5 / self.timebase.rate_hz, self._travel_s)
        self._travel_s = float(travel_s[-1]) if travel_s.size else self._travel_s
        return travel_s

    def lost(self) -> None:
        """Handle the loss of the port: drop an incomplete frame, and flag the next sample."""
        self.decoder.flush()
        self._breaks.append(len(self._held))

    def returned(self) -> None:
        """Handle the return of the port like its loss; the next block checks whether the device clock continued."""
        self.lost()
        self._returns.append(len(self._held))

    @property
    def clock_ppm(self) -> float:
        """Maximum rate error of the sensor's clock, ppm; it is final after the first reading."""
        if self._clock_ppm is not None:
            return self._clock_ppm
        return COUNTER_PPM if self.timebase.counts else self.family.clock_ppm

    @property
    def status(self) -> DeviceStatus:
        """The information that the device sent besides its readings."""
        return DeviceStatus.of(self.decoder)

    def info(self, name: str, kind: str = "live") -> SourceInfo:
        """Return the description of the source; its kind of clock is determined by the first reading."""
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
        """Return faults, gaps and the clock comparison as plain data, for the provenance of the run."""
        clock, status = fit_clock(*self._clock.columns()), self.status
        known, left_out = np.isfinite(clock.rate_error_ppm), self.timebase.gaps_left_out
        return {
            "faults": dict(self.decoder.faults),
            **({"conditions": dict(status.conditions)} if status.conditions else {}),
            **({"identity": asdict(status.identity)} if status.identity else {}),
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
