"""Oscillation: whether what was fitted is one, although its spectrum has a peak."""

from __future__ import annotations

import math

import numpy as np

from pipeline.motion.fitted import Fitted
from pipeline.numerics.quantity import amount, noun
from pipeline.samples.condition import Conditioned
from pipeline.track import UNUSABLE, Track
from pipeline.windows.cycles import NoOscillation
from pipeline.windows.demodulate import Demodulated

__all__ = ["check_coherence", "check_sinusoid", "typical_miss"]

MOST_BENT = 0.25  # of the amplitude: parabolas leave 0.19, a motion of which little but plateaus is seen 0.35
FOLDED = 32  # parts of a period
ALIKE = 0.25  # of the residual's variance: what periods that are alike may differ by
WANDERING = 0.3  # of the amplitude: what a sinusoid may leave beyond white noise
MANY = 8  # windows, of which an oscillation that leaves a quarter of its amplitude is judged by its coherence instead
FEWEST, ASTRAY = 4, 0.8  # windows, and how far astray they may be over their amplitudes, to be one oscillation
ALONE, SEEN = 1e-6, 0.5  # chance of a line in white noise, and the share of its evidence that the fit has to keep


def check_sinusoid(conditioned: Conditioned, demodulated: Demodulated) -> NoOscillation | None:
    """Return why the motion is no oscillation although its spectrum has a peak: a step or a ramp has one too.

    Parameters
    ----------
    conditioned, demodulated
        Outputs of the stages of those names.
    """
    most = demodulated.amplitude.size * 9 // 10
    size = float(np.partition(demodulated.amplitude, most)[most])
    left, unit = demodulated.noise_m, conditioned.track.unit
    if not size > 1e-12 * float(np.max(np.abs(demodulated.offset))):
        return NoOscillation(f"the {noun(unit)} does not follow the period of its spectrum")
    # Correlated noise, a drift or a random walk correlate neighbouring samples more than white noise does.
    noise = max(conditioned.noise_m, (conditioned.quantum_m or 0.0) / math.sqrt(12.0))
    # Both are estimates from the same n samples, and of white noise the ratio of their squares has a variance of 8.5/n.
    # Five standard deviations are nothing: of 2,000 records at -10 dB one has 4.3.
    chance = 5.0 * math.sqrt(8.5 / max(float(np.sum(demodulated.count)), 1.0))
    excess = math.sqrt(max(left**2 - (1.0 + chance) * noise**2, 0.0))
    if left <= 0.15 * size or (left <= 4.0 * conditioned.noise_m and excess <= WANDERING * size):
        return None
    if left > MOST_BENT * size or not (demodulated.t.size >= MANY or _repeats(conditioned, demodulated)):
        return NoOscillation(
            f"the {noun(unit)} changes, but a sinusoid of {amount(size, unit, '.3g')} leaves "
            f"{amount(left, unit, '.3g')}"
        )
    return None


def _repeats(conditioned: Conditioned, demodulated: Demodulated) -> bool:
    """Whether what a sinusoid leaves is alike in every period: a bob that bounces swings all the same."""
    rows = np.flatnonzero(((demodulated.flags & UNUSABLE) == 0) & np.isfinite(demodulated.residual))
    left = demodulated.residual[rows]
    turns = np.interp(conditioned.track.t[rows], demodulated.t, demodulated.phase) / (2.0 * math.pi)
    bins = ((turns - np.floor(turns)) * FOLDED).astype(np.int64) % FOLDED
    means = np.bincount(bins, left, FOLDED) / np.maximum(np.bincount(bins, minlength=FOLDED), 1)
    return demodulated.t.size >= 4 and float(np.var(left - means[bins])) < ALIKE * float(np.var(left))


def check_coherence(fitted: Fitted, track: Track, typical: float) -> NoOscillation | None:
    """Return why a motion is no oscillation although single periods look like one: they do not follow one another.

    Parameters
    ----------
    fitted : Fitted
    track : Track
        The record.
    typical : float
        From :func:`typical_miss`.

    Notes
    -----
    Amplitude and phase of a window are one arrow. The law of the amplitude and the line of the phase predict it. Random
    arrows miss the prediction by more than their own length. Half of the motion, by the arrows' lengths, has to miss it
    by less than :data:`ASTRAY` of them. The oscillation also has to explain something: among n samples of white noise,
    a line that stands out lowers the sum of squares by :math:`(2/n)\\ln(n/\\alpha)` of what remains.
    """
    demodulated = fitted.demodulated
    if demodulated.t.size < FEWEST:
        return None
    used = (demodulated.flags & UNUSABLE) == 0
    left = fitted.waveform.residual[used]
    swing = left + (fitted.waveform.position - fitted.rest.at(track.t))[used]
    gain = 0.5 * left.size * (float(swing @ swing) / max(float(left @ left), 1e-300) - 1.0)
    if gain < SEEN * math.log(left.size / ALONE):
        return NoOscillation("the oscillation explains no more of the variance than noise would")
    if typical < ASTRAY:
        return None
    return NoOscillation(
        f"no period lasts: half of the motion misses one oscillation by {typical:.0%} of its amplitude or more"
    )


def typical_miss(fitted: Fitted) -> float:
    """Return by what share of their amplitude half of the windows, by amplitude, miss the oscillation fitted."""
    demodulated, phase = fitted.demodulated, fitted.phase
    expected = phase.damping.best.amplitude(demodulated.t - phase.t0) * np.exp(1j * phase.total(demodulated.t))
    own = demodulated.amplitude * np.exp(1j * demodulated.phase)
    size = np.abs(own)
    missed = np.abs(own - expected) / np.maximum(size, 1e-12 * float(size.max()))
    order = np.argsort(missed)
    middle = int(np.searchsorted(np.cumsum(size[order]), 0.5 * float(size.sum())))
    return float(missed[order][middle])
