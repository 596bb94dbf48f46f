"""The device's clock against the host's: how fast it runs, and what in the stamps says nothing about that.

A stamp is late by transport and scheduling. Most of that is a few milliseconds; a network or a bridge that stalls
makes it seconds, and brings all that it held at once. Such readings are told by their stamps alone and left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8

__all__ = ["COUNTER_PPM", "ClockFit", "ClockSamples", "fit_clock"]

COUNTER_PPM = 100_000.0
"""What the pace of a program may be off its nominal rate, ppm: a loop that waits 10 ms takes the ping's time on top."""

STALL_S = 0.25
"""Lateness that no jitter explains, s."""
SILENCE_S = 0.05
"""A step of the offsets that is a silence, s."""
STEP_S = 0.02
"""A step of the least delay that is none of the rate's, s: a USB bridge holds bytes for 16 ms (FTDI AN232B-04)."""
FEWEST = 24
MOST = 1 << 19
"""At most so many samples, at least half as many, evenly spread over a run, tell how the clocks run."""
NANO = 1e-9


@dataclass(frozen=True, slots=True)
class ClockFit:
    """The host clock against the sensor's.

    Parameters
    ----------
    rate_error_ppm : float
        How much faster the sensor's clock runs than the host's, parts per million; NaN where the stamps do not tell.
    u_rate_error_ppm : float
        Its standard uncertainty from the stamps' scatter alone; the host's own crystal comes on top.
    jitter_s : float
        Standard deviation of the host stamps about the line, s.
    readings : int
        All of them, those left out too.
    held : int
        Readings that came too late by a stall, and were left out.
    stalls : int
        Stretches of such readings: each came as a burst, at the end of a silence.
    longest_stall_s : float
        By which the latest of them was late, s.
    steps : int
        Times at which one clock jumped against the other and stayed so: a host that slept, a device that paused or
        counts anew. What lies on either side is compared by itself.
    span_s : float
        Time over which the clocks were compared without a step, s.
    """

    rate_error_ppm: float
    u_rate_error_ppm: float
    jitter_s: float
    readings: int
    held: int = 0
    stalls: int = 0
    longest_stall_s: float = 0.0
    steps: int = 0
    span_s: float = 0.0


class ClockSamples:
    """Times by both clocks of samples spread evenly over a run of any length."""

    def __init__(self) -> None:
        self._step = 1
        self._t, self._host_ns = np.empty(1024), np.empty(1024, np.int64)
        self._count = 0

    def take(self, first: int, t: F8, host_ns: I8) -> None:
        """Take the next samples: the index of the first, sensor times in s, host stamps in ns."""
        kept = slice(-first % self._step, None, self._step)
        t, host_ns = t[kept], host_ns[kept]
        before, self._count = self._count, self._count + t.size
        if self._count > self._t.size:  # room grows by doubling; an array a read would take ten times as much
            room = max(self._count, 2 * self._t.size) - before
            self._t = np.concatenate([self._t[:before], np.empty(room)])
            self._host_ns = np.concatenate([self._host_ns[:before], np.empty(room, np.int64)])
        self._t[before : self._count], self._host_ns[before : self._count] = t, host_ns
        if self._count > MOST:
            self._step *= 2
            t, host_ns = self.columns()
            self._t, self._host_ns = t[::2].copy(), host_ns[::2].copy()
            self._count = self._t.size

    def columns(self) -> tuple[F8, I8]:
        """Return sensor times in s and host stamps in ns."""
        return self._t[: self._count], self._host_ns[: self._count]


