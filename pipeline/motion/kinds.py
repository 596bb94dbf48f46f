"""Kinds of motion: whether a record oscillates, and the oscillation as the fit for its kind has it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.damping.law_fit import LawFit
from pipeline.damping.select import Damping, fit_damping
from pipeline.damping.select import Params as DampingParams
from pipeline.motion.equation_fit import EquationFit, moving_part
from pipeline.motion.phase import Params as PhaseParams
from pipeline.motion.phase import PhaseFit, fit_phase
from pipeline.motion.waveform import Rest, Waveform, fit_rest, reconstruct
from pipeline.motion.waveform_fit import FullFit, fit_record
from pipeline.motion.waveform_fit import Params as WaveformParams
from pipeline.numerics.quantity import amount, in_unit, noun
from pipeline.oscillation.clipping import find_cuts
from pipeline.oscillation.condition import Conditioned, condition
from pipeline.oscillation.condition import Params as ConditionParams
from pipeline.oscillation.cycles import Cycles, NoOscillation, find_cycles
from pipeline.oscillation.cycles import Params as CyclesParams
from pipeline.oscillation.demodulate import Demodulated, demodulate
from pipeline.oscillation.demodulate import Params as DemodulateParams
from pipeline.oscillation.disturbances import Disturbances, separate
from pipeline.oscillation.disturbances import Params as DisturbancesParams
from pipeline.oscillation.kinks import find_kink
from pipeline.oscillation.rows import are_interleaved, hum_in_turn
from pipeline.oscillation.segments import Params as SegmentsParams
from pipeline.oscillation.segments import Segments, Span, find_segments
from pipeline.track import UNUSABLE, Quality, Track

__all__ = ["Fitted", "Windows", "astray", "by_equation", "by_windows", "incoherent", "see_windows"]

MOST_BENT = 0.25  # of the amplitude: parabolas leave 0.19, a motion of which little but plateaus is seen 0.35
FOLDED = 32  # parts of a period
ALIKE = 0.25  # of the residual's variance: what periods that are alike may differ by
WANDERING = 0.3  # of the amplitude: what a sinusoid may leave beyond white noise
FEWEST, ASTRAY = 4, 0.8  # windows, and how far astray they may be over their amplitudes, to be one oscillation
ALONE, SEEN = 1e-6, 0.5  # chance of a line in white noise, and the share of its evidence that the fit has to keep
LEAST_AFTER, HANGING = 64, 0.25  # samples after a trigger, and the share of their range within which a bob hangs still
ROUNDS = 4  # most times that a part is looked for within the part that was found


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """What the windows of an oscillating record show.

    Parameters
    ----------
    conditioned : Conditioned
        The whole record, what lies outside the analysed part flagged.
    segments : Segments or None
        Which part that is; None: the whole record.
    cycles, demodulated, disturbances, damping
        Outputs of the stages of those names.
    stopped : bool
        Whether friction stopped the bob within the record.
    """

    conditioned: Conditioned
    segments: Segments | None
    cycles: Cycles
    demodulated: Demodulated
    disturbances: Disturbances
    damping: Damping
    stopped: bool

    @property
    def damping_ratio(self) -> float:
        """Of the selected law at the first sample."""
        return self.damping.best.rate_at_start() / self.demodulated.angular_frequency


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """An oscillation, as the stages after the fit take it.

    Parameters
    ----------
    demodulated : Demodulated
        With the final flags.
    disturbances : Disturbances
        What was taken out of the record before.
    damping, phase, rest, waveform
        Of the record without it.
    full : FullFit or None
        The fit of the whole waveform, where there was one.
    """

    demodulated: Demodulated
    disturbances: Disturbances
    damping: Damping
    phase: PhaseFit
    rest: Rest
    waveform: Waveform
    full: FullFit | None

    def in_unit(self, unit: str) -> Fitted:
        """Return the same of a record in another unit: the stages know only that values have one, and write m."""
        if unit == "m":
            return self
        fits = {name: _law_in_unit(fit, unit) for name, fit in self.damping.fits.items()}
        damping, backbone = replace(self.damping, fits=fits), self.phase.backbone
        bent = None if backbone is None else replace(backbone, unit=in_unit(backbone.unit, unit))
        return replace(
            self,
            damping=damping,
            phase=replace(self.phase, damping=damping, backbone=bent),
            rest=replace(self.rest, mean=replace(self.rest.mean, unit=unit)),
        )


def _law_in_unit(fit: LawFit, unit: str) -> LawFit:
    return replace(fit, joint=replace(fit.joint, units=tuple(in_unit(each, unit) for each in fit.joint.units)))


def see_windows(
    conditioned: Conditioned,
    conditioning: ConditionParams,
    cycles: CyclesParams,
    demodulation: DemodulateParams,
    segmentation: SegmentsParams,
    separation: DisturbancesParams,
    damping: DampingParams,
) -> Windows | NoOscillation:
    """Return period, amplitudes and laws of damping, or why the record has none.

    Parameters
    ----------
    conditioned : Conditioned
    conditioning, cycles, demodulation, segmentation, separation, damping
        Options of the stages.
    """
    if are_interleaved(conditioned.track):
        if (hum := hum_in_turn(conditioned.track)) is not None:
            return NoOscillation(
                f"the {noun(conditioned.track.unit)} goes to and fro by {amount(hum, conditioned.track.unit, '.2g')} "
                "from row to row: mains hum at half the sampling rate, which hides what else may be wrong, or two "
                "sensors in turn; see to the sensor's supply, or record at another rate",
                "mains_hum",
            )
        return NoOscillation(
            "the rows are of two records in turn: no estimate is made of both together; separate every other row",
            "interleaved_records",
        )
    segments = None
    if (waiting := _waiting(conditioned)) is not None:
        conditioned, segments = condition(waiting.flagged(conditioned.track), conditioning), waiting
    if (rest := _at_rest(conditioned)) is not None:
        conditioned, segments = condition(rest.flagged(conditioned.track), conditioning), rest.within(segments)
    seen, stopped = _see_cycles(conditioned, cycles, 0.25 if rest is None else 0.75)
    if isinstance(seen, NoOscillation):
        return seen
    demodulated = demodulate(conditioned, seen, demodulation)
    for _ in range(ROUNDS):
        found = find_segments(conditioned, seen, demodulated, segmentation) or find_kink(demodulated)
        if found is None:
            break
        # Once more without the rest, which may have hidden the period, the plateaus and the noise of this part.
        part = condition(found.flagged(conditioned.track), conditioning)
        trimmed, stops = _see_cycles(part, cycles)
        if isinstance(trimmed, NoOscillation):
            break
        conditioned, seen, stopped, segments = part, trimmed, stops, found.within(segments)
        demodulated = demodulate(conditioned, seen, demodulation)
    if (cut := find_cuts(conditioned, seen, demodulated)) is not None:
        conditioned, demodulated = cut, demodulate(cut, seen, demodulation)
    if (why := _no_sinusoid(conditioned, demodulated)) is not None:
        return why
    demodulated, disturbances = separate(conditioned, seen, demodulated, separation, demodulation)
    law = fit_damping(demodulated, _start_s(conditioned, demodulated.angular_frequency), damping)
    return Windows(conditioned, segments, seen, demodulated, disturbances, law, stopped)


def _start_s(conditioned: Conditioned, omega: float) -> float:
    """Time of the part's first row, s, though an echo may stand there; where over a period is lost, of the first used.

    A single false echo must not move the moment that amplitude and phase are stated for.
    """
    track = conditioned.track
    first = float(track.t[np.argmax(conditioned.used)])
    # What has no place in the order of times begins nothing.
    out = Quality.OUTSIDE | Quality.DUPLICATE_TIME | Quality.NON_MONOTONIC_TIME | Quality.MALFORMED
    rows = ((conditioned.flags & np.uint8(out)) == 0) & (track.t <= first)
    begin = float(np.min(track.t[rows], initial=first))
    return begin if first - begin < 2.0 * math.pi / omega else first


def _waiting(conditioned: Conditioned) -> Segments | None:
    """Return what to leave out of a record that began while its bob hung still: all before its own trigger."""
    t, y, moment_s = conditioned.track.t, conditioned.track.y, conditioned.track.trigger_s
    if moment_s is None:
        return None
    before, after = conditioned.used & (t < moment_s), conditioned.used & (t >= moment_s)
    if not before.any() or np.count_nonzero(after) < LEAST_AFTER:
        return None
    # A bob that swung already triggers at once: then there is nothing still to leave out.
    ranges = [float(np.ptp(np.quantile(y[rows], (0.05, 0.95)))) for rows in (before, after)]
    if ranges[0] > HANGING * ranges[1]:
        return None
    return Segments(moment_s, math.inf, (Span("waiting", float(t[before][0]), moment_s),))


def _at_rest(conditioned: Conditioned) -> Segments | None:
    """Return what to leave out of a record that goes on long after its bob has stopped."""
    moving = moving_part(conditioned, 0.25)
    if moving is None:
        return None
    t = conditioned.track.t[conditioned.used]
    # As much again stays: it shows the rest position and the noise.
    last_s = float(t[0] + 2.0 * (moving.track.t[-1] - t[0]))
    return Segments(-math.inf, last_s, (Span("at_rest", last_s, float(t[-1])),))


def _see_cycles(
    conditioned: Conditioned, params: CyclesParams, early: float = 0.25
) -> tuple[Cycles | NoOscillation, bool]:
    """Return the cycles, of the moving part where the bob stops early in the record, and whether it does."""
    cycles = find_cycles(conditioned, params)
    moving = moving_part(conditioned, 0.75 if isinstance(cycles, NoOscillation) else early)
    if moving is None or isinstance(trimmed := find_cycles(moving, params), NoOscillation):
        return cycles, False
    return trimmed, True


def _no_sinusoid(conditioned: Conditioned, demodulated: Demodulated) -> NoOscillation | None:
    """Why the motion is no oscillation although its spectrum has a peak: a step or a ramp has one too."""
    most = demodulated.amplitude.size * 9 // 10
    size = float(np.partition(demodulated.amplitude, most)[most])
    left, unit = demodulated.noise_m, conditioned.track.unit
    if not size > 1e-12 * float(np.max(np.abs(demodulated.offset))):
        return NoOscillation(f"the {noun(unit)} does not follow the period that its spectrum shows")
    # Noise that knows of itself, a ride and a walk have more between their samples than white noise.
    noise = max(conditioned.noise_m, (conditioned.quantum_m or 0.0) / math.sqrt(12.0))
    # Both are estimates from the same n samples, and of white noise the ratio of their squares has a variance of 8.5/n.
    # Five standard deviations are nothing: of 2,000 records at -10 dB one has 4.3.
    chance = 5.0 * math.sqrt(8.5 / max(float(np.sum(demodulated.count)), 1.0))
    excess = math.sqrt(max(left**2 - (1.0 + chance) * noise**2, 0.0))
    if left <= 0.15 * size or (left <= 4.0 * conditioned.noise_m and excess <= WANDERING * size):
        return None
    if left > MOST_BENT * size or not _repeats(conditioned, demodulated):
        return NoOscillation(
            f"the {noun(unit)} moves, but not to and fro: a sinusoid of {amount(size, unit, '.3g')} leaves "
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


def incoherent(fitted: Fitted, track: Track, typical: float) -> NoOscillation | None:
    """Return why a motion is no oscillation although single periods look like one: they do not follow one another.

    Parameters
    ----------
    fitted : Fitted
    track : Track
        The record.
    typical : float
        What :func:`astray` says of the fit.

    Notes
    -----
    Every window's amplitude and phase are one arrow, and the amplitude's law and the phase's line tell where it should
    point. Arrows at random miss that by more than their own length; half of the motion, by the arrows' lengths, has to
    miss it by less than :data:`ASTRAY` of them. And the oscillation has to explain something: of n samples in white
    noise a line that stands out by itself lowers the squares by :math:`(2/n)\\ln(n/\\alpha)` of what is left.
    """
    demodulated = fitted.demodulated
    if demodulated.t.size < FEWEST:
        return None
    used = (demodulated.flags & UNUSABLE) == 0
    left = fitted.waveform.residual[used]
    swing = left + (fitted.waveform.position - fitted.rest.at(track.t))[used]
    gain = 0.5 * left.size * (float(swing @ swing) / max(float(left @ left), 1e-300) - 1.0)
    if gain < SEEN * math.log(left.size / ALONE):
        return NoOscillation(f"what oscillates in the {noun(track.unit)} explains no more of it than noise may")
    if typical < ASTRAY:
        return None
    return NoOscillation(
        f"the {noun(track.unit)} moves to and fro, but at no period that lasts: half of the motion is {typical:.0%} of "
        "its amplitude and more away from the oscillation that comes nearest"
    )


def astray(fitted: Fitted) -> float:
    """Return by what share of their amplitude half of the windows, by amplitude, miss the oscillation fitted."""
    demodulated, phase = fitted.demodulated, fitted.phase
    told = phase.damping.best.amplitude(demodulated.t - phase.t0) * np.exp(1j * phase.total(demodulated.t))
    own = demodulated.amplitude * np.exp(1j * demodulated.phase)
    size = np.abs(own)
    missed = np.abs(own - told) / np.maximum(size, 1e-12 * float(size.max()))
    order = np.argsort(missed)
    middle = int(np.searchsorted(np.cumsum(size[order]), 0.5 * float(size.sum())))
    return float(missed[order][middle])


def by_windows(windows: Windows, phases: PhaseParams, waveforms: WaveformParams | None) -> Fitted:
    """Return a weakly damped oscillation: amplitude, phase and rest position against time.

    Parameters
    ----------
    windows : Windows
    phases, waveforms
        Options of :func:`pipeline.motion.phase.fit_phase` and of the fit of the whole waveform, None for no such fit.
    """
    demodulated, damping, disturbances = windows.demodulated, windows.damping, windows.disturbances
    phase, rest = fit_phase(demodulated, damping, phases), fit_rest(demodulated)
    waveform = reconstruct(disturbances.conditioned.track, demodulated, phase, rest)
    if waveforms is None:
        return Fitted(demodulated, disturbances, damping, phase, rest, waveform, None)
    # The record without modes and with their columns: as good as the whole record with them, for the columns span
    # what was taken out.
    extra = disturbances.columns(windows.conditioned.track.t)
    full = fit_record(
        disturbances.conditioned, demodulated, damping, phase, rest, waveform, extra=extra, params=waveforms
    )
    demodulated = replace(demodulated, flags=full.flags)
    return Fitted(demodulated, disturbances, full.damping, full.phase, full.rest, full.waveform, full)


def by_equation(windows: Windows, solved: EquationFit) -> Fitted:
    """Return a strongly damped oscillation: one solution of the equation of motion.

    Parameters
    ----------
    windows : Windows
    solved : EquationFit
    """
    demodulated = solved.windows(windows.demodulated)
    phase, rest = solved.phase(demodulated), solved.rest(demodulated)
    # The equation was fitted to the whole record.
    nothing = Disturbances.nothing(windows.conditioned)
    return Fitted(demodulated, nothing, solved.damping, phase, rest, solved.waveform, None)
