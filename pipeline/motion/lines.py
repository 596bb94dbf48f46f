"""Lines: a record as a sum of decaying oscillations, and a line among them that is not the free oscillation's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.modes.mode import rotating
from pipeline.modes.search import HIGHEST_MODE
from pipeline.motion.fit import Rows, fit
from pipeline.motion.fitted import ClosedMotion
from pipeline.notice import Refusal
from pipeline.numerics.estimate import Joint
from pipeline.numerics.levels import (
    FEWEST_FOR_CURVE,
    FEWEST_FOR_MEDIAN,
    IMPROBABLE,
    NEGLIGIBLE,
    NOTICEABLE,
    OUTLIER,
    ROUNDS,
    SIGNIFICANT,
)
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.robust import median
from pipeline.samples.condition import ONE_VALUE, Samples
from pipeline.track import F8, Bools
from pipeline.units import amount

# Share of the strongest line's amplitude from which another one counts; a weaker one has a negligible power.
WEAKER = math.sqrt(NEGLIGIBLE)
MOST = 100_000  # maximum number of median spacings, whose fit takes 0.3 s as measured; longer records are not fitted
# Frequencies of the mains and their doubles, Hz, and how far they stray: EN 50160 allows 1 % in 99.5 % of a year.
MAINS_HZ, MAINS_SHARE = (50.0, 60.0, 100.0, 120.0), 0.01
# Distance in bins, the reciprocals of the length of the record, within which a decay or a change of the frequency has
# sidebands, as measured on the wide pendulum and the lost rows of `python -m tests.trials.grades kinds`.
SIDEBANDS = 3.0
MODE_PARAMETERS = ("rest", *(f"{m}_{n}" for m in ("first", "second") for n in ("cosine", "sine", "omega", "decay")))

Cause = Literal["drive", "mains", "overtone"]
"""What keeps up a line that is not the free oscillation's, or that it is an overtone."""


