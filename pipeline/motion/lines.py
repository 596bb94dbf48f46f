"""Lines: a record as a sum of decaying oscillations, and the one among them that a drive or the mains keep up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.motion.fit import Rows, fit
from pipeline.numerics.levels import FEWEST_FOR_CURVE, NEGLIGIBLE, OUTLIER, ROUNDS
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import Samples
from pipeline.track import F8, Bools
from pipeline.units import amount

MOTIONLESS = 64.0 * float(np.finfo(np.float64).eps)  # relative scatter of a motionless record by IEEE rounding
# Minimum ratio of a line's amplitude to the strongest one's; below it only one oscillation counts.
WEAKER = 1.0 / 3.0
MOST = 100_000  # maximum number of median spacings, whose fit takes 0.3 s as measured; longer records are not fitted
# Frequencies of the mains and their doubles, Hz, and how far they stray: EN 50160 allows 1 % in 99.5 % of a year.
MAINS_HZ, MAINS_SHARE = (50.0, 60.0, 100.0, 120.0), 0.01
APART = 3.0  # least distance of two lines in reciprocals of the record's length; sidebands of a decay lie within it


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
class DecayingLines:
    """Decaying oscillations fitted together, over the scatter of the record and from its first time."""

    values: F8  # as of :class:`DecayingModes`
    covariance: F8  # (p, p); widened by the residual and its correlation
    residual: F8
    used: Bools  # (n,) the samples of the fit
    level: float  # mean of the record
    scale: float  # its standard deviation
    start_s: float
    seconds: float
    dof: float  # number of independent samples less that of the parameters

    @property
    def left(self) -> float:
        """Share of the variance that the lines do not describe."""
        return float(self.residual @ self.residual) / self.residual.size

    @property
    def sizes(self) -> F8:
        """Amplitudes at the start, over the scale."""
        return np.hypot(self.values[1::4], self.values[2::4])

    def listed(self, unit: str) -> str:
        """Return frequencies and mean amplitudes in words, the strongest first."""
        decays = self.values[4::4] * self.seconds
        means = self.scale * self.sizes * np.array([-math.expm1(-g) / g if abs(g) > 1e-9 else 1.0 for g in decays])
        order = sorted(range(means.size), key=lambda i: -means[i])
        hz = np.abs(self.values[3::4]) / math.tau
        return ", ".join(f"{amount(float(means[i]), unit)} at {hz[i]:.4g} Hz" for i in order)


def find_lines(
    samples: Samples, most: int, least: float = 0.0, apart: float = 1.0, fewest: int = 1
) -> DecayingLines | None:
    """Fit the strongest lines of a record together; None if they are too few, or cannot be fitted.

    Each line starts from the highest peak of what those before it leave. The search ends with ``most`` lines, or before
    one that is below ``least`` times the first, or not ``apart`` reciprocals of the record's length from each other.
    """
    used = samples.used & np.isfinite(samples.track.t)
    t, y = samples.track.t[used], samples.track.y[used]
    tau, span, scale = t - t[0], float(t[-1] - t[0]), float(np.std(y))
    if (
        y.size < 4 * FEWEST_FOR_CURVE
        or scale <= MOTIONLESS * float(np.max(np.abs(y)))
        or not 0.0 < span < MOST * float(np.median(np.diff(t)))
    ):
        return None
    values, every, model = (y - y.mean()) / scale, np.ones(y.size, np.bool_), DecayingModes()
    start, omegas = np.zeros(1), list[float]()
    for _ in range(most):
        omegas.append(strongest(tau, values - model.at(tau, start)[0]))
        if any(abs(omegas[-1] - each) * span < apart * math.tau for each in omegas[:-1]):
            break
        linear = _undamped(tau, values, omegas)
        sizes = np.hypot(linear[1::4], linear[2::4])
        if sizes[-1] < least * sizes[0]:
            break
        start = linear
    if start.size < 1 + 4 * fewest:
        return None
    found = fit(model, Rows(tau, values, every, every), start)
    if not np.all(np.isfinite(found.covariance)):
        return None
    dof, correlation = max(y.size - start.size, 1), correlation_length(found.residual)
    widened = found.covariance * (float(found.residual @ found.residual) / dof * correlation)
    return DecayingLines(
        values=found.values,
        covariance=widened,
        residual=found.residual,
        used=used,
        level=float(y.mean()),
        scale=scale,
        start_s=float(t[0]),
        seconds=span,
        dof=max(dof / correlation, 1.0),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Steady:
    """An oscillation that does not fall beside one that does."""

    frequency_hz: float
    amplitude: float
    mains: bool  # whether its frequency is that of the mains
    wave: F8  # (n,) at the times of the record


def find_steady(samples: Samples) -> Steady | None:
    """Return the steady oscillation of a record in which a second one falls; None if there is none.

    A drive keeps up its own oscillation while the free one falls. It must be the strongest line, its fall less than a
    tenth of what the rate of the other would give it, by more than two standard uncertainties, and the other one at
    least a third of it at the start, as after a start from rest. Mains hum may have any size.
    """
    lines = find_lines(samples, 2, 0.5 * NEGLIGIBLE, APART, fewest=2)
    # What the two leave beyond the noise must be below a tenth of what they describe.
    if lines is None or lines.left > NEGLIGIBLE**2 + (samples.noise / lines.scale) ** 2:
        return None
    (rates, omegas), sizes = (lines.values[4::4], np.abs(lines.values[3::4])), lines.sizes
    steady = int(np.argmin(rates))
    other = 1 - steady
    weights = np.zeros(9)
    weights[[4 + 4 * steady, 4 + 4 * other]] = 1.0, -NEGLIGIBLE
    more = float(weights @ lines.values)
    if more > -2.0 * math.sqrt(float(weights @ lines.covariance @ weights)):
        return None
    hz = float(omegas[steady]) / math.tau
    mains = any(abs(hz - each) < MAINS_SHARE * each for each in MAINS_HZ)
    u_rate = math.sqrt(lines.covariance[4 + 4 * other, 4 + 4 * other])
    if rates[other] < OUTLIER * u_rate or rates[other] * lines.seconds < math.log(2.0):
        return None  # neither falls to its half
    # The other one must last for several periods, or it is no oscillation but a disturbance at the start.
    main = steady == 0 and sizes[other] > WEAKER * sizes[steady]  # the first line has the highest peak
    if rates[other] > omegas[other] / (math.tau * ROUNDS) or not (mains or main):
        return None
    parameters = np.concatenate([[0.0], lines.values[1 + 4 * steady : 5 + 4 * steady]])
    t = np.nan_to_num(samples.track.t - lines.start_s)
    wave = lines.scale * DecayingModes().at(t, parameters)[0]
    return Steady(hz, lines.scale * float(sizes[steady]), mains, wave)


def strongest(tau: F8, values: F8) -> float:
    """Return the angular frequency of the strongest line, rad/s; the samples need not be equally spaced."""
    step = float(np.median(np.diff(tau)))
    grid = np.arange(int(tau[-1] / step) + 1) * step
    power = np.abs(np.fft.rfft(np.interp(grid, tau, values), 8 * grid.size)) ** 2
    least = 8  # lines below one period per record count as drift
    peak = least + int(np.argmax(power[least:]))
    return 2.0 * math.pi * peak / (8 * grid.size * step)


def _undamped(tau: F8, values: F8, omegas: list[float]) -> F8:
    """Return the parameters of undamped modes of given frequencies: rest position, then a, b, omega, g of each mode."""
    waves = [wave(omega * tau) for omega in omegas for wave in (np.cos, np.sin)]
    solved = np.linalg.lstsq(np.stack([np.ones_like(tau), *waves], axis=1), values, rcond=None)[0]
    each = [[solved[1 + 2 * i], solved[2 + 2 * i], omega, 0.0] for i, omega in enumerate(omegas)]
    return np.concatenate([solved[:1], *each])
