"""Timebase: sensor time from the device's clock or counter, and how the host's clock runs against it.

Host stamps cannot carry 100 Hz timing: under load a 10 ms stream shows steps of 23 to 77 ms. So the sensor's own time
is used wherever it is sent, and the host clock is regressed on it to find the crystal's rate error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8, I8, U8, Flag
from acquisition.errors import SensorError
from acquisition.readings import Reading
from acquisition.source import ClockKind

__all__ = ["KEPT_GAPS", "RATES_HZ", "Gap", "Timebase", "demand_within"]

RATES_HZ = (1e-6, 1e9)
"""Readings per second that a sensor may be set to: more and fewer than any bench has."""

KEPT_GAPS = 10_000
"""So many are remembered one by one, as a run file's header may hold; those after them are counted."""

TOGETHER = 32  # readings from which on arrays are worth their making
ALONE = 64  # readings taken one by one behind one that is out of step: where many are, arrays would be made in vain
WRAP_US = 1 << 32
WRAP_S = WRAP_US * 1e-6
NANO = 1e-9


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without readings.

    Parameters
    ----------
    index : int
        Of the first reading after it.
    length_s : float
        Between the readings on either side, s.
    lost : int
        Readings that should have come in between.
    """

    index: int
    length_s: float
    lost: int


def demand_within(what: str, value: object, low: float, high: float) -> None:
    """Demand a number of a range.

    Raises
    ------
    SensorError
        Naming what, the range and what it was.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise SensorError(f"{what} of a sensor must be a number from {low:g} to {high:g}, got {value!r}")