@dataclass(frozen=True, slots=True)
class DecayingModes:
    """The model of some decaying modes: rest position, then a, b, omega and g of each."""

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the positions (n,) at t, and a function that gives their derivatives (n, p)."""
        total, slopes = np.full(t.size, values[0]), [np.ones_like(t)]
        for a, b, omega, g in values[1:].reshape(-1, 4):
            fall = np.exp(-np.clip(g * t, -20.0, 200.0))
            cosine, sine = fall * np.cos(omega * t), fall * np.sin(omega * t)
            wave = a * cosine + b * sine
            total = total + wave
            slopes += [cosine, sine, t * (b * cosine - a * sine), -t * wave]
        return total, lambda: np.stack(slopes, axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """The samples used of a record, over their standard deviation, with times from the first one."""

    tau: F8
    values: F8
    used: Bools  # (n,)
    level: float  # mean
    scale: float  # standard deviation
    start_s: float

    @classmethod
    def of(cls, samples: Samples) -> Scaled | None:
        """Return the record; None if it is too short, too long or motionless."""
        used = samples.used & np.isfinite(samples.track.t)
        t, y = samples.track.t[used], samples.track.y[used]
        scale = float(np.std(y))
        if (
            y.size < 4 * FEWEST_FOR_CURVE
            or scale <= ONE_VALUE * float(np.max(np.abs(y)))
            or not 0.0 < t[-1] - t[0] < MOST * float(np.median(np.diff(t)))
        ):
            return None
        level = float(y.mean())
        return cls(t - t[0], (y - level) / scale, used, level, scale, float(t[0]))

    @property
    def seconds(self) -> float:
        """Length of the record, s."""
        return float(self.tau[-1])

    def thinned(self, omega: float) -> Scaled:
        """Return every so many of the samples that a line of an angular frequency, rad/s, has eight in each period."""
        step = max(1, int(math.tau / (8.0 * omega * float(np.median(np.diff(self.tau))))))
        return replace(self, tau=self.tau[::step], values=self.values[::step])

    def spectrum(self, values: F8, finer: int) -> tuple[F8, F8]:
        """Return angular frequencies, rad/s, and powers of values (n,), so many in each bin, at even times or not."""
        from scipy.fft import next_fast_len

        step = float(np.median(np.diff(self.tau)))
        grid = np.arange(int(self.tau[-1] / step) + 1) * step
        size = next_fast_len(finer * grid.size, real=True)
        line = np.fft.rfft(np.interp(grid, self.tau, values), size)
        power = np.asarray(line.real**2 + line.imag**2, np.float64)
        power[: math.ceil(size / grid.size)] = 0.0  # lines below one period per record count as drift
        return 2.0 * math.pi * np.arange(power.size, dtype=np.float64) / (size * step), power

    def strongest(self, values: F8) -> float:
        """Return the angular frequency of the strongest line of values (n,), rad/s."""
        # The next line is sought in what this one leaves, so that an eighth of a bin matters.
        omega, power = self.spectrum(values, 8)
        return float(omega[np.argmax(power)])

    def linear(self, *lines: tuple[float, float]) -> F8:
        """Return the parameters of modes of given frequency and decay: rest position, then a, b, omega, g of each."""
        columns = [np.exp(-g * self.tau) * wave(omega * self.tau) for omega, g in lines for wave in (np.cos, np.sin)]
        solved = np.linalg.lstsq(np.stack([np.ones_like(self.tau), *columns], axis=1), self.values, rcond=None)[0]
        each = [[solved[1 + 2 * i], solved[2 + 2 * i], *line] for i, line in enumerate(lines)]
        return np.concatenate([solved[:1], *each])

    def less(self, values: F8) -> F8:
        """Return what modes leave of the record, (n,)."""
        return np.asarray(self.values - DecayingModes().at(self.tau, values)[0])

    def fitted(self, start: F8) -> DecayingLines | None:
        """Fit decaying modes together; None if the record does not determine them."""
        every = np.ones(self.tau.size, np.bool_)
        found = fit(DecayingModes(), Rows(self.tau, self.values, every, every), start)
        if not np.all(np.isfinite(found.covariance)):
            return None
        count, correlation = max(every.size - start.size, 1), correlation_length(found.residual)
        widened = found.covariance * (float(found.residual @ found.residual) / count * correlation)
        return DecayingLines(self, found.values, widened, found.residual, max(count / correlation, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class DecayingLines:
    """Decaying oscillations fitted together, over the scatter of the record and from its first time."""

    record: Scaled
    values: F8  # as of :class:`DecayingModes`
    covariance: F8  # (p, p); widened by the residual and its correlation
    residual: F8
    dof: float  # number of independent samples less that of the parameters

    @property
    def left(self) -> float:
        """Share of the variance that the lines do not describe."""
        return float(self.residual @ self.residual) / self.residual.size

    @property
    def sizes(self) -> F8:
        """Amplitudes at the start, over the scale."""
        return np.hypot(self.values[1::4], self.values[2::4])

    @property
    def omegas(self) -> F8:
        """Angular frequencies, rad/s."""
        return np.abs(self.values[3::4])

    @property
    def rates(self) -> F8:
        """Decay rates, 1/s."""
        return np.asarray(self.values[4::4])

    def leaves_noise(self, samples: Samples) -> bool:
        """Return whether the lines leave no more than noise, whose estimates by both ways scatter as in white noise."""
        chance = OUTLIER * math.sqrt(8.5 / self.residual.size)
        noise = (samples.noise_of_reading / self.record.scale) ** 2
        # Where each period has few samples, neighbours differ by the motion, and what seems noise is far larger.
        return 0.25 * noise < self.left < (1.0 + chance) * noise

    def are_several(self) -> bool:
        """Return whether these are several oscillations, and not one that changes or is no sinusoid.

        Each is at least a tenth of the strongest, lasts for several periods and does not grow, none is a multiple of
        another. Within a bin there are only two, whose frequencies differ significantly and whose rates do not; others
        imitate a frequency that changes.
        """
        omegas, rates, u = np.sort(self.omegas), self.rates, np.sqrt(np.diag(self.covariance)[4::4])
        ratios, bins = omegas[1:] / omegas[0], np.diff(omegas) * self.record.seconds / math.tau
        beside = np.abs(ratios - np.round(ratios)) * omegas[0] * self.record.seconds < math.tau
        lasting = (rates < self.omegas / (math.tau * ROUNDS)) & (rates > -2.0 * u)
        return bool(
            omegas.size > 1
            and np.all(lasting)
            and np.min(self.sizes) > NEGLIGIBLE * np.max(self.sizes)
            and not np.any(beside & (np.round(ratios) > 1.0))
            and (np.min(bins) >= 1.0 or (omegas.size == 2 and self._differs(3) and not self._differs(4)))
        )

    def _differs(self, number: int) -> bool:
        """Return whether the frequency (3) or the decay rate (4) of two lines differs significantly."""
        weights = np.zeros(self.values.size)
        weights[[number, number + 4]] = -1.0, 1.0
        return abs(float(weights @ self.values)) > SIGNIFICANT * math.sqrt(weights @ self.covariance @ weights)

    def listed(self, unit: str) -> str:
        """Return frequencies and amplitudes at the start in words, the strongest first."""
        order = np.argsort(-self.sizes).tolist()
        scale, hz = self.record.scale, self.omegas / math.tau
        return ", ".join(f"{amount(scale * float(self.sizes[i]), unit)} at {hz[i]:.4g} Hz" for i in order)


def find_several(samples: Samples) -> DecayingLines | None:
    """Fit lines together, one more at a time, until they leave no more than noise; None if they always leave more.

    Each one starts from the highest peak of what the others leave, or half a bin beside one that has it within a bin.
    They are sought with as many samples as the highest of them needs, and fitted to all when they are found.
    """
    record = Scaled.of(samples)
    if record is None or record.tau.size > MOST // ROUNDS:
        return None
    lines: list[tuple[float, float]] = []
    left = record.values
    for _ in range(ROUNDS):
        omega, decay = record.strongest(left), 0.0
        for other, rate in lines:
            if abs(omega - other) * record.seconds < math.tau:
                omega, decay = other + math.copysign(math.pi / record.seconds, omega - other), rate
        few = record.thinned(max(omega, *(other for other, _ in lines), 0.0))
        found = few.fitted(few.linear(*lines, (omega, decay)))
        # Nor are lines several that stay below a tenth of the strongest, however many more there are.
        if found is None or np.min(found.sizes) < NEGLIGIBLE * np.max(found.sizes):
            return None
        lines = list(zip(found.omegas.tolist(), found.rates.tolist(), strict=True))
        left = record.less(found.values)
        if replace(found, residual=left).leaves_noise(samples):
            return record.fitted(found.values)
    return None


class TwoModes(ClosedMotion):
    """Two oscillations, the stronger ("first") and the other one, neither of which is the main one.

    The parameters are the rest position, then the cosine and sine amplitudes at ``start_s``, angular frequency and
    decay rate of each mode.
    """


def find_two_modes(samples: Samples) -> TwoModes | Refusal:
    """Return the two modes that a record consists of, or refuse them if they do not describe it.

    :math:`o + \\sum_i e^{-g_i t}(a_i\\cos\\omega_i t + b_i\\sin\\omega_i t)` is fitted to all samples used, started
    from the strongest line of the spectrum and the strongest line of the residual of the first. Covariances are scaled
    by the residuals, including their correlation.
    """
    if (record := Scaled.of(samples)) is None:
        return Refusal("no_two_modes")
    first = record.strongest(record.values)
    second = record.strongest(record.less(record.linear((first, 0.0))))
    lines = record.fitted(record.linear((first, 0.0), (second, 0.0)))
    if lines is None or not lines.left < NEGLIGIBLE:
        return Refusal("no_two_modes")
    strong, weak = np.argsort(-lines.sizes).tolist()
    omegas, sizes = lines.omegas, lines.sizes
    slow, fast = float(np.min(omegas)), float(np.max(omegas))
    few = slow * record.seconds < 2.0 * math.pi * FEWEST_FOR_MEDIAN
    if few or sizes[weak] < WEAKER * sizes[strong]:
        return Refusal("no_two_modes")
    # A component at a multiple of the slower frequency is not a second mode but a harmonic, as of a square wave.
    if round(fast / slow) > 1 and abs(fast - round(fast / slow) * slow) * record.seconds < math.pi:
        return Refusal("no_two_modes")
    order = [0, *(k for i in (strong, weak) for k in range(1 + 4 * i, 5 + 4 * i))]
    # Back to the unit of the record; the rest position was measured from the mean.
    scale, unit = record.scale, samples.track.unit
    turn = np.array([scale, *(2 * (scale, scale, 1.0, 1.0))])
    level = np.array([record.level, *(8 * (0.0,))])
    units = (unit, *(2 * (unit, unit, "rad/s", "1/s")))
    covariance = lines.covariance[np.ix_(order, order)] * np.outer(turn, turn)
    joint = Joint(MODE_PARAMETERS, lines.values[order] * turn + level, covariance, units)
    residual = np.full(len(samples.track), np.nan)
    residual[record.used] = scale * lines.residual
    return TwoModes(
        joint=joint,
        dof=lines.dof,
        noise=samples.noise_estimate,
        start_s=record.start_s,
        residual=residual,
        flags=samples.flags,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Apart:
    """A line that is not the free oscillation's, and that is subtracted before the analysis."""

    frequency_hz: float
    amplitude: float  # at the start
    cause: Cause
    wave: F8  # (n,) at the times of the record


