"""Lost rows: samples that are missing although the times, which are only row numbers, go on evenly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.robust import median
from pipeline.samples.condition import Conditioned
from pipeline.track import F8
from pipeline.windows.cycles import NoOscillation, find_cycles
from pipeline.windows.demodulate import Demodulated, demodulate

EVEN = 1e-3  # maximum deviation of the times from equal steps, in steps, for times that are row numbers
# Numbers of samples on either side of a place from which its phases are fitted.
LENGTHS: tuple[int, ...] = (*range(8, 32), 40, 56, 80, 112)
# Standard uncertainty of a step of the phase, in steps of one lost sample, that the fits must reach.
U_STEP = 0.1
FEWEST = 4  # minimum number of places; the phase jumps of fewer are found in the windows
BETTER = 4.0  # factor by which the scatter of the windows' phases must shrink once the times are put right
STEP = 0.6  # least step of the phase, in steps of one lost sample, at which lost samples are sought
COUNTS = (0, 1, 2, 3, 4, -1)  # numbers of samples lost at one place; a step back shows that something else goes on
BACK = 0.1  # maximum share of the steps that go back
CLEARER = 0.6  # factor by which lost samples must lower the residual about their place
WEAKEST = 0.05  # quantile of the amplitudes from which the noise of the steps follows
REACHES = (1.0, 1.5, 2.0)  # samples about a step in which it is placed, over those on one side of it
ROUNDS = 2  # searches, each with the frequency that follows from the lost samples found so far
USED = 0.9  # minimum share of samples that are used
MOST = 0.2  # maximum share of lost samples


@dataclass(frozen=True, slots=True, eq=False)
class LostRows:
    """Samples that are missing in a record."""

    share: float  # share of the samples that are missing
    places: int  # number of places where some are missing
    samples: Conditioned  # the record with times that count the lost samples


def find_lost_rows(samples: Conditioned, windows: Demodulated) -> LostRows | None:
    """Return what shows that samples were lost; None if nothing does.

    A lost sample advances the phase by :math:`\\omega h` at once. Sinusoids of known frequency are fitted to L samples
    before and after every place, and their phases are compared. About a step, one sinusoid with lost samples at any
    place must leave far less than one without. The places are believed if the phases of the windows scatter far less
    once the times count the lost samples.
    """
    track, step_s = samples.track, _even_step(samples)
    if step_s is None or windows.t.size < 8:
        return None
    before = _scatter(windows)
    if before < BETTER * float(np.mean(windows.covariance[:, 1, 1])):
        return None
    rest = np.polynomial.Polynomial.fit(windows.t, windows.offset, 2)
    y, omega = track.y - rest(track.t), windows.angular_frequency
    ratio = samples.noise_m / max(float(np.quantile(np.abs(windows.amplitude), WEAKEST)), 1e-300)
    length = _samples_needed(ratio, omega * step_s)
    if length is None:
        return None
    best, found = before / BETTER, None
    for reach in REACHES:
        turn, lost = omega * step_s, np.zeros(len(track), np.int64)
        for _ in range(ROUNDS):
            for _ in range(ROUNDS):  # at most places no sample is lost, so the typical advance shows the true frequency
                turn *= 1.0 + (median(_ahead(y, turn, length)) - 1.0) / length
            lost = _steps(y, turn, length, int(reach * length))
            back = np.count_nonzero(lost < 0)
            lost = np.maximum(lost, 0)
            places = np.count_nonzero(lost)
            if places < FEWEST or lost.sum() > MOST * len(track) or back > BACK * places:
                break
            trial = _counted(samples, lost)
            if isinstance(cycles := find_cycles(trial), NoOscillation):
                break
            windows = demodulate(trial, cycles)
            turn = windows.angular_frequency * step_s
            if (scatter := _scatter(windows)) < best:
                best, found = scatter, LostRows(float(lost.sum()) / len(track), int(places), trial)
    return found


def _even_step(samples: Conditioned) -> float | None:
    """Return the step between times that are row numbers, s; None if they are not, or if many samples are left out."""
    t = samples.track.t
    if t.size < 2 or np.mean(samples.used) < USED:
        return None
    step_s = float(t[-1] - t[0]) / (t.size - 1)
    return step_s if step_s > 0.0 and np.abs(np.diff(t) / step_s - 1.0).max() <= EVEN else None


def _counted(samples: Conditioned, lost: NDArray[np.int64]) -> Conditioned:
    track = samples.track
    step_s = float(track.t[-1] - track.t[0]) / (len(track) - 1)
    return replace(samples, track=replace(track, t=track.t + step_s * np.cumsum(lost)))


def _samples_needed(ratio: float, turn: float) -> int | None:
    """Return the samples on each side whose fits tell one lost sample; None if those of half a period do not.

    ``ratio`` is the noise over the amplitude.
    """
    for length in LENGTHS:
        if length * turn > math.pi:
            break
        _, after = _at_edge(turn, length)
        # Sine and cosine are known worst where the other one is stationary; both sides add up.
        worst = max(float(np.linalg.norm(after.real)), float(np.linalg.norm(after.imag)))
        if ratio * math.sqrt(2.0) * worst < U_STEP * turn:
            return length
    return None


def _at_edge(turn: float, length: int) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the weights (length,) that give the phasor at the last sample before a place and the first after it."""
    angle = turn * np.arange(length)
    pinv = np.linalg.pinv(np.stack([np.cos(angle), -np.sin(angle)], axis=1))
    after = pinv[0] + 1j * pinv[1]
    return np.conj(after[::-1]), after