def fit_clock(t: F8, host_ns: I8) -> ClockFit:
    """Regress the host clock on sensor time.

    Parameters
    ----------
    t : (n,) float64, s
        Sensor times: of the pings, where the device stamps these. A time of reflection moves with the bob, and the
        stamps do not.
    host_ns : (n,) int64, ns
        Host stamps of the same readings.

    Notes
    -----
    A stamp is never early: transport and scheduling only delay it. The least delay in each of a dozen stretches
    therefore lies on a line whose slope is the rate error, found far more closely than by least squares through all
    stamps [1]_. Where stamps scatter to both sides (a stamped bridge, a virtual machine) the minima scatter more than
    the mean does; both lines are fitted and the one with the smaller uncertainty is returned.

    Readings that a stall held come in a burst: back in time their offsets grow by a second in a second, which no clock
    does. With offsets :math:`d_i` at times :math:`t_i`, reading i is one of them where
    :math:`d_i > d_j + (t_j - t_i)/2` of a later reading j: it is late by twice the difference, and left out.

    Where the least delay jumps and stays there, the lines on either side share their slope and not their zero, as the
    offsets of streams that started again are treated by LSL's importers [2]_.

    References
    ----------
    .. [1] S. B. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network delay measurements",
       IEEE INFOCOM 1999, doi:10.1109/INFCOM.1999.749287.
    .. [2] C. Kothe et al., "The lab streaming layer for synchronized multimodal recording", Imaging Neuroscience 3,
       2025, doi:10.1162/IMAG.a.136.
    """
    n = int(t.size)
    nothing = ClockFit(math.nan, math.inf, math.nan, n)
    if n < FEWEST or not np.isfinite(t).all() or t[-1] <= t[0]:
        return nothing
    # Stamps half the range of their type apart are no clock's, and their difference would wrap.
    if int(host_ns.max()) - int(host_ns.min()) >= 1 << 62:
        return nothing
    if not (ahead := np.concatenate([[True], t[1:] > np.maximum.accumulate(t)[:-1]])).all():
        t, host_ns = t[ahead], host_ns[ahead]  # repeats, and what runs backward
        if t.size < FEWEST:
            return nothing
    x = t - 0.5 * (t[0] + t[-1])
    delay = (host_ns - host_ns[0]) * NANO - (t - t[0])
    late = _lateness(x, delay)
    stalls = _stalls(x, delay, late)
    held = np.zeros(t.size, np.bool_)
    for start, stop in stalls:
        held[start:stop] = True
    found = (int(held.sum()), len(stalls), max((float(late[a:b].max()) for a, b in stalls), default=0.0))
    if stalls:
        x, delay = x[~held], delay[~held]
        if x.size < FEWEST or x[-1] <= x[0]:
            return ClockFit(math.nan, math.inf, math.nan, n, *found)
    steps = _steps(x, delay)
    part = np.searchsorted(steps, np.arange(x.size), side="right")
    candidates = [_through_minima(x, delay, part), _through_all(x, delay, part)]
    slope, u_slope = min(candidates, key=lambda line: line[1])
    if not (math.isfinite(u_slope) and slope > -1.0):
        return ClockFit(math.nan, math.inf, math.nan, n, *found, len(steps))
    return ClockFit(
        # Exactly, and not -slope: at 50 ppm the square is many times a long run's uncertainty.
        -slope / (1.0 + slope) * 1e6,
        u_slope * 1e6,
        float(np.std(_within(delay - slope * x, part))),
        n,
        *found,
        len(steps),
        max(float(np.ptp(rows)) for rows in np.split(x, steps) if rows.size),
    )


def _lateness(x: F8, delay: F8) -> F8:
    """Return by how much each reading is late, were it one of a burst, s: a later one came sooner. Else 0."""
    sooner = np.minimum.accumulate((delay + 0.5 * x)[::-1])[::-1] - 0.5 * x
    return np.asarray(2.0 * (delay - sooner))