def find_apart(samples: Samples) -> Apart | None:
    """Return the line of a drive, of the mains or of an overtone beside the free oscillation; None if there is none.

    A drive keeps up its own oscillation while the free one falls. It must be the strongest line, its fall less than a
    tenth of what the rate of the other would give it, by more than two standard uncertainties, and the other one at
    least a third of it at the start, as after a start from rest. Mains hum may have any size. An overtone is far above
    the strongest line, is no multiple of it, and at least a tenth of it at the start.
    """
    record = Scaled.of(samples)
    if record is None:
        return None
    steps = np.diff(record.tau)
    # Over a long gap, or at uneven times, interpolated values would have other lines.
    if float(np.max(steps)) > NEGLIGIBLE * record.seconds or float(np.std(steps)) > 0.5 * float(np.mean(steps)):
        return None
    omega, power = record.spectrum(record.values, 2)
    first = float(omega[np.argmax(power)])
    for second in _others(record, first):
        # Most records have no such line, which a part of the samples shows in a tenth of the time.
        if _kept_up(record.thinned(max(first, second)), samples, first, second) is None:
            continue
        if (found := _kept_up(record, samples, first, second)) is not None:
            lines, number, cause = found
            parameters = np.concatenate([[0.0], lines.values[1 + 4 * number : 5 + 4 * number]])
            t = np.nan_to_num(samples.track.t - record.start_s)
            size, hz = record.scale * float(lines.sizes[number]), float(lines.omegas[number]) / math.tau
            return Apart(hz, size, cause, record.scale * DecayingModes().at(t, parameters)[0])
    return None


