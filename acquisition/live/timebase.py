"""The timebase: it derives sensor times from the clock or the counter of the device.

Host times are too imprecise for 100 Hz: under load, readings sent every 10 ms arrive in steps of 23 to 77 ms. So the
clock of the sensor is used if it is sent, and :mod:`acquisition.live.clock_fit` estimates its rate error from the host
times. Lines without a clock have the times that :mod:`acquisition.live.line_times` finds.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from acquisition.block import ClockKind, Flag
from acquisition.errors import SensorError
from acquisition.live.clock_fit import NANO
from acquisition.readings import Reading

RATES_HZ = (1e-6, 1e9)
"""Minimum and maximum allowed number of readings per second, far beyond any real experiment."""

KEPT_GAPS = 10_000
"""Maximum number of gaps listed individually in the header of a run file; later gaps are only counted."""

WRAP_US = 1 << 32
WRAP_S = WRAP_US * 1e-6


@dataclass(frozen=True, slots=True)
class Gap:
    """An interval without readings: index of the first reading after it, length in s, number of lost readings."""

    index: int
    length_s: float
    lost: int


def demand_within(what: str, value: object, low: float, high: float) -> None:
    """Raise a SensorError, which states the range and the value, if a value is not a number within a range."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise SensorError(f"{what} of a sensor must be a number from {low:g} to {high:g}, got {value!r}")


class Timebase:
    """Assigns a sensor time to each reading; each part of a run needs a separate timebase.

    With a device clock, the sensor time is the clock's microseconds since the first reading, unwrapped at 2^32. With
    only a counter, it is the count since the first reading divided by the nominal rate ``rate_hz``. With neither, it is
    the host time since the first reading.

    A device has restarted if its clock runs backward in a way that no wrap explains, or shows less time than the
    preceding silence lasted. The sensor time then continues by the host's clock, and the first reading is flagged. A
    device whose clock continues from its last value has not restarted, even after a long silence: the link stalled and
    now delivers the delayed readings.
    """

    def __init__(self, rate_hz: float) -> None:
        demand_within("rate_hz", rate_hz, *RATES_HZ)
        self.rate_hz = rate_hz
        self._period_s = 1.0 / rate_hz
        self._jitter_s = max(0.25, 3.0 / rate_hz)
        self._longest_s = 1.5 / rate_hz  # a longer step means that readings are missing
        self.gaps: list[Gap] = []
        self.gaps_left_out = {"count": 0, "lost": 0, "longest_s": 0.0}  # summary of the gaps after the first KEPT_GAPS
        self.restarts = 0
        self.restart_silences_s: list[float] = []
        self._delays_s: deque[float] = deque(maxlen=100)  # of the latest readings, by the host's clock
        self._count = 0
        self._last_raw: int | None = None
        self._last_host_ns = 0
        # The time is a whole number of ticks after an anchor, so that the boundaries of reads do not affect it.
        self._anchor_s = 0.0
        self._ticks = 0
        self._latest_s = 0.0
        # The first reading determines the origin of the times, and whether they are a counter divided by the rate.
        self.clock: ClockKind = "host"
        self.counts = False

    def push(self, reading: Reading) -> tuple[float, int]:
        """Return the sensor time of a reading, s, and its flag: 0, a gap before it, a repeated time or a step back."""
        raw, unit_s = self._ticks_of(reading)
        first = self._last_raw is None
        if first:
            self.clock = "host" if unit_s == NANO else "device"
            self.counts = reading.device_us < 0 <= reading.sequence
        restarted = self._advance(raw, unit_s, reading.host_ns)
        self._last_raw, self._last_host_ns = raw, reading.host_ns
        t = self._anchor_s + self._ticks * unit_s
        step_s = t - self._latest_s
        # A step of host times is a gap only if it is too long to be jitter.
        longest_s = self._longest_s if unit_s != NANO else max(self._longest_s, self._jitter_s)
        flag = 0
        if not first and step_s == 0.0:
            flag = int(Flag.DUPLICATE_TIME)
        elif step_s < 0.0:
            flag = int(Flag.NON_MONOTONIC_TIME)
        elif restarted or step_s > longest_s:
            flag = int(Flag.GAP_BEFORE)
            self.note_gap(self._count, step_s, self.rate_hz)
        self._latest_s = max(self._latest_s, t)
        self._delays_s.append(reading.host_ns * NANO - t)
        self._count += 1
        return t, flag

    def _ticks_of(self, reading: Reading) -> tuple[int, float]:
        """Return the device's clock, its counter or the host time as a number of ticks, and the length of a tick, s."""
        if reading.device_us >= 0:
            return reading.device_us, 1e-6
        if reading.sequence >= 0:
            return reading.sequence, self._period_s
        return reading.host_ns, NANO

    def note_gap(self, index: int, length_s: float, rate_hz: float) -> None:
        """List a gap before a reading at the rate of the readings, or count it if there are many."""
        gap = Gap(index, length_s, max(round(length_s * rate_hz) - 1, 0))
        if len(self.gaps) < KEPT_GAPS:
            self.gaps.append(gap)
            return
        left_out = self.gaps_left_out
        left_out["count"], left_out["lost"] = left_out["count"] + 1, left_out["lost"] + gap.lost
        left_out["longest_s"] = max(left_out["longest_s"], gap.length_s)

    def _advance(self, raw: int, unit_s: float, host_ns: int) -> bool:
        """Advance to a reading; return whether the clock of the device restarted, so that the time was set anew."""
        if self._last_raw is None:
            return False
        difference = raw - self._last_raw
        step = difference * unit_s
        if unit_s != NANO and not 0.0 <= step <= self._longest_s:
            elapsed = (host_ns - self._last_host_ns) * NANO
            wraps = round((elapsed - step) / WRAP_S) if unit_s == 1e-6 else 0
            # If the clock wrapped, the unwrapped step agrees with the host time; else the device may have restarted.
            if wraps > 0 and abs(step + wraps * WRAP_S - elapsed) < 2.0 + 0.01 * elapsed:
                difference += wraps * WRAP_US
            elif step < -1.0 or (step > self._jitter_s and raw * unit_s < elapsed - 2.0):
                self.restarts += 1
                # The reading before may have come late, but not the earliest of many.
                now_s = host_ns * NANO - min(self._delays_s)
                self._anchor_s, self._ticks = max(now_s, self._latest_s + self._period_s), 0
                if len(self.restart_silences_s) < KEPT_GAPS:
                    self.restart_silences_s.append(self._anchor_s - self._latest_s)
                return True
        self._ticks += difference
        return False
