"""Segments: the part of a record in which one free oscillation runs, and what the hand did before, between and after.

The amplitude of a free oscillation falls smoothly and its phase turns steadily. A bob that hangs still, is lifted, held
or caught has another; a restart, a touch, lost rows or a clock that stood still break either from one period to the
next. Every window is held against what the five before it and the five after it continue to.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.robust import median
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.cycles import Cycles
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, Quality, Track

__all__ = ["Break", "Params", "Segments", "Span", "find_segments"]

REACH = 5  # windows on either side that say what a window should be
PAIRS = np.array(list(itertools.combinations(range(REACH), 2))).T
LINE = np.array([0.8, 0.5, 0.2, -0.1, -0.4])  # weights by which a straight line through five is continued to the next
STILL = 0.2  # of the greatest amplitude: below, a part is no oscillation of the record's but what the hand left
MOVING = 4.0  # standard uncertainties that two windows running must have for the bob to be seen to move
HELD = 0.75  # periods for which a distance stays on a plateau only where a hand holds the bob
BRIDGED = 3  # samples off such a plateau that noise takes there
STRONG = 0.06  # fall of the logarithm of the amplitude in a window beyond which no five windows tell the next
ECHOED = 0.9  # of the samples of the fullest window: what half of the windows have at least
THIRD = 0.3853204664075677  # 0.3-quantile of |x| for a standard normal x
PAUSE = 4  # windows without any free oscillation between two that make a restart
TURNED = 0.06  # relative change of the amplitude below which, if less than a third of the turn, the phase alone jumped

C16 = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_segments`.

    Parameters
    ----------
    sigmas : float
        A window breaks the motion where both sides contradict each other there by so many standard deviations of what
        they do in this record.
    share : float
        The least such contradiction, in amplitudes.
    least_windows : int
        Fewer are not looked at.
    rest_share : float
        Share of a record that must follow after the motion is lost in the noise, for it to be left out.
    """

    sigmas: float = 7.0
    share: float = 0.012
    least_windows: int = 2 * REACH + 2
    rest_share: float = 0.3


@dataclass(frozen=True, slots=True)
class Span:
    """Seconds of a record that were left out.

    Parameters
    ----------
    kind : str
        "at_rest": nothing but noise; "waiting": that, up to the recording's own trigger; "handled": neither still nor
        free; "free": another free oscillation.
    first_s, last_s : float
    """

    kind: str
    first_s: float
    last_s: float


@dataclass(frozen=True, slots=True)
class Break:
    """Where one free oscillation ends and another begins.

    Parameters
    ----------
    kind : str
        "restarted": with a pause between; "touched": the amplitude changes at once; "phase_jump": the phase alone.
    time_s, u_s : float
    amplitude : float
        Relative change of the amplitude.
    phase : float
        Change of the phase, rad.
    """

    kind: str
    time_s: float
    u_s: float
    amplitude: float
    phase: float


@dataclass(frozen=True, slots=True)
class Segments:
    """The part of a record that is analysed, and what is not.

    Parameters
    ----------
    first_s, last_s : float
        The part's seconds.
    left_out : tuple of Span
        In order of time.
    breaks : tuple of Break
        In order of time.
    """

    first_s: float
    last_s: float
    left_out: tuple[Span, ...]
    breaks: tuple[Break, ...] = ()

    def flagged(self, track: Track) -> Track:
        """Return a track with the samples outside the part flagged."""
        outside = ~((track.t >= self.first_s) & (track.t <= self.last_s))
        return replace(track, flags=track.flags | np.where(outside, np.uint8(Quality.OUTSIDE), np.uint8(0)))

    def within(self, before: Segments | None) -> Segments:
        """Return these, found in the part of others, together with what those left out."""
        if before is None:
            return self
        spans = sorted((*before.left_out, *self.left_out), key=lambda span: span.first_s)
        breaks = sorted((*before.breaks, *self.breaks), key=lambda one: one.time_s)
        first_s, last_s = max(self.first_s, before.first_s), min(self.last_s, before.last_s)
        return Segments(first_s, last_s, tuple(spans), tuple(breaks))


