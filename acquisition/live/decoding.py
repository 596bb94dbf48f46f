"""Turn the bytes of one port into blocks, through a decoder, a timebase and a calibration.

Live view, recording, recovery and replay from wire bytes all use this chain, so they give identical samples.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from acquisition.block import F8, Block, Flag, SourceInfo, SourceKind
from acquisition.decoders.decoder import Decoder, DeviceStatus
from acquisition.decoders.sensor import Sensor
from acquisition.errors import SensorError
from acquisition.live.calibration import Calibration
from acquisition.live.clock_fit import COUNTER_PPM, ClockSamples, facts_of
from acquisition.live.line_times import Arrivals, settled
from acquisition.live.timebase import Timebase, demand_within
from acquisition.readings import NO_READINGS, Reading, Readings, carried

CLOCKS_PPM = (0.0, 1e6)
"""Allowed range of ``clock_ppm``, the maximum rate error of a clock, ppm."""
ROOM_C = (-100.0, 200.0)
"""Range of the temperatures that count, degC, so that a hostile sensor cannot fill the memory with distinct ones."""
MISSING, GAP_BEFORE = np.uint8(Flag.MISSING), np.uint8(Flag.GAP_BEFORE)


class SensorChain:
    """Turns the bytes of one sensor into samples.

    ``rate_hz`` is the rate to which the sensor is set, by default that of its family. ``clock_ppm`` is the maximum rate
    error of its clock, by default that of the family, or 100 000 for a counter. Values out of range, and options that
    the family never had, raise a SensorError.
    """

    def __init__(
        self,
        family: Sensor,
        *,
        options: Mapping[str, Any] | None = None,
        rate_hz: float | None = None,
        calibration: Calibration | None = None,
        clock_ppm: float | None = None,
    ) -> None:
        family.demand_options(options or {}, past=True)
        self.family = family
        self.calibration = calibration or Calibration()
        decoder: object = family.decoder(**(options or {}))
        if not isinstance(decoder, Decoder):
            message = "its decoder must inherit from springmass.extend.Decoder, got"
            raise SensorError(f"sensor {family.name}: {message} {type(decoder).__name__}", "repair the package")
        self.decoder = decoder
        self.timebase = Timebase(family.rate_hz if rate_hz is None else rate_hz)
        if clock_ppm is not None:
            demand_within("clock_ppm", clock_ppm, *CLOCKS_PPM)
        self._clock_ppm = clock_ppm
        self.last: Readings = NO_READINGS
        self._next = 0
        self._travel_s = 0.0  # one-way travel time of the last ping, from the sensor to the bob
        self._at_reflection = False
        self._clock = ClockSamples()
        self._arrivals: Arrivals | None = None
        self._temperatures: Counter[float] = Counter()  # number of readings by temperature, degC
        self._held: list[Reading] = []
        self._breaks: list[int] = []  # indices of the held readings that follow an interruption

    def __len__(self) -> int:
        """Return the number of held readings."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Block:
        """Decode the bytes of one read and return the completed samples, if any."""
        self.take(host_ns, data)
        return self.block()

    def take(self, host_ns: int, data: bytes) -> None:
        """Decode the bytes of one read, and hold the completed readings until :meth:`block` is called.

        :meth:`block` computes times and distances for many readings together, in a third of the time that the same
        computation for single readings takes.
        """
        self.last = readings = self.decoder.feed(host_ns, data)
        self._held += readings

    def block(self) -> Block:
        """Return the samples of the held readings, with the next sample indices of the run.

        The device reads its clock when the ping is sent. The distance refers to the moment when the sound is reflected
        by the bob, half the time of flight later; this moment is the time of the sample. With the time of the ping
        instead, a bob with an amplitude of 50 mm and a period of 0.76 s would show a second harmonic of 31 um.
        """
        held, self._held = Readings(self._held), []
        stamps, t, flags = held.host_ns, np.empty(len(held)), np.zeros(len(held), np.uint8)
        if not self._next and held and self.family.poll is None and max(held[0].device_us, held[0].sequence) < 0:
            self._arrivals = Arrivals(self.timebase.rate_hz)
        if self._arrivals is not None:
            t, flags = self._arrivals.push(stamps)
        else:
            for row, reading in enumerate(held):
                t[row], flags[row] = self.timebase.push(reading)
            self._clock.take(self._next, t, stamps)
        self._temperatures.update(
            round(row.temperature_c, 2) for row in held if ROOM_C[0] < row.temperature_c < ROOM_C[1]
        )
        echo = held.echo_us
        distance = self.calibration.distance(echo, held.distance_m)
        if self.family.has_device_time:
            t = t + self._travel_times(0.5e-6 * echo)
            self._at_reflection |= self._travel_s > 0.0
        flags[np.isnan(distance)] |= MISSING
        flags[[at for at in self._breaks if at < len(held)]] |= GAP_BEFORE
        self._breaks = [0] if len(held) in self._breaks else []
        first, self._next = self._next, self._next + len(held)
        return Block(first, t, distance, flags, stamps)

    @property
    def awaits_end(self) -> bool:
        """Whether the times are those of arrival, which :meth:`settle` improves once all samples are there."""
        return self._arrivals is not None

    def settle(self, block: Block) -> Block:
        """Return all samples of a run with the times that they show together, if they had only those of arrival."""
        if self._arrivals is None or not len(block):
            return block
        block, self._arrivals.clock = settled(block)
        lost = block.flags & GAP_BEFORE != 0
        for row in (np.flatnonzero(lost[1:]) + 1).tolist():
            self.timebase.note_gap(row, float(block.t[row] - block.t[row - 1]), self._arrivals.clock.rate_hz)
        return block

    def _travel_times(self, travel_s: F8) -> F8:
        """Return the (n,) times from ping to reflection, s; without an echo, the time of the previous reading is used.

        An echo that takes longer than a period belongs to an earlier ping and is ignored here.
        """
        travel_s = carried(travel_s, travel_s < 0.5 / self.timebase.rate_hz, self._travel_s)
        self._travel_s = float(travel_s[-1]) if travel_s.size else self._travel_s
        return travel_s

    def lost(self) -> None:
        """Handle an interruption of the bytes: drop an incomplete frame, and flag the next sample."""
        self.decoder.flush()
        self._breaks.append(len(self._held))

    @property
    def clock_ppm(self) -> float:
        """Maximum rate error of the sensor's clock, ppm; it is final after the first reading."""
        if self._clock_ppm is not None:
            return self._clock_ppm
        return COUNTER_PPM if self.timebase.counts else self.family.clock_ppm

    @property
    def status(self) -> DeviceStatus:
        """The information that the device sent besides its readings; it is empty if its decoder has none."""
        return self.decoder.status

    def info(self, name: str, kind: SourceKind = "live") -> SourceInfo:
        """Return the description of the source; its kind of clock is determined by the first reading."""
        rate_hz, clock = self.timebase.rate_hz, self.timebase.clock
        quantum_m = self.decoder.resolution_m or self.family.resolution_m
        info = SourceInfo(kind, name, rate_hz, quantum_m=quantum_m, clock=clock)
        return info if self._arrivals is None else self._arrivals.clock.described(info)

    def report(self) -> dict[str, Any]:
        """Return faults, gaps, temperature and the clock comparison as plain data, for the provenance of the run."""
        status, left_out = self.status, self.timebase.gaps_left_out
        return {
            "faults": dict(self.decoder.faults),
            **({"conditions": dict(status.conditions)} if status.conditions else {}),
            **({"identity": asdict(status.identity)} if status.identity else {}),
            **({"median_temperature_c": _median(self._temperatures)} if self._temperatures else {}),
            "gaps": [asdict(gap) for gap in self.timebase.gaps],
            **({"gaps_left_out": dict(left_out)} if left_out["count"] else {}),
            "restarts": self.timebase.restarts,
            "restart_silences_s": list(self.timebase.restart_silences_s),
            "clock": {
                "kind": self.timebase.clock,
                "moment": "reflection" if self._at_reflection else "reading",
                "limit_ppm": self.clock_ppm,
                **facts_of(self._clock.fit()),
                **({} if self._arrivals is None else {"lines": facts_of(self._arrivals.clock)}),
            },
        }


def _median(counts: Counter[float]) -> float:
    """Return the lower median of values that are counted; there is at least one."""
    values = sorted(counts)
    return values[int(np.searchsorted(2 * np.cumsum([counts[value] for value in values]), counts.total()))]
