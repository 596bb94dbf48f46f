"""Lost rows: samples that are missing although the times, which are only row numbers, go on evenly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import count, takewhile

import numpy as np

from pipeline.notice import Refusal
from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_CURVE, FEWEST_FOR_MEDIAN, IMPROBABLE, NEGLIGIBLE, ROUNDS
from pipeline.numerics.regression import chi2_quantile
from pipeline.numerics.robust import median
from pipeline.samples.condition import Samples
from pipeline.track import F8
from pipeline.windows.cycles import find_cycles
from pipeline.windows.demodulate import Windows, demodulate

# Maximum deviation of times that are row numbers from equal steps, in steps: that of times printed to 10 us at 100 Hz.
# Times measured by a host jitter by ten times as much.
EVEN = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class LostRows:
    """Samples that are missing in a record."""

    share: float  # share of the samples that are missing
    places: int  # number of places where some are missing
    samples: Samples  # the record with times that count the lost samples


def find_lost_rows(samples: Samples, windows: Windows) -> LostRows | None:
    """Return what shows that samples were lost; None if nothing does.

    A lost sample advances the phase by :math:`\\omega h` at once. Sinusoids of known frequency are fitted to at most
    half a period before and after every place, and their phases are compared. Steps ahead are believed if they are
    near whole samples and hardly any go back, and if the phases of the windows scatter significantly less about a
    parabola once the times count the lost samples (F test). The steps of up to three places are ``phase_jump``.
    """
    from scipy.special import fdtri

    track, step_s, free = samples.track, _even_step(samples), windows.t.size - 3
    if step_s is None or windows.t.size < FEWEST_FOR_CURVE:
        return None
    before = _scatter(windows)
    if before < chi2_quantile(1.0 - FALSE_ALARM, free) / free * float(np.mean(windows.covariance[:, 1, 1])):
        return None
    y = track.y - np.polynomial.Polynomial.fit(windows.t, windows.offset, 2)(track.t)
    turn, found = windows.angular_frequency * step_s, None
    best = before / float(fdtri(free, free, 1.0 - IMPROBABLE))
    # Few samples about a place lose fewer other places, many have less noise: each number is twice the one before.
    half_period = max(math.ceil(math.pi / turn), FEWEST_FOR_CURVE)
    for length in takewhile(half_period.__ge__, (FEWEST_FOR_CURVE << k for k in count())):
        for _ in range(ROUNDS):
            # At most places no sample is lost, so the typical advance shows the true frequency.
            turn *= 1.0 + (median(_ahead(y, turn, length)) - 1.0) / length
            if not 0.0 < turn < math.pi:
                return found  # what is rounded to one value, or full of holes, has no phase that advances
            if (lost := _lost(y, turn, length)) is None:
                break
            trial = replace(samples, track=replace(track, t=track.t + step_s * np.cumsum(lost)))
            if isinstance(cycles := find_cycles(trial), Refusal):
                break
            windows = demodulate(trial, cycles)
            turn = windows.angular_frequency * step_s
            if (scatter := _scatter(windows)) >= best:
                break
            best, found = scatter, LostRows(float(lost.sum()) / len(track), int(np.count_nonzero(lost)), trial)
    return found


def _even_step(samples: Samples) -> float | None:
    """Return the step between times that are row numbers, s; None if they are not, or if many samples are left out."""
    t = samples.track.t
    if t.size < 2 or np.mean(samples.used) < 1.0 - NEGLIGIBLE:
        return None
    step_s = float(t[-1] - t[0]) / (t.size - 1)
    return step_s if step_s > 0.0 and np.abs(np.diff(t) / step_s - 1.0).max() <= EVEN else None


def _ahead(y: F8, turn: float, length: int) -> F8:
    """Return (m,) the steps by which the phase advances from sample length - 1 on, each over that of one sample."""
    angle = turn * np.arange(length)
    pinv = np.linalg.pinv(np.stack([np.cos(angle), -np.sin(angle)], axis=1))
    after = pinv[0] - 1j * pinv[1]  # conjugate weights, which give the phasor of the first sample
    last = np.correlate(y, np.conj(after[::-1]), "valid")
    first = np.correlate(y, after, "valid")
    return np.asarray(np.angle(first[length:] * np.conj(last[:-length])) / turn)


def _lost(y: F8, turn: float, length: int) -> F8 | None:
    """Return (n,) the whole number of lost samples before each sample; None if the steps of the phase show no loss.

    The strongest step is taken first. Steps of another cause lie anywhere between whole numbers, with a variance of
    1/12, or go back as often as ahead.
    """
    ahead = _ahead(y, turn, length) - 1.0
    size, lost, off, back = np.abs(ahead), np.zeros(y.size), list[float](), 0
    while size.size and size[k := int(np.argmax(size))] > 0.5:
        whole = round(float(ahead[k]))
        lost[k + length] = max(whole, 0)
        back += whole < 0
        off.append(ahead[k] - whole)
        size[max(k - length + 1, 0) : k + length] = 0.0
    places = np.count_nonzero(lost)
    genuine = places > FEWEST_FOR_MEDIAN and back <= NEGLIGIBLE * places and np.mean(np.square(off)) < 1.0 / 12.0
    return lost if genuine else None


def _scatter(windows: Windows) -> float:
    """Return the mean squared deviation of the windows' phases from a parabola, rad^2."""
    fitted = np.polynomial.Polynomial.fit(windows.t, windows.phase, 2)
    return float(np.mean((windows.phase - fitted(windows.t)) ** 2))
