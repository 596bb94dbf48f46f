"""Timebase: sensor time from the device's clock or counter, and how the host's clock runs against it.

Host stamps cannot carry 100 Hz timing: under load a 10 ms stream shows steps of 23 to 77 ms. So the sensor's own time
is used wherever it is sent, and the host clock is regressed on it to find the crystal's rate error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8, I8, Flag
from acquisition.readings import Reading
from acquisition.source import ClockKind

__all__ = ["ClockFit", "Gap", "Timebase", "fit_clock"]

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


@dataclass(frozen=True, slots=True)
class ClockFit:
    """The host clock against the sensor's.

    Parameters
    ----------
    rate_error_ppm : float
        How much faster the sensor's clock runs than the host's, parts per million.
    u_rate_error_ppm : float
        Its standard uncertainty from the stamps' scatter alone; the host's own crystal comes on top.
    jitter_s : float
        Standard deviation of the host stamps about the line, s.
    readings : int
    """

    rate_error_ppm: float
    u_rate_error_ppm: float
    jitter_s: float
    readings: int


class Timebase:
    """Gives every reading its sensor time, run by run.

    Parameters
    ----------
    rate_hz : float
        Nominal readings per second, Hz: turns a counter into time, and a missing stretch into lost readings.

    Notes
    -----
    With a device clock, time is the device's microseconds since the first reading, unwrapped at 2^32. With a counter
    alone it is the counter over the nominal rate. With neither it is the host's stamp. A device that restarts (its
    clock runs backward by more than a wrap explains, or shows less than the silence before it lasted) is joined by
    the host clock, and the first reading after it is flagged.
    """

    def __init__(self, rate_hz: float) -> None:
        if not (math.isfinite(rate_hz) and rate_hz > 0):
            raise ValueError(f"rate_hz must be positive and finite, got {rate_hz}")
        self.rate_hz = rate_hz
        self._period_s = 1.0 / rate_hz
        self._longest_s = 1.5 / rate_hz  # a step that is longer has readings missing in it
        self.gaps: list[Gap] = []
        self.restarts = 0
        self._count = 0
        self._last_raw: int | None = None
        self._last_host_ns = 0
        # Time is whole ticks from an anchor, so that it does not depend on how the bytes were cut into reads.
        self._anchor_s = 0.0
        self._ticks = 0
        self._latest_s = 0.0
        self._clock: ClockKind | None = None

    @property
    def clock(self) -> ClockKind:
        """Where times come from; known once a reading came."""
        return self._clock or "host"

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
            if 0.0 < difference * unit_s <= longest_s and 0.0 < t - self._latest_s <= longest_s:
                self._last_raw, self._last_host_ns = raw, host_ns
                self._ticks, self._latest_s = ticks, t
                self._count += 1
                return t, 0
        elif self._clock is None:
            self._clock = "host" if unit_s == NANO else "device"
        return self._step(raw, unit_s, host_ns)

    def _step(self, raw: int, unit_s: float, host_ns: int) -> tuple[float, int]:
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
            self.gaps.append(Gap(self._count, step, max(round(step * self.rate_hz) - 1, 0)))
        self._latest_s = max(t, self._latest_s)
        self._count += 1
        return t, flag

    def _only_jitter(self, unit_s: float, step: float) -> bool:
        """Host stamps come late in bunches; only silence longer than any jitter counts as a gap there."""
        return unit_s == NANO and step < max(0.25, 3.0 / self.rate_hz)

    def _advance(self, raw: int, unit_s: float, host_ns: int) -> bool:
        """Count on to a reading; True where the device started again and the host clock had to join it."""
        if self._last_raw is None:
            return False
        difference = raw - self._last_raw
        step = difference * unit_s
        if unit_s != NANO and not 0.0 <= step <= self._longest_s:
            elapsed = (host_ns - self._last_host_ns) * NANO
            wraps = round((elapsed - step) / WRAP_S) if unit_s == 1e-6 else 0
            # A wrap continues smoothly; anything else is a device that started again.
            if wraps > 0 and abs(step + wraps * WRAP_S - elapsed) < 2.0 + 0.01 * elapsed:
                difference += wraps * WRAP_US
            elif step < -1.0 or (step > 0.0 and raw * unit_s < elapsed - 2.0):
                self.restarts += 1
                self._anchor_s, self._ticks = self._latest_s + max(elapsed, self._period_s), 0
                return True
        self._ticks += difference
        return False


def fit_clock(t: F8, host_ns: I8) -> ClockFit:
    """Regress the host clock on sensor time.

    Parameters
    ----------
    t : (n,) float64, s
        Sensor times.
    host_ns : (n,) int64, ns
        Host stamps of the same readings.

    Notes
    -----
    A stamp is never early: transport and scheduling only delay it. The least delay in each of a dozen stretches
    therefore lies on a line whose slope is the rate error, found far more closely than by least squares through all
    stamps [1]_. Where stamps scatter to both sides (a stamped bridge, a virtual machine) the minima scatter more than
    the mean does; both lines are fitted and the one with the smaller uncertainty is returned.

    References
    ----------
    .. [1] S. B. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network delay measurements",
       IEEE INFOCOM 1999, doi:10.1109/INFCOM.1999.749287.
    """
    n = int(t.size)
    if n < 24 or t[-1] <= t[0]:
        return ClockFit(math.nan, math.inf, math.nan, n)
    x = t - 0.5 * (t[0] + t[-1])
    delay = (host_ns - host_ns[0]) * NANO - (t - t[0])
    candidates = [_through_minima(x, delay), _through_all(x, delay)]
    slope, u_slope = min(candidates, key=lambda line: line[1])
    if not slope > -1.0:  # the host's clock stood still or ran back
        return ClockFit(math.nan, math.inf, math.nan, n)
    return ClockFit(
        # Exactly, and not -slope: at 50 ppm the square is many times a long run's uncertainty.
        -slope / (1.0 + slope) * 1e6,
        u_slope * 1e6,
        float(np.std(delay - slope * x)),
        n,
    )


def _through_minima(x: F8, delay: F8, stretches: int = 12) -> tuple[float, float]:
    slope, line_u = 0.0, math.inf
    # The least of `delay` is sought along the line found so far, else a steep line hides it at a stretch's end.
    for _ in range(3):
        rest = delay - slope * x
        edges = np.linspace(x[0], x[-1], stretches + 1)
        parts = np.split(np.arange(x.size), np.searchsorted(x, edges[1:-1]))
        lowest = np.array([part[np.argmin(rest[part])] for part in parts if part.size])
        if lowest.size < stretches // 2:  # a few points always lie near some line
            return 0.0, math.inf
        slope, line_u = _line(x[lowest], delay[lowest])
    return slope, line_u


def _through_all(x: F8, delay: F8) -> tuple[float, float]:
    slope, u = _line(x, delay)
    residual = delay - slope * x
    residual = residual - residual.mean()
    power = float(residual @ residual)
    if power == 0.0:
        return slope, u
    length = 1.0
    for lag in range(1, min(x.size // 4, 1000)):
        rho = float(residual[lag:] @ residual[:-lag]) / power
        if rho < 2.0 / math.sqrt(x.size):
            break
        length += 2.0 * rho
    return slope, u * math.sqrt(length)


def _line(x: F8, y: F8) -> tuple[float, float]:
    """Slope of a least-squares line and its standard uncertainty from the residuals.

    A scatter that few points tell is itself uncertain: the uncertainty is the standard deviation of Student's
    distribution, not its scale.
    """
    centred = x - x.mean()
    power = float(centred @ centred)
    slope = float(centred @ y) / power
    residual = y - y.mean() - slope * centred
    return slope, math.sqrt(float(residual @ residual) / max(x.size - 4, 1) / power)
