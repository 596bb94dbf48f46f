"""Estimate the rate error of the device's clock relative to the host's, without readings that a stall delayed.

Transport and scheduling delay a host time, usually by a few milliseconds. A network or bridge that stalls delays
readings by seconds and then delivers all of them together. These readings are recognised by their host times and
excluded.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from acquisition.block import F8, I8
from acquisition.buffer import GrowingColumns

COUNTER_PPM = 100_000.0
"""Maximum rate error of a counter, ppm: a program that waits 10 ms in a loop also needs the time of the ping."""

STALL_S = 0.25
"""Minimum delay of a stall, s; delays by jitter are shorter."""
SILENCE_STEP_S = 0.05
"""Minimum step in the delays that indicates a silence, s."""
JUMP_STEP_S = 0.02
"""Minimum step in the minimum delay that indicates a clock jump, s: USB bridges delay by 16 ms (FTDI AN232B-04)."""
MIN_SAMPLES = 24
MAX_SAMPLES = 1 << 19
"""Maximum number of samples in a fit, spread evenly over the run."""
NANO = 1e-9


@dataclass(frozen=True, slots=True)
class ClockFit:
    """The comparison of the sensor's clock with the host's; the names are those of the provenance of a run file.

    The rate error is the relative rate by which the sensor's clock runs faster; NaN if the host times do not give it.
    Its uncertainty does not include the error of the host's crystal. ``host_jitter_s`` is the standard deviation of the
    host times about the line. ``held_readings`` were delayed by one of the ``stalls`` and excluded.

    ``steps`` counts the permanent jumps of one clock relative to the other, because the host slept, or the device
    paused or restarted its counter. ``span_s`` is the longest duration without a jump.
    """

    rate_error_ppm: float = math.nan
    u_rate_error_ppm: float = math.inf
    host_jitter_s: float = math.nan
    held_readings: int = 0
    stalls: int = 0
    longest_stall_s: float = 0.0
    steps: int = 0
    span_s: float = 0.0


def facts_of(clock: Any) -> dict[str, Any]:
    """Return what is known of a clock as plain data, with None for numbers that the host times do not give."""
    return {name: None if isinstance(x, float) and not math.isfinite(x) else x for name, x in asdict(clock).items()}


class ClockSamples:
    """Collects the times of both clocks for a bounded number of samples, spread evenly over a run of any length."""

    def __init__(self) -> None:
        self._step = 1
        self._times = GrowingColumns(float, np.int64)

    def take(self, first: int, t: F8, host_ns: I8) -> None:
        """Add the next samples, with the index of the first, their sensor times in s and their host times in ns."""
        chosen = slice(-first % self._step, None, self._step)
        self._times.append(t[chosen], host_ns[chosen])
        if len(self._times) > MAX_SAMPLES:
            self._step *= 2
            self._times.keep(slice(None, None, 2))

    def fit(self) -> ClockFit:
        """Return the comparison of the clocks."""
        return fit_clock(*self._times[:])


def fit_clock(t: F8, host_ns: I8, *, step_s: float = 0.0) -> ClockFit:
    """Fit a line to the (n,) host times as a function of the sensor times in s, and return the comparison of clocks.

    The sensor times are those of the pings: times of reflection vary with the position of the bob.

    A host time is never early, because transport and scheduling can only delay it. The run is divided into twelve
    stretches; the minimum delays of the stretches lie on a line whose slope gives the rate error. This determines the
    slope far better than least squares through all host times [1]_. The host times may scatter to both sides (a bridge
    with its own clock, a virtual machine); then the minima scatter more than the mean. So both lines are fitted, and
    the line with the smaller uncertainty is used.

    Readings that a stall delayed come in a burst: their delays decrease by one second per second, which no clock error
    can cause. With delays :math:`d_i` at times :math:`t_i`, reading i belongs to a burst if
    :math:`d_i > d_j + (t_j - t_i)/2` for a later reading j. Twice the maximum difference between the two sides is the
    lateness of the reading. A burst is excluded as a stall if its maximum lateness is at least 0.25 s, and it includes
    a silence or its readings arrive together.

    If the minimum delay jumps permanently, the lines before and after the jump have the same slope but different
    offsets. The importers of LSL (lab streaming layer) treat restarted streams in the same way [2]_. Times that count
    steps of ``step_s`` are late by up to a step where several arrive together, so that such a jump shows nothing.

    .. [1] S. B. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network delay measurements",
       IEEE INFOCOM 1999, doi:10.1109/INFCOM.1999.749287.
    .. [2] C. Kothe et al., "The lab streaming layer for synchronized multimodal recording", Imaging Neuroscience 3,
       2025, doi:10.1162/IMAG.a.136.
    """
    # No clock gives host times 2^62 ns apart, and their difference would overflow.
    if t.size < MIN_SAMPLES or not np.isfinite(t).all() or int(host_ns.max()) - int(host_ns.min()) >= 1 << 62:
        return ClockFit()
    ahead = np.concatenate([[True], t[1:] > np.maximum.accumulate(t)[:-1]])
    t, host_ns = t[ahead], host_ns[ahead]  # exclude repeated times and times that run backward
    if t.size < MIN_SAMPLES:
        return ClockFit()
    x = t - 0.5 * (t[0] + t[-1])
    delay = (host_ns - host_ns[0]) * NANO - (t - t[0])
    late = _lateness(x, delay)
    stalls = _stalls(x, delay, late)
    held = np.zeros(t.size, np.bool_)
    for start, stop in stalls:
        held[start:stop] = True
    longest_s = max((float(late[start:stop].max()) for start, stop in stalls), default=0.0)
    without = ClockFit(held_readings=int(held.sum()), stalls=len(stalls), longest_stall_s=longest_s)
    x, delay = x[~held], delay[~held]
    if x.size < MIN_SAMPLES:
        return without
    steps = _steps(x, delay, max(JUMP_STEP_S, 1.5 * step_s))
    part = np.searchsorted(steps, np.arange(x.size), side="right")
    candidates = [_through_minima(x, delay, part), _through_all(x, delay, part)]
    slope, u_slope = min(candidates, key=lambda line: line[1])
    if not (math.isfinite(u_slope) and slope > -1.0):
        return replace(without, steps=len(steps))
    return replace(
        without,
        # The result is not simply -slope: at 50 ppm the quadratic term is many times the uncertainty of a long run.
        rate_error_ppm=-slope / (1.0 + slope) * 1e6,
        u_rate_error_ppm=u_slope * 1e6,
        host_jitter_s=float(np.std(_within(delay - slope * x, part))),
        steps=len(steps),
        span_s=max(float(np.ptp(rows)) for rows in np.split(x, steps) if rows.size),
    )


def _lateness(x: F8, delay: F8) -> F8:
    """Return the lateness of each reading, s; it is positive if a later reading had a much shorter delay, else 0."""
    sooner = np.minimum.accumulate((delay + 0.5 * x)[::-1])[::-1] - 0.5 * x
    return np.asarray(2.0 * (delay - sooner))


def _stalls(x: F8, delay: F8, late: F8) -> list[tuple[int, int]]:
    """Return the first row of each stall, and the row after its last row.

    If the nominal rate of a counter is wrong by a factor, all readings may seem late. But their host times are evenly
    spread, while a stall includes a silence or delivers its readings together.
    """
    change = np.diff(delay)
    silence = np.concatenate([[False], change > max(SILENCE_STEP_S, 5.0 * float(np.median(np.abs(change))))])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], late > 0.0, [False]]).astype(np.int8)))
    stalls = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        last = min(stop, x.size - 1)
        at_once = delay[start] - delay[last] > 0.9 * (x[last] - x[start])
        if late[start:stop].max() >= STALL_S and (at_once or silence[start:stop].any()):
            stalls.append((start, stop))
    return stalls


def _steps(x: F8, delay: F8, least_s: float) -> I8:
    """Return the rows at which one clock jumped relative to the other, found by steps in the minimum delay."""
    parts = _parts(x, 48)
    if len(parts) < 12:
        return np.empty(0, np.int64)
    lowest = np.array([part[np.argmin(delay[part])] for part in parts])
    dx, rise = np.diff(x[lowest]), np.diff(delay[lowest])
    deviation = rise - float(np.median(rise / dx)) * dx
    scatter = 1.4826 * float(np.median(np.abs(deviation - np.median(deviation))))
    jumps = np.flatnonzero(np.abs(deviation) > max(least_s, 10.0 * scatter))
    return np.array([parts[at + 1][0] for at in jumps.tolist()], np.int64)


def _parts(x: F8, stretches: int) -> list[I8]:
    """Divide the readings into stretches of equal duration, and return the rows of each that has any."""
    edges = np.linspace(x[0], x[-1], stretches + 1)
    return [rows for rows in np.split(np.arange(x.size), np.searchsorted(x, edges[1:-1])) if rows.size]


def _through_minima(x: F8, delay: F8, part: I8) -> tuple[float, float]:
    slope, line_u = 0.0, math.inf
    parts = _parts(x, 12)
    if len(parts) < 6:  # too few points are always close to a line
        return 0.0, math.inf
    # The minima are taken relative to the current line; otherwise a steep line would move them to the stretch ends.
    for _ in range(3):
        offset = delay - slope * x
        lowest = np.array([rows[np.argmin(offset[rows])] for rows in parts])
        slope, line_u = _line(x[lowest], delay[lowest], part[lowest])
    return slope, line_u


def _through_all(x: F8, delay: F8, part: I8) -> tuple[float, float]:
    slope, u = _line(x, delay, part)
    residual = _within(delay - slope * x, part)
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


def _within(y: F8, part: I8) -> F8:
    """Return the values minus the mean of their part."""
    if part[0] == part[-1]:
        return np.asarray(y - y.mean())
    number = np.unique(part, return_inverse=True)[1]
    return np.asarray(y - (np.bincount(number, y) / np.bincount(number))[number])


def _line(x: F8, y: F8, part: I8) -> tuple[float, float]:
    """Fit lines with a common slope and an offset for each part; return the slope and its standard uncertainty.

    The uncertainty comes from the residuals. The scatter of a few points is itself uncertain, so the uncertainty is the
    standard deviation of Student's t distribution and not its scale parameter.
    """
    centred = _within(x, part)
    power = float(centred @ centred)
    if power == 0.0:  # there is one point in each part
        return 0.0, math.inf
    slope = float(centred @ y) / power
    residual = _within(y, part) - slope * centred
    free = x.size - 3 - np.unique(part).size
    return slope, math.sqrt(float(residual @ residual) / max(free, 1) / power)