class Timebase:
    """Gives every reading its sensor time, run by run.

    Parameters
    ----------
    rate_hz : float
        Nominal readings per second, Hz: turns a counter into time, and a missing stretch into lost readings.

    Raises
    ------
    SensorError
        If the rate is not of :data:`RATES_HZ`.

    Notes
    -----
    With a device clock, time is the device's microseconds since the first reading, unwrapped at 2^32. With a counter
    alone it is the counter over the nominal rate. With neither it is the host's stamp. A device that restarts (its
    clock runs backward by more than a wrap explains, or shows less than the silence before it lasted) is joined by
    the host clock, and the first reading after it is flagged. One that goes on where it stopped, or nearly, has not
    started again, however long the silence: the link stalled, and delivers what it held. After a port was lost and
    came back, whoever sees the readings on both sides gives the time of the first by :meth:`join`.

    Readings that a stalled link held and delivers at once have no time where only the host's stamp tells it. They
    follow a silence closer than half a period, and are flagged as those of one moment, until two come in time.
    """

    def __init__(self, rate_hz: float) -> None:
        demand_within("rate_hz", rate_hz, *RATES_HZ)
        self.rate_hz = rate_hz
        self._period_s = 1.0 / rate_hz
        self._jitter_s = max(0.25, 3.0 / rate_hz)
        self._longest_s = 1.5 / rate_hz  # a step that is longer has readings missing in it
        self.gaps: list[Gap] = []
        self.gaps_left_out = {"count": 0, "lost": 0, "longest_s": 0.0}  # of those after the first KEPT_GAPS
        self.restarts = 0
        self.joins = 0  # of them, at a port that came back
        self._join_s: float | None = None
        self._count = 0
        self._last_raw: int | None = None
        self._last_host_ns = 0
        # Time is whole ticks from an anchor, so that it does not depend on how the bytes were cut into reads.
        self._anchor_s = 0.0
        self._ticks = 0
        self._latest_s = 0.0
        self._held = False  # whether readings may still be those of a burst behind a silence
        self._in_time = 0
        self._clock: ClockKind | None = None
        self._counts = False

    @property
    def clock(self) -> ClockKind:
        """Where times come from; known once a reading came."""
        return self._clock or "host"

    @property
    def counts(self) -> bool:
        """Whether times are a counter's over the nominal rate; known once a reading came."""
        return self._counts

    def push(self, reading: Reading) -> tuple[float, int]:
        """Return a reading's sensor time in s and the flag that time adds: a gap before it, a repeat, a step back."""
        host_ns = reading.host_ns
        if (raw := reading.device_us) >= 0:
            unit_s = 1e-6
        elif (raw := reading.sequence) >= 0:
            unit_s = self._period_s
        else:
            raw, unit_s = host_ns, NANO
        if self._last_raw is not None:
            difference = raw - self._last_raw
            ticks = self._ticks + difference
            t = self._anchor_s + ticks * unit_s
            longest_s = self._longest_s
            step_s = difference * unit_s
            if 0.0 < step_s <= longest_s and 0.0 < t - self._latest_s <= longest_s and not self._held:
                self._last_raw, self._last_host_ns = raw, host_ns
                self._ticks, self._latest_s = ticks, t
                self._count += 1
                return t, 0
        elif self._clock is None:
            self._clock = "host" if unit_s == NANO else "device"
            self._counts = reading.device_us < 0 <= reading.sequence
        return self._step(raw, unit_s, host_ns)

    def push_all(self, readings: Sequence[Reading], host_ns: I8, sequence: I8, device_us: I8) -> tuple[F8, U8]:
        """Return of many readings what :meth:`push` returns of each, in a fourth of the time where all is in step.

        Parameters
        ----------
        readings : sequence of Reading
        host_ns, sequence, device_us : (n,) int64
            Their columns.
        """
        n = len(readings)
        t, flags = np.empty(n), np.zeros(n, np.uint8)
        at = 0
        while at < n:
            if n - at >= TOGETHER:
                at += self._in_step(t[at:], host_ns[at:], sequence[at:], device_us[at:])
            for row in range(at, min(at + ALONE, n)):
                t[row], flags[row] = self.push(readings[row])
            at += ALONE
        return t, flags

    def going_on(self, host_ns: I8, sequence: I8, device_us: I8) -> F8 | None:
        """Return the times (m,), m <= n, s, of the next readings if the device's clock went on as it was.

        Fewer than those given where the clock runs backward among them; None where readings have no such clock or none
        came before.

        Parameters
        ----------
        host_ns, sequence, device_us : (n,) int64
            Their columns.
        """
        raw, unit_s = self._clock_of(host_ns, sequence, device_us)
        if self._last_raw is None or unit_s == NANO:
            return None
        backward = np.flatnonzero((np.diff(raw) < 0) | (raw[1:] < 0))
        raw = raw[: backward[0] + 1] if backward.size else raw
        return np.asarray(self._anchor_s + (self._ticks + raw - self._last_raw) * unit_s)

    def join(self, t: float) -> None:
        """Have the next reading at a time, s, and go on from there: its device's clock is not the one before."""
        self._join_s, self._held = t, True

    def _clock_of(self, host_ns: I8, sequence: I8, device_us: I8) -> tuple[I8, float]:
        """Return what the first of some readings has its time from, -1 where others have no such, and its unit, s."""
        if device_us[0] >= 0:
            return device_us, 1e-6
        if sequence[0] >= 0:
            return np.where(device_us < 0, sequence, -1), self._period_s
        return np.where(np.maximum(device_us, sequence) < 0, host_ns, -1), NANO

    def _in_step(self, t: F8, host_ns: I8, sequence: I8, device_us: I8) -> int:
        """Fill in the times of the readings that follow one after the other as they should; return how many do."""
        if self._last_raw is None or self._held:
            return 0
        raw, unit_s = self._clock_of(host_ns, sequence, device_us)
        # One that has no such clock ends the row, as one does that runs backward.
        differences = np.diff(raw, prepend=self._last_raw)
        ticks = self._ticks + np.cumsum(differences)
        times = self._anchor_s + ticks * unit_s
        steps, forward = differences * unit_s, np.diff(times, prepend=self._latest_s)
        sound = (raw >= 0) & (steps > 0.0) & (steps <= self._longest_s) & (forward > 0.0) & (forward <= self._longest_s)
        count = sound.size if sound.all() else int(np.argmin(sound))
        if count:
            t[:count] = times[:count]
            self._last_raw, self._last_host_ns = int(raw[count - 1]), int(host_ns[count - 1])
            self._ticks, self._latest_s = int(ticks[count - 1]), float(times[count - 1])
            self._count += count
        return count

    def _note_gap(self, gap: Gap) -> None:
        if len(self.gaps) < KEPT_GAPS:
            self.gaps.append(gap)
            return
        rest = self.gaps_left_out
        rest["count"], rest["lost"] = rest["count"] + 1, rest["lost"] + gap.lost
        rest["longest_s"] = max(rest["longest_s"], gap.length_s)

    def _step(self, raw: int, unit_s: float, host_ns: int) -> tuple[float, int]:
        joined = self._join_s is not None
        restarted = self._advance(raw, unit_s, host_ns)
        first = self._last_raw is None
        self._last_raw, self._last_host_ns = raw, host_ns
        t = self._anchor_s + self._ticks * unit_s
        step = t - self._latest_s
        flag = 0
        if not first and step == 0.0:
            flag = int(Flag.DUPLICATE_TIME)
        elif step < 0.0:
            flag = int(Flag.NON_MONOTONIC_TIME)
        elif restarted or (step > self._longest_s and not self._only_jitter(unit_s, step)):
            flag = int(Flag.GAP_BEFORE)
            # Whether a device that comes back with another counter would have sent anything meanwhile nobody knows.
            lost = 0 if joined else max(round(step * self.rate_hz) - 1, 0)
            self._note_gap(Gap(self._count, step, lost))
            self._held, self._in_time = unit_s == NANO, 0
        elif self._held:
            flag |= self._of_a_burst(step)
        self._latest_s = max(t, self._latest_s)
        self._count += 1
        return t, flag

    def _of_a_burst(self, step: float) -> int:
        """Return the flag of a reading whose stamp says when a burst came and not when it was taken."""
        late = step < 0.5 * self._period_s
        self._in_time = 0 if late else self._in_time + 1
        self._held = self._in_time < 2
        return int(Flag.DUPLICATE_TIME) if late else 0

    def _only_jitter(self, unit_s: float, step: float) -> bool:
        """Host stamps come late in bunches; only silence longer than any jitter counts as a gap there."""
        return unit_s == NANO and step < self._jitter_s

    def _advance(self, raw: int, unit_s: float, host_ns: int) -> bool:
        """Count on to a reading; True where the device started again and the host clock had to join it."""
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
            # A wrap continues smoothly; anything else is a device that started again.
            if wraps > 0 and abs(step + wraps * WRAP_S - elapsed) < 2.0 + 0.01 * elapsed:
                difference += wraps * WRAP_US
            elif step < -1.0 or (step > self._jitter_s and raw * unit_s < elapsed - 2.0):
                self.restarts += 1
                self._anchor_s, self._ticks = self._latest_s + max(elapsed, self._period_s), 0
                return True
        self._ticks += difference
        return False
