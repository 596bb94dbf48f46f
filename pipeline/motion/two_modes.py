"""Two modes of similar strength: a motion that consists of two oscillations, both of which can be measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.motion.fit import Rows, fit
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.levels import FEWEST_FOR_CURVE, NEGLIGIBLE
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import Samples
from pipeline.track import F8, U8
from pipeline.units import amount

MOTIONLESS = 64.0 * float(np.finfo(np.float64).eps)  # relative scatter of a motionless record by IEEE rounding
# Minimum ratio of the weaker mode's amplitude to the stronger one's; below it only one oscillation counts.
WEAKER = 1.0 / 3.0
# Minimum numbers of beats and of periods of the slower mode in the record; with fewer, two modes cannot be
# distinguished from one that changes.
BEATS, PERIODS = 0.8, 3.0  # those of tests/properties/test_no_oscillation.py at a ratio of 1.02 beat less than once
MOST = 100_000  # maximum number of median spacings, whose fit takes 0.3 s as measured; longer records are not fitted


@dataclass(frozen=True, slots=True, eq=False)
class TwoModes:
    """Two oscillations, the stronger ("first") and the other one, neither of which is the main one."""

    # The rest position, then the cosine and sine amplitudes at ``start_s``, angular frequency and decay rate of each
    # mode, in the record's times and values.
    joint: Joint
    dof: float  # number of independent samples less that of the parameters
    noise: Estimate  # of one sample
    start_s: float
    residual: F8  # (n,)
    flags: U8  # (n,)
    why: str = ""  # one sentence that states the periods and amplitudes of both modes

    def described(self, estimates: Mapping[str, Estimate]) -> str:
        """Return the sentence that states the periods and amplitudes of both modes."""
        periods = [estimates[f"{name}_mode_period"] for name in ("first", "second")]
        sizes = [estimates[f"{name}_mode_amplitude"] for name in ("first", "second")]
        first, second = (f"{t} ({amount(a.value, a.unit)})" for t, a in zip(periods, sizes, strict=True))
        beat_s = 1.0 / abs(1.0 / periods[0].value - 1.0 / periods[1].value)
        return (
            f"two modes of like strength oscillate together, at periods of {first} and {second}: "
            f"they beat every {beat_s:.3g} s"
        )


MODE_PARAMETERS = (
    "rest",
    *(f"{mode}_{name}" for mode in ("first", "second") for name in ("cosine", "sine", "omega", "decay")),
)


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


def find_two_modes(samples: Samples) -> TwoModes | None:
    """Return the two modes that a record consists of; None if two modes do not describe it.

    :math:`o + \\sum_i e^{-g_i t}(a_i\\cos\\omega_i t + b_i\\sin\\omega_i t)` is fitted to all samples used, started
    from the strongest line of the spectrum and the strongest line of the residual of the first. Covariances are scaled
    by the residuals, including their correlation.
    """
    used = samples.used & np.isfinite(samples.track.t)
    t, y, unit = samples.track.t[used], samples.track.y[used], samples.track.unit
    tau, span = t - t[0], float(t[-1] - t[0])
    scale = float(np.std(y))
    if (
        y.size < 4 * FEWEST_FOR_CURVE
        or scale <= MOTIONLESS * float(np.max(np.abs(y)))
        or not 0.0 < span < MOST * float(np.median(np.diff(t)))
    ):
        return None
    values = (y - y.mean()) / scale
    first = _strongest(tau, values)
    second = _strongest(tau, values - DecayingModes().at(tau, _linear(tau, values, (first,)))[0])
    start = _linear(tau, values, (first, second))
    every = np.ones(y.size, np.bool_)
    found = fit(DecayingModes(), Rows(tau, values, every, every), start)
    if not np.all(np.isfinite(found.covariance)) or not float(found.residual @ found.residual) < NEGLIGIBLE * y.size:
        return None
    places = sorted((1, 5), key=lambda i: -float(np.hypot(*found.values[i : i + 2])))
    omegas = [abs(float(found.values[i + 2])) for i in places]
    sizes = [float(np.hypot(*found.values[i : i + 2])) for i in places]
    beats = abs(omegas[0] - omegas[1]) * span / (2.0 * math.pi)
    if min(omegas) * span < 2.0 * math.pi * PERIODS or beats < BEATS or sizes[1] < WEAKER * sizes[0]:
        return None
    slow, fast = sorted(omegas)
    # A component at a multiple of the slower frequency is not a second mode but a harmonic, as of a square wave.
    if round(fast / slow) > 1 and abs(fast - round(fast / slow) * slow) * span < math.pi:
        return None
    count, correlation = max(y.size - found.values.size, 1), correlation_length(found.residual)
    spread = math.sqrt(float(found.residual @ found.residual) / count)
    order = [0, *(k for i in places for k in range(i, i + 4))]
    # Back to the unit of the record; the rest position was measured from the mean.
    turn = np.array([scale, *(2 * (scale, scale, 1.0, 1.0))])
    level = np.array([float(y.mean()), *(8 * (0.0,))])
    units = (unit, *(2 * (unit, unit, "rad/s", "1/s")))
    covariance = found.covariance[np.ix_(order, order)] * (spread**2 * correlation)
    joint = Joint(MODE_PARAMETERS, found.values[order] * turn + level, covariance * np.outer(turn, turn), units)
    residual = np.full(len(samples.track), np.nan)
    residual[used] = scale * found.residual
    dof = max(count / correlation, 1.0)
    return TwoModes(joint, dof, samples.noise_estimate, float(t[0]), residual, samples.flags)


def _strongest(tau: F8, values: F8) -> float:
    """Return the angular frequency of the strongest line, rad/s; the samples need not be equally spaced."""
    step = float(np.median(np.diff(tau)))
    grid = np.arange(int(tau[-1] / step) + 1) * step
    power = np.abs(np.fft.rfft(np.interp(grid, tau, values), 8 * grid.size)) ** 2
    least = 8  # lines below one period per record count as drift
    peak = least + int(np.argmax(power[least:]))
    return 2.0 * math.pi * peak / (8 * grid.size * step)


def _linear(tau: F8, values: F8, omegas: tuple[float, ...]) -> F8:
    """Return the parameters of undamped modes of given frequencies: rest position, then a, b, omega, g of each mode."""
    waves = [wave(omega * tau) for omega in omegas for wave in (np.cos, np.sin)]
    solved = np.linalg.lstsq(np.stack([np.ones_like(tau), *waves], axis=1), values, rcond=None)[0]
    each = [[solved[1 + 2 * i], solved[2 + 2 * i], omega, 0.0] for i, omega in enumerate(omegas)]
    return np.concatenate([solved[:1], *each])