def find_segments(
    conditioned: Conditioned, cycles: Cycles, demodulated: Demodulated, params: Params | None = None
) -> Segments | None:
    """Return the longest part in which one free oscillation runs; None where that is the whole record.

    Parameters
    ----------
    conditioned : Conditioned
    cycles : Cycles
    demodulated : Demodulated
    params : Params, optional

    Notes
    -----
    From five windows :math:`c_j = A_j e^{i(\\varphi_j - \\omega t_j)}` on one side the sixth is continued by the median
    of the ten straight lines through two of them, in the plane and in logarithm and angle; what bends alike on both
    sides is continued alike. The lesser of the differences of both sides is held against the noise and against the
    same differences all over the record.
    """
    params = params or Params()
    held = _held(conditioned, cycles)
    if held is not None:
        return held
    if demodulated.t.size < params.least_windows:
        return None
    seen = _Seen.of(demodulated)
    moving = seen.moving()
    if moving < (1.0 - params.rest_share) * seen.t.size:
        return _faded(seen, moving)
    if seen.fall > STRONG or seen.runs_on(params.sigmas):
        return None
    # Echoes in clusters all over a record pull whole windows: what looks like a touch there is none.
    if median(demodulated.count) < ECHOED * np.max(demodulated.count):
        return None
    across = seen.across()
    # A third of the windows show what the motion does by itself, however much the hand did in the others.
    usual = float(np.quantile(across[REACH:-REACH], 0.3)) / THIRD
    bound = params.sigmas * max(3.0 * math.sqrt(0.5) * seen.u, usual)
    breaks = _peaks(across / np.maximum(bound, params.share * seen.around), REACH)
    edges = [-1, *breaks, seen.t.size]
    parts = [_trimmed(seen, first + 1, stop, bound, params.share) for first, stop in itertools.pairwise(edges)]
    return _chosen(seen, parts, conditioned)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The windows in a frame that turns with the oscillation: times in s, amplitudes in the plane, and logarithms.

    Those that are sound scatter as most do, and lack no samples.
    """

    t: F8
    plane: C16
    logarithm: C16
    u: float
    sound: NDArray[np.bool_]
    around: F8  # the greatest amplitude among a window and the two on either side, m

    @classmethod
    def of(cls, demodulated: Demodulated) -> _Seen:
        t, size = demodulated.t, np.abs(demodulated.amplitude)
        u = median(np.sqrt(demodulated.covariance[:, 0, 0]))
        strong = size > 10.0 * u
        both = strong[1:] & strong[:-1]
        steps = (np.diff(demodulated.phase) / np.diff(t))[both]
        omega = median(steps) if steps.size else demodulated.angular_frequency
        plane = demodulated.amplitude * np.exp(1j * (demodulated.phase - omega * t))
        logarithm = np.log(np.maximum(size, u + 1e-300)) + 1j * np.unwrap(np.angle(plane))
        # A break within a window leaves it more scatter than others, or samples that were taken for false echoes.
        count = demodulated.count
        sound = (demodulated.noise <= 1.3 * median(demodulated.noise)) & (count >= 0.95 * median(count))
        wrapped = np.concatenate([size[-2:], size, size[:2]])
        around = np.max([wrapped[i : i + size.size] for i in range(5)], axis=0)
        return cls(t, plane, logarithm, u, sound, around)

    @property
    def spacing(self) -> float:
        """Time between windows, s."""
        return median(np.diff(self.t))

    @property
    def fall(self) -> float:
        """Logarithm by which the amplitude falls from window to window after its greatest."""
        first = int(np.argmax(np.abs(self.plane)))
        steps = -np.diff(self.logarithm.real[first : first + REACH + 2])
        return median(steps) if steps.size else 0.0

    def moving(self) -> int:
        """Number of windows up to the last two running that stand out of the noise."""
        out = np.abs(self.plane) > MOVING * self.u
        pairs = np.flatnonzero(out[1:] & out[:-1])
        return int(pairs[-1]) + 2 if pairs.size else 0

    def runs_on(self, sigmas: float) -> bool:
        """Whether straight lines in the plane are enough to see that nothing breaks the motion; in 0.1 ms."""
        left = np.convolve(self.plane, np.concatenate([[0.0], LINE]), "valid")  # of window k + 5, from those before
        right = np.convolve(self.plane, np.concatenate([LINE[::-1], [0.0]]), "valid")  # of window k, from those after
        bound = 0.7 * sigmas * 3.0 * math.sqrt(0.5) * self.u
        inner = np.abs(left[:-REACH] - right[REACH:]) if left.size > REACH else np.zeros(1)
        ends = np.abs(np.concatenate([self.plane[:2] - right[:2], self.plane[-2:] - left[-2:]]))
        return bool(inner.max() < bound and ends.max() < bound)

    def continued(self, values: C16, k: NDArray[np.int64], side: int) -> C16:
        """Return what the windows on one side (-1 or 1) of windows k continue to there."""
        rows = k[:, None] + side * np.arange(1, REACH + 1)
        t, v = self.t[rows] - self.t[k][:, None], values[rows]
        i, j = PAIRS
        lines = v[:, i] - t[:, i] * (v[:, j] - v[:, i]) / (t[:, j] - t[:, i])
        both = np.sort(np.stack([lines.real, lines.imag]), axis=2)  # a fifth of the time of numpy.median
        real, imaginary = 0.5 * (both[:, :, 4] + both[:, :, 5])
        return np.asarray(real + 1j * imaginary)

    def change(self, values: C16, k: NDArray[np.int64], one: int, other: int) -> C16:
        """Return what the one side of windows k must be changed by to be the other; 0 stands for the windows."""
        here, there = (values[k] if side == 0 else self.continued(values, k, side) for side in (one, other))
        return there - here

    def difference(self, k: NDArray[np.int64], one: int, other: int) -> F8:
        """Return by how much two sides contradict each other at windows k, m."""
        relative = self.change(self.logarithm, k, one, other)
        size = self.around[k] * np.hypot(relative.real, _turned(relative.imag))
        return np.minimum(np.abs(self.change(self.plane, k, one, other)), size)

    def across(self) -> F8:
        """(w,): how far both sides contradict each other, m; 0 near the ends."""
        found = np.zeros(self.t.size)
        k = np.arange(REACH, self.t.size - REACH)
        found[k] = self.difference(k, -1, 1)
        return found


def _turned(angle: F8) -> F8:
    """An angle less whole turns, rad."""
    return np.asarray(np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi)


def _peaks(height: F8, apart: int) -> list[int]:
    """Indices of the peaks above 1, the highest taken first, none nearer than ``apart`` to another; in order."""
    left, found = height.copy(), []
    while float(left.max()) > 1.0:
        k = int(left.argmax())
        found.append(k)
        left[max(k - apart, 0) : k + apart + 1] = 0.0
    return sorted(found)


def _trimmed(seen: _Seen, start: int, stop: int, bound: float, share: float) -> tuple[int, int]:
    """Return the windows of a part without those at either end that do not continue what lies within it."""
    least = np.maximum(bound, share * seen.around)
    if stop - start >= REACH + 4:
        first, final = np.array([start, start + 1]), np.array([stop - 1, stop - 2])
        off = first[seen.difference(first, 0, 1) > least[first]].tolist()
        late = final[seen.difference(final, -1, 0) > least[final]].tolist()
        start, stop = max(off, default=start - 1) + 1, min(late, default=stop)
    # Beside a break a window may hold a little of it.
    start += int(start > 0 and not seen.sound[start])
    stop -= int(stop < seen.t.size and not seen.sound[stop - 1])
    return start, stop


def _chosen(seen: _Seen, parts: list[tuple[int, int]], conditioned: Conditioned) -> Segments | None:
    """Return the longest of the parts that oscillate, and what lies beside it."""
    parts = [part for part in parts if part[1] > part[0]]
    # A decay that outlasts its motion is small for most of its time: where it began counts too.
    whole, begun = (
        np.array([np.median(np.abs(seen.plane[first : min(stop, first + most)])) for first, stop in parts])
        for most in (seen.t.size, REACH)
    )
    size = np.maximum(whole, begun)
    free = size > STILL * size.max()
    length = np.array([stop - first for first, stop in parts])
    chosen = int(np.argmax(np.where(free, length, 0)))
    start, stop = parts[chosen]
    if (start, stop) == (0, seen.t.size):
        return None
    t = conditioned.track.t[conditioned.used]
    half = 0.5 * seen.spacing
    limits = [(float(seen.t[a]) - half, float(seen.t[b - 1]) + half) for a, b in parts]
    spans, before = [], float(t[0])
    for n, (first_s, last_s) in enumerate(limits):
        if first_s - before > half:
            spans.append(Span("handled", before, first_s))
        if n != chosen:
            still = size[n] < 10.0 * seen.u
            spans.append(Span("free" if free[n] else "at_rest" if still else "handled", max(first_s, before), last_s))
        before = last_s
    if float(t[-1]) - before > half:
        spans.append(Span("handled", before, float(t[-1])))
    breaks = [_break(seen, a[1], b[0]) for a, b in itertools.pairwise(itertools.compress(parts, free))]
    first_s = limits[chosen][0] if start > 0 else float(t[0])
    last_s = limits[chosen][1] if stop < seen.t.size else float(t[-1])
    return Segments(first_s, last_s, tuple(spans), tuple(breaks))


def _break(seen: _Seen, stop: int, start: int) -> Break:
    """What happened between the last window of one free oscillation and the first of the next."""
    before = seen.continued(seen.logarithm, np.array([max(stop, REACH)]), -1)
    after = seen.continued(seen.logarithm, np.array([min(start - 1, seen.t.size - REACH - 1)]), 1)
    change = (after - before)[0]
    first_s, last_s = float(seen.t[stop - 1]), float(seen.t[start])
    angle = float(_turned(change.imag))
    alone = abs(change.real) < min(TURNED, abs(angle) / 3.0)
    kind = "restarted" if start - stop >= PAUSE else "phase_jump" if alone else "touched"
    return Break(kind, 0.5 * (first_s + last_s), 0.25 * (last_s - first_s), math.expm1(change.real), angle)


def _faded(seen: _Seen, moving: int) -> Segments | None:
    """The record up to where its motion is lost in the noise for good."""
    if moving < 2:
        return None
    last_s = float(seen.t[moving - 1]) + seen.spacing
    return Segments(-math.inf, last_s, (Span("at_rest", last_s, float(seen.t[-1]) + 0.5 * seen.spacing),))


def _held(conditioned: Conditioned, cycles: Cycles) -> Segments | None:
    """The longer side of a plateau on which the distance stays for the greater part of a period, and longer."""
    rows = np.flatnonzero(conditioned.flags & np.uint8(Quality.CLIPPED))
    if not rows.size:
        return None
    t, used = conditioned.track.t, np.flatnonzero(conditioned.used)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(rows) > BRIDGED + 1) + 1])
    ends = np.concatenate([starts[1:], [rows.size]]) - 1
    longest = int(np.argmax(t[rows[ends]] - t[rows[starts]]))
    first, last = int(rows[starts[longest]]), int(rows[ends[longest]])
    if not t[last] - t[first] > HELD / cycles.frequency_hz:
        return None
    begin, end = float(min(t[first], t[used[0]])), float(max(t[last], t[used[-1]]))
    if t[first] - begin > end - t[last]:
        return Segments(-math.inf, float(t[first - 1]), (Span("handled", float(t[first]), end),))
    return Segments(float(t[last + 1]), math.inf, (Span("handled", begin, float(t[last])),))