def _ahead(y: F8, turn: float, length: int) -> F8:
    """Return (m,) the steps by which the phase advances from sample length - 1 on, each over that of one sample."""
    before, after = _at_edge(turn, length)
    first = np.correlate(y, np.conj(before), "valid")  # phasor at sample length - 1 + i
    second = np.correlate(y, np.conj(after), "valid")  # phasor at sample i
    return np.asarray(np.angle(second[length:] * np.conj(first[:-length])) / turn)


def _steps(y: F8, turn: float, length: int, reach: int) -> NDArray[np.int64]:
    """Return (n,) the numbers of lost samples before each sample, from the strongest step of the phase on."""
    ahead = _ahead(y, turn, length) - 1.0
    lost = np.zeros(y.size, np.int64)
    size = np.abs(ahead)
    while size.size and size.max() > STEP:
        k = int(np.argmax(size))
        place, count = _place(y, turn, k + length, reach)
        if count:
            lost[place] = count
        near = place if count else k + length
        size[max(min(k, near - length) - length + 1, 0) : max(k, near - length) + length] = 0.0
    return lost


def _place(y: F8, turn: float, about: int, reach: int) -> tuple[int, int]:
    """Return where and how many samples were lost, from one sinusoid through the samples about a place; 0 if none.

    A count below 0 is a step back. The sums of the normal equations before and after every place are cumulative sums.
    """
    first = max(about - reach, 0)
    part = y[first : about + reach]
    places = np.arange(max(about - reach // 2 - first, 1), min(about + reach // 2 - first, part.size - 1))
    angle, power = turn * np.arange(part.size), float(part @ part)
    sums = np.array([_sums(np.cos(angle + turn * count), np.sin(angle + turn * count), part) for count in COUNTS])
    both = sums[:1, :, places] + sums[:, :, -1:] - sums[:, :, places]
    cc, cs, ss, cy, sy = both.transpose(1, 0, 2)
    left = power - (cy**2 * ss - 2.0 * cy * sy * cs + sy**2 * cc) / (cc * ss - cs**2)
    best = np.unravel_index(int(np.argmin(left)), left.shape)
    if not left[best] < CLEARER * left[0, 0]:
        return about, 0
    return first + int(places[best[1]]), COUNTS[best[0]]


def _sums(cosine: F8, sine: F8, y: F8) -> F8:
    """Return (5, n + 1): sums of the products in the normal equations over the samples before each place."""
    products = np.array([cosine * cosine, cosine * sine, sine * sine, cosine * y, sine * y])
    return np.concatenate([np.zeros((5, 1)), np.cumsum(products, axis=1)], axis=1)


def _scatter(windows: Demodulated) -> float:
    """Return the mean squared deviation of the windows' phases from a parabola, rad^2."""
    fitted = np.polynomial.Polynomial.fit(windows.t, windows.phase, 2)
    return float(np.mean((windows.phase - fitted(windows.t)) ** 2))