def _stalls(x: F8, delay: F8, late: F8) -> list[tuple[int, int]]:
    """Return from where to where readings came too late by a stall.

    A counter whose nominal rate is wrong by a multiple is late everywhere too: its stamps are spread evenly, where a
    stall has a silence, or brings its readings at once.
    """
    change = np.diff(delay)
    silence = np.concatenate([[False], change > max(SILENCE_S, 5.0 * float(np.median(np.abs(change))))])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], late > 0.0, [False]]).astype(np.int8)))
    found = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        last = min(stop, x.size - 1)
        at_once = delay[start] - delay[last] > 0.9 * (x[last] - x[start])
        if late[start:stop].max() >= STALL_S and (at_once or silence[start:stop].any()):
            found.append((start, stop))
    return found


def _steps(x: F8, delay: F8, stretches: int = 48) -> I8:
    """Return at which readings one clock has jumped against the other: the least delay of stretches steps there."""
    parts = [part for part in _parts(x, stretches) if part.size]
    if len(parts) < stretches // 4:
        return np.empty(0, np.int64)
    lowest = np.array([part[np.argmin(delay[part])] for part in parts])
    dx, rise = np.diff(x[lowest]), np.diff(delay[lowest])
    left = rise - float(np.median(rise / dx)) * dx
    scatter = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    jumps = np.flatnonzero(np.abs(left) > max(STEP_S, 10.0 * scatter))
    return np.array([parts[at + 1][0] for at in jumps.tolist()], np.int64)


def _parts(x: F8, stretches: int) -> list[I8]:
    """Return the readings of stretches of equal length."""
    edges = np.linspace(x[0], x[-1], stretches + 1)
    return np.split(np.arange(x.size), np.searchsorted(x, edges[1:-1]))


def _through_minima(x: F8, delay: F8, part: NDArray[np.int64], stretches: int = 12) -> tuple[float, float]:
    slope, line_u = 0.0, math.inf
    parts = [rows for rows in _parts(x, stretches) if rows.size]
    if len(parts) < stretches // 2:  # a few points always lie near some line
        return 0.0, math.inf
    # The least of `delay` is sought along the line found so far, else a steep line hides it at a stretch's end.
    for _ in range(3):
        rest = delay - slope * x
        lowest = np.array([rows[np.argmin(rest[rows])] for rows in parts])
        slope, line_u = _line(x[lowest], delay[lowest], part[lowest])
    return slope, line_u


def _through_all(x: F8, delay: F8, part: NDArray[np.int64]) -> tuple[float, float]:
    slope, u = _line(x, delay, part)
    residual = _within(delay - slope * x, part)
    power = _dot(residual, residual)
    if power == 0.0:
        return slope, u
    length = 1.0
    for lag in range(1, min(x.size // 4, 1000)):
        rho = _dot(residual[lag:], residual[:-lag]) / power
        if rho < 2.0 / math.sqrt(x.size):
            break
        length += 2.0 * rho
    return slope, u * math.sqrt(length)


def _within(y: F8, part: NDArray[np.int64]) -> F8:
    """Return values less the mean of their part."""
    if part[0] == part[-1]:
        return np.asarray(y - y.mean())
    number = np.unique(part, return_inverse=True)[1]
    return np.asarray(y - (np.bincount(number, y) / np.bincount(number))[number])


def _line(x: F8, y: F8, part: NDArray[np.int64]) -> tuple[float, float]:
    """Slope of least-squares lines of one slope, each part's with its own zero, and its u from the residuals.

    A scatter that few points tell is itself uncertain: the uncertainty is the standard deviation of Student's
    distribution, not its scale.
    """
    centred = _within(x, part)
    power = _dot(centred, centred)
    if power == 0.0:  # a point in each part
        return 0.0, math.inf
    slope = _dot(centred, y) / power
    residual = _within(y, part) - slope * centred
    free = x.size - 3 - np.unique(part).size
    return slope, math.sqrt(_dot(residual, residual) / max(free, 1) / power)


def _dot(a: F8, b: F8) -> float:
    """Return the sum of products, without BLAS: on a busy machine its threads take four times as long."""
    return float(np.einsum("i,i->", a, b))
