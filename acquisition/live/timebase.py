"""Timebase: sensor time from the device's clock or counter.

Host times are too coarse for 100 Hz: under load a 10 ms stream shows steps of 23 to 77 ms. So the sensor's clock is
used whenever it is sent, and :mod:`acquisition.live.clock_fit` finds its rate error from the host times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8, Flag
from acquisition.errors import SensorError
from acquisition.readings import Reading
from acquisition.source import ClockKind

__all__ = ["KEPT_GAPS", "RATES_HZ", "Gap", "Timebase", "demand_within"]

RATES_HZ = (1e-6, 1e9)
"""Smallest and largest allowed number of readings per second, far beyond any bench."""

KEPT_GAPS = 10_000
"""Gaps that are listed one by one in the header of a run file; later ones are only counted."""

WRAP_US = 1 << 32
WRAP_S = WRAP_US * 1e-6
NANO = 1e-9


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without readings.

    Parameters
    ----------
    index : int
        Index of the first reading after it.
    length_s : float
        Time between the readings on either side, s.
    lost : int
        Number of readings that should have come in between.
    """

    index: int
    length_s: float
    lost: int


def demand_within(what: str, value: object, low: float, high: float) -> None:
    """Check that a value is a number within a range.

    Raises
    ------
    SensorError
        With the range and the value.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise SensorError(f"{what} of a sensor must be a number from {low:g} to {high:g}, got {value!r}")


class Timebase:
    """Gives every reading its sensor time; one timebase serves one run.

    Parameters
    ----------
    rate_hz : float
        Nominal readings per second, Hz. It converts a counter to time, and gaps to numbers of lost readings.

    Raises
    ------
    SensorError
        If the rate is not in :data:`RATES_HZ`.

    Notes
    -----
    With a device clock, time is the device's microseconds since the first reading, unwrapped at 2^32. With only a
    counter it is the counter divided by the nominal rate, with neither it is the host time.

    A device has restarted if its clock runs backward by more than a wrap explains, or shows less time than the silence
    before it. Its time is then continued by the host's clock, and its first reading is flagged. A device that continues
    where it stopped has not restarted, however long the silence: the link stalled and delivers what it held. After a
    port came back, the caller, who sees the readings on both sides, sets the time of the first one by :meth:`join`.

    If there are only host times, the readings that a stalled link delivers together have no known time. They follow
    each other within half a period after a silence, and are flagged as duplicates until two readings come in time.
    """

    def __init__(self, rate_hz: float) -> None:
        demand_within("rate_hz", rate_hz, *RATES_HZ)
        self.rate_hz = rate_hz
        self._period_s = 1.0 / rate_hz
        self._jitter_s = max(0.25, 3.0 / rate_hz)
        self._longest_s = 1.5 / rate_hz  # in a longer step readings are missing
        self.gaps: list[Gap] = []
        self.gaps_left_out = {"count": 0, "lost": 0, "longest_s": 0.0}  # gaps after the first KEPT_GAPS
        self.restarts = 0
        self.joins = 0  # restarts after a port came back
        self._join_s: float | None = None
        self._count = 0
        self._last_raw: int | None = None
        self._last_host_ns = 0
        # Time is a whole number of ticks after an anchor, so that it does not depend on how reads cut the bytes.
        self._anchor_s = 0.0
        self._ticks = 0
        self._latest_s = 0.0
        self._held = False  # whether readings may still belong to a burst after a silence
        self._in_time = 0
        self._clock: ClockKind | None = None
        self._counts = False

    @property
    def clock(self) -> ClockKind:
        """Origin of the times; known after the first reading."""
        return self._clock or "host"

    @property
    def counts(self) -> bool:
        """Whether times are a counter divided by the nominal rate; known after the first reading."""
        return self._counts

    def push(self, reading: Reading) -> tuple[float, int]:
        """Return a reading's sensor time, s, and its time flag: a gap before it, a repeated time or a step back."""
        raw, unit_s = self._ticks_of(reading)
        if self._clock is None:
            self._clock = "host" if unit_s == NANO else "device"
            self._counts = reading.device_us < 0 <= reading.sequence
        first, joined = self._last_raw is None, self._join_s is not None
        restarted = self._advance(raw, unit_s, reading.host_ns)
        self._last_raw, self._last_host_ns = raw, reading.host_ns
        t = self._anchor_s + self._ticks * unit_s
        step_s = t - self._latest_s
        flag = 0
        if not first and step_s == 0.0:
            flag = int(Flag.DUPLICATE_TIME)
        elif step_s < 0.0:
            flag = int(Flag.NON_MONOTONIC_TIME)
        elif restarted or (step_s > self._longest_s and not self._only_jitter(unit_s, step_s)):
            flag = int(Flag.GAP_BEFORE)
            # After a port came back with another counter, the number of lost readings is unknown.
            lost = 0 if joined else max(round(step_s * self.rate_hz) - 1, 0)
            self._note_gap(Gap(self._count, step_s, lost))
            self._held, self._in_time = unit_s == NANO, 0
        elif self._held:
            flag = self._burst_flag(step_s)
        self._latest_s = max(t, self._latest_s)
        self._count += 1
        return t, flag

    def continued_times(self, readings: Sequence[Reading]) -> F8 | None:
        """Return the times (m,), m <= n, s, of the next n readings if the device's clock continues.

        There are fewer than n times if the clock runs backward among them, or a reading has no device clock. The result
        is None if the first reading has none, or there was no reading before.
        """
        _, unit_s = self._ticks_of(readings[0])
        if self._last_raw is None or unit_s == NANO:
            return None
        raws: list[int] = []
        for reading in readings:
            raw, unit = self._ticks_of(reading)
            if unit != unit_s or (raws and raw < raws[-1]):
                break
            raws.append(raw)
        return np.asarray(self._anchor_s + (self._ticks + np.array(raws, np.int64) - self._last_raw) * unit_s)

    def join(self, t: float) -> None:
        """Set the time of the next reading, s, because its device's clock does not continue the one before."""
        self._join_s, self._held = t, True

    def _ticks_of(self, reading: Reading) -> tuple[int, float]:
        """Return the time of a reading in ticks, and the length of a tick, s."""
        if reading.device_us >= 0:
            return reading.device_us, 1e-6
        if reading.sequence >= 0:
            return reading.sequence, self._period_s
        return reading.host_ns, NANO

    def _note_gap(self, gap: Gap) -> None:
        if len(self.gaps) < KEPT_GAPS:
            self.gaps.append(gap)
            return
        left_out = self.gaps_left_out
        left_out["count"], left_out["lost"] = left_out["count"] + 1, left_out["lost"] + gap.lost
        left_out["longest_s"] = max(left_out["longest_s"], gap.length_s)

    def _burst_flag(self, step: float) -> int:
        """Return the flag of a reading that may belong to a burst, whose host times are not times of measurement."""
        late = step < 0.5 * self._period_s
        self._in_time = 0 if late else self._in_time + 1
        self._held = self._in_time < 2
        return int(Flag.DUPLICATE_TIME) if late else 0

    def _only_jitter(self, unit_s: float, step: float) -> bool:
        """Return whether a step of host times is jitter; only a silence longer than that counts as a gap."""
        return unit_s == NANO and step < self._jitter_s

    def _advance(self, raw: int, unit_s: float, host_ns: int) -> bool:
        """Advance to a reading; return whether the device restarted and the host's clock bridges the gap."""
        if self._last_raw is None:
            return False
        if self._join_s is not None:
            self._anchor_s, self._ticks = max(self._join_s, self._latest_s + self._period_s), 0
            self._join_s = None
            self.restarts, self.joins = self.restarts + 1, self.joins + 1
            return True
        difference = raw - self._last_raw
        step = difference * unit_s
        if unit_s != NANO and not 0.0 <= step <= self._longest_s:
            elapsed = (host_ns - self._last_host_ns) * NANO
            wraps = round((elapsed - step) / WRAP_S) if unit_s == 1e-6 else 0
            # After a wrap the time continues smoothly; otherwise the device restarted.
            if wraps > 0 and abs(step + wraps * WRAP_S - elapsed) < 2.0 + 0.01 * elapsed:
                difference += wraps * WRAP_US
            elif step < -1.0 or (step > self._jitter_s and raw * unit_s < elapsed - 2.0):
                self.restarts += 1
                self._anchor_s, self._ticks = self._latest_s + max(elapsed, self._period_s), 0
                return True
        self._ticks += difference
        return False