def _kept_up(record: Scaled, samples: Samples, first: float, second: float) -> tuple[DecayingLines, int, Cause] | None:
    """Return two lines that describe a record, the number of the one that is not the free oscillation's, and why."""
    lines = record.fitted(record.linear((first, 0.0), (second, 0.0)))
    # What the two leave beyond the noise must be below a tenth of what they describe. Close lines must leave noise
    # only, because a frequency that changes has sidebands.
    if lines is None or lines.left > min(NEGLIGIBLE**2 + (samples.noise / record.scale) ** 2, NEGLIGIBLE):
        return None
    if float(np.ptp(lines.omegas)) * record.seconds < SIDEBANDS * math.tau and not lines.leaves_noise(samples):
        return None
    for number in (0, 1):
        if (cause := _cause(lines, number)) is not None:
            return lines, number, cause
    return None


def _others(record: Scaled, first: float) -> Iterator[float]:
    """Yield the highest line beside a steady first one, and that far above it and beside its multiples.

    Neither may be one of the noise, nor a sideband of the first one's decay, which a few samples in each period give.
    """
    part, rate = record.thinned(first), 0.0
    single = part.fitted(part.linear((first, 0.0)))
    if single is not None and abs(float(single.omegas[0]) - first) * record.seconds < math.tau:
        first, rate = float(single.omegas[0]), max(float(single.rates[0]), 0.0)
    wave = rotating(np.exp(-rate * record.tau), first * record.tau)
    # Times the time too, because what falls is no exponential alone.
    share = record.tau / record.seconds
    rows = np.stack([np.ones(wave.size), *(x for each in (wave, share * wave) for x in (each.real, each.imag))])
    # Normal equations of five rows take a tenth of the time of a decomposition.
    size = np.linalg.lstsq(rows @ rows.T, rows @ record.values, rcond=None)[0]
    omega, left = record.spectrum(record.values - size @ rows, 2)
    room = math.tau / record.seconds
    beside = np.abs(omega - first * np.round(omega / first))
    far = (omega > HIGHEST_MODE * first) & (beside > room + NOTICEABLE * omega)
    for among in (left > 0.0, far):
        if np.count_nonzero(among) <= FEWEST_FOR_CURVE:
            continue
        peak, line = float(np.max(left[among])), float(omega[among][np.argmax(left[among])])
        floor = median(left[among]) / math.log(2.0)
        if abs(line - first) > room and peak > math.log(record.tau.size / IMPROBABLE) * floor:
            yield line


def _cause(lines: DecayingLines, number: int) -> Cause | None:
    """Return what keeps up one of two lines, or that it is an overtone; None if it is the free oscillation."""
    other, sizes, omegas, rates = 1 - number, lines.sizes, lines.omegas, lines.rates
    mains = any(abs(float(omegas[number]) / math.tau - each) < MAINS_SHARE * each for each in MAINS_HZ)
    u_rates = np.sqrt(np.diag(lines.covariance)[4::4])
    if abs(omegas[0] - omegas[1]) * lines.record.seconds < math.tau:
        return None  # the fit of a single one that does not fall as an exponential
    # The other one must last for a few periods, or it is no oscillation but a disturbance at the start.
    if rates[other] > omegas[other] / (math.tau * FEWEST_FOR_MEDIAN):
        return None
    weights, seconds = np.zeros(9), lines.record.seconds
    weights[[4 + 4 * number, 4 + 4 * other]] = 1.0, -NEGLIGIBLE
    slower = float(weights @ lines.values) < -2.0 * math.sqrt(float(weights @ lines.covariance @ weights))
    # The other one falls to its half at least, far beyond its uncertainty. What is kept up does not; a free oscillation
    # that falls slowly beside a swing that falls fast does.
    falls = rates[other] > max(OUTLIER * u_rates[other], math.log(2.0) / seconds)
    kept_up = slower and rates[number] < max(OUTLIER * u_rates[number], NOTICEABLE / seconds)
    if falls and kept_up and (mains or (number == 0 and sizes[1] > WEAKER * sizes[0])):
        return "mains" if mains else "drive"
    if number == 0 or omegas[1] < HIGHEST_MODE * omegas[0] or sizes[1] < NEGLIGIBLE * sizes[0]:
        return None
    if omegas[0] * lines.record.seconds < FEWEST_FOR_CURVE * math.tau:
        return None  # a slow line of few periods may be a rest position that moves
    if rates[1] > omegas[1] / (math.tau * ROUNDS) or rates[1] < -2.0 * u_rates[1]:
        return None
    return "mains" if mains and rates[1] < OUTLIER * u_rates[1] else "overtone"
