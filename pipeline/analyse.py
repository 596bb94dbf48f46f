"""The analysis: from a track to estimates and findings, one stage after the other.

Read :func:`analyse` from top to bottom. Each stage is a pure function with its own options, and is named after its
module. If a stage must run again, on fewer samples or after a disturbance was removed, it is called here again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.analysis import Analysis, Motion, Oscillation, Still
from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.bench.sensor_filter import SensorFilter
from pipeline.checks.echoes import echoes_by_chance, find_clusters
from pipeline.checks.harmonics import find_harmonics
from pipeline.checks.misfit import Misfit
from pipeline.checks.model import check_model
from pipeline.checks.oscillation import check_sinusoid, typical_miss
from pipeline.checks.plausibility import check_plausibility
from pipeline.checks.residuals import residuals_of
from pipeline.checks.sensor import find_smoothing, held, held_count
from pipeline.damping.select import Damping, fit_laws
from pipeline.errors import AnalysisError
from pipeline.findings.damping import damping_findings
from pipeline.findings.finding import Found, worded
from pipeline.findings.motion import (
    fit_findings,
    harmonics_findings,
    model_findings,
    motion_findings,
    overdamped_findings,
    plausibility_findings,
    smoothing_findings,
)
from pipeline.findings.parts import part_findings
from pipeline.findings.samples import COARSE, clock_findings, held_findings, sample_findings
from pipeline.findings.scene import scene_findings
from pipeline.motion import overdamped
from pipeline.motion.averaged import Fitted, fit_windows
from pipeline.motion.by_samples import fit_samples
from pipeline.motion.equation import fit_equation
from pipeline.motion.overdamped import Overdamped, find_overdamped, spring_constant
from pipeline.motion.two_modes import TwoModes, find_two_modes
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.robust import median
from pipeline.numerics.threads import one_thread
from pipeline.options import Options
from pipeline.results.derive import derive
from pipeline.results.effects import Effect, tabulate
from pipeline.samples.condition import Conditioned, coarsest_step, condition
from pipeline.samples.stopping import moving_part
from pipeline.track import Quality, Track
from pipeline.windows.clipping import find_cuts
from pipeline.windows.cycles import Cycles, NoOscillation, find_cycles
from pipeline.windows.demodulate import CLIP_SIGMAS, Demodulated, demodulate, model_error
from pipeline.windows.disturbances import separate
from pipeline.windows.segments import Segments, Span, SpanKind, before_trigger, find_free_part, long_after_stop

__all__ = ["Analysis", "Oscillation", "Overdamped", "Still", "analyse"]


MOST_PARTS = 4  # maximum number of times that a freely moving part is sought within the part found before
# Share of the amplitude by which typical periods differ from the fitted oscillation, above which two modes are fitted:
# the difference if one mode is a third of the other.
BEATING = 0.3
LEAST_HALVED = 128  # minimum number of samples of which the later half may show a motion
CLEAR = 0.05  # maximum noise over the amplitude for a motion that only the later half shows


@one_thread
def analyse(track: Track, scene: Scene | None = None, options: Options | None = None) -> Analysis:
    """Turn a track into estimates, laws, effects and findings.

    Parameters
    ----------
    track : Track
    scene : Scene, optional
        What is known about the bench; by default nothing. Its damping law counts as the stated law unless ``options``
        state another.
    options : Options, optional

    Returns
    -------
    Analysis

    Raises
    ------
    AnalysisError
        If fewer than eight samples are usable.

    Examples
    --------
    >>> t = np.arange(1000) / 100
    >>> rng = np.random.default_rng(1)
    >>> y = 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t) + 1e-4 * rng.standard_normal(1000)
    >>> print(analyse(Track.from_arrays(t, y)).estimates["period"])  # 2 pi / 8.3 = 0.757010
    0.757010 +- 0.000022 s
    """
    scene, options = scene or Scene(), options or Options()
    if options.stated is None and scene.damping_law is not None:
        options = replace(options, stated=scene.damping_law)
    if track.unit == "m" and track.sigma_m is None and scene.sensor_sigma_m is not None:
        track = replace(track, sigma_m=scene.sensor_sigma_m.value)
    samples = condition(track)
    part = _free_part(samples, options)
    if isinstance(part, NoOscillation):
        return _without_period(samples, part, scene, options)

    samples, cycles = part.samples, part.cycles
    windows = demodulate(samples, cycles)
    if (cut := find_cuts(samples, cycles, windows)) is not None:
        samples, windows = cut, demodulate(cut, cycles)
    if (why := check_sinusoid(samples, windows)) is not None:
        return _without_period(samples, why, scene, options)

    windows, disturbances = separate(samples, cycles, windows, modes=options.modes)
    start_s = _start_s(samples, windows.angular_frequency)
    damping = fit_laws(windows, start_s, options.laws, options.known_law, track.unit)

    # For strong damping, or friction that stops the bob, the equation of motion is fitted, not its cycle average.
    solved = fit_equation(samples, windows, damping, stopped=part.stopped)
    if _may_be_overdamped(windows, damping, solved):
        relaxed = find_overdamped(samples)
        if isinstance(relaxed, Overdamped):
            return _overdamped(samples, relaxed, scene, options)
    if isinstance(solved, Fitted):
        fitted = solved
    else:
        fitted = fit_windows(windows, disturbances, damping)
        if options.rows == "samples":
            fitted = fit_samples(fitted, samples)
        two = find_two_modes(samples) if typical_miss(fitted) > BEATING else None
        if two is not None:
            return _two_modes(samples, two, scene, options)
    return _oscillation(samples, part, fitted, solved if isinstance(solved, str) else "", scene, options)


@dataclass(frozen=True, slots=True, eq=False)
class _FreePart:
    """The part of a recording that oscillates freely.

    ``samples`` contains the whole recording, in which samples outside the part are flagged. ``segments`` describes the
    part (None for the whole recording), and ``stopped`` says whether friction stopped the bob in it.
    """

    samples: Conditioned
    segments: Segments | None
    cycles: Cycles
    stopped: bool


def _free_part(samples: Conditioned, options: Options) -> _FreePart | NoOscillation:
    """Find the part that oscillates freely.

    The time before the trigger, the time long after the stop and all but one free part are left out. The samples are
    conditioned again after each step, because the part left out may have hidden the noise of the rest.
    """
    segments: Segments | None = None
    for outside in (before_trigger(samples), long_after_stop(samples, options.early)):
        if outside is not None:
            samples, segments = condition(outside.flagged(samples.track)), outside.within(segments)
    cycles, stopped = _cycles(samples, options, options.early)
    if isinstance(cycles, NoOscillation):
        # A long time in the hand hides the motion after it, which the later half may show.
        t = samples.track.t[samples.used]
        if t.size < LEAST_HALVED:
            return cycles
        half_s = float(np.median(t))
        later = Segments(half_s, math.inf, (Span(SpanKind.HANDLED, float(t[0]), half_s),))
        trial = condition(later.flagged(samples.track))
        trimmed, stopped = _cycles(trial, options, options.early)
        if isinstance(trimmed, NoOscillation):
            return cycles
        windows = demodulate(trial, trimmed)
        if windows.noise_m > CLEAR * median(windows.amplitude) or check_sinusoid(trial, windows) is not None:
            return cycles
        samples, segments = trial, later.within(segments)
        cycles = trimmed
    for _ in range(MOST_PARTS):
        windows = demodulate(samples, cycles)
        outside = find_free_part(samples, windows)
        if outside is None:
            break
        shorter = condition(outside.flagged(samples.track))
        trimmed, stops = _cycles(shorter, options, options.early)
        if isinstance(trimmed, NoOscillation):
            break
        samples, segments, cycles, stopped = shorter, outside.within(segments), trimmed, stops
    return _FreePart(samples, segments, cycles, stopped)


def _cycles(samples: Conditioned, options: Options, share: float) -> tuple[Cycles | NoOscillation, bool]:
    """Return the cycles and whether the bob stops before a share of the samples; if so, those of the moving part."""
    cycles = find_cycles(samples)
    moving = moving_part(samples, options.late if isinstance(cycles, NoOscillation) else share)
    if moving is None or isinstance(trimmed := find_cycles(moving), NoOscillation):
        return cycles, False
    return trimmed, True


def _start_s(samples: Conditioned, omega: float) -> float:
    """Return the time at which amplitude and phase are stated, s: that of the first row, even if it is a false echo.

    If at least one period is missing at the start, it is the time of the first sample used. A single false echo at the
    start must not change the time.
    """
    track = samples.track
    first = float(track.t[np.argmax(samples.used)])
    # A row with a wrong time cannot be the start.
    out = Quality.OUTSIDE | Quality.DUPLICATE_TIME | Quality.NON_MONOTONIC_TIME | Quality.MALFORMED
    rows = ((samples.flags & np.uint8(out)) == 0) & (track.t <= first)
    begin = float(np.min(track.t[rows], initial=first))
    return begin if first - begin < 2.0 * math.pi / omega else first


def _may_be_overdamped(windows: Demodulated, damping: Damping, solved: Fitted | str | None) -> bool:
    """Return whether the damping is strong and, if the equation of motion was fitted, linear."""
    linear = not isinstance(solved, Fitted) or solved.damping.best is solved.damping.of_powers(1)
    return linear and damping.best.rate_at_start() / windows.angular_frequency > overdamped.LEAST_DAMPING


def _oscillation(
    samples: Conditioned,
    part: _FreePart,
    fitted: Fitted,
    refused: str,
    scene: Scene,
    options: Options,
) -> Analysis:
    """Run checks, results and findings, in this order, for an oscillation fitted by any method."""
    track, unit = samples.track, samples.track.unit
    windows, damping, phase, disturbances = fitted.demodulated, fitted.damping, fitted.phase, fitted.disturbances
    rest = fitted.rest
    instrument = Instrument.of(track)
    smoothing = SensorFilter.of(scene, track.rate_hz)
    by_windows = fitted.method != "equation"

    misfits: list[Misfit] = []
    found: list[Found] = []
    plausible = check_plausibility(samples, windows, phase)
    misfits += plausible.misfits
    found += plausibility_findings(plausible)
    # Strong damping distorts every period, which would look like harmonics; its fit describes the whole motion anyway.
    rounding_m = median(model_error(windows.amplitude, windows.decay, windows.angular_frequency))
    residuals = residuals_of(samples, windows, disturbances, damping, phase) if by_windows else None
    unexplained, shortest = residuals, 1
    if residuals is not None:
        shape = find_harmonics(residuals, max(0.5 * (samples.quantum_m or 0.0), rounding_m))
        if shape is not None:
            misfits.append(shape.misfit)
            found += harmonics_findings(shape)
            unexplained = residuals = residuals.less(shape.at_samples)
        if (misfit := held(samples, residuals)) is not None:
            misfits.append(misfit)
            found += held_findings(held_count(samples), residuals.interval_s)
            unexplained = None
        elif not windows.noise_m > max(rounding_m, (samples.quantum_m or 0.0) / COARSE):
            unexplained = None  # rounding, or coarse steps, which the finding "quantised" reports
        elif (smoothed := find_smoothing(residuals, damping.best.joint["A0"].u, smoothing)) is not None:
            shortest = math.ceil(2.0 * smoothed.samples)
            misfits.append(smoothed.misfit)
            found += smoothing_findings(smoothed)
    if by_windows:
        found += model_findings(check_model(fitted, unexplained, shortest, rounding_m))

    effects = tabulate(
        scene, damping, phase, rest, noise_m=windows.noise_m, instrument=instrument, disturbances=disturbances
    )
    derived = derive(
        windows,
        damping,
        phase,
        rest,
        scene,
        effects,
        instrument=instrument,
        misfits=tuple(misfits),
        smoothing=smoothing,
    )
    swing_m = (derived.estimates["offset"].value, float(damping.best.amplitude(np.zeros(1))[0]))
    findings = worded(
        unit,
        part_findings(part.segments, float(track.t[0]), float(track.t[-1])),
        motion_findings(part.cycles, fitted, rest),
        damping_findings(damping),
        found,
        sample_findings(
            samples,
            windows.flags,
            windows.noise_m,
            find_clusters(track, windows, phase),
            swing_m,
            by_chance=echoes_by_chance(samples.flags, windows, CLIP_SIGMAS),
        ),
        scene_findings(scene, effects),
        fit_findings(fitted, refused),
        clock_findings(track, instrument),
    )
    waveform = fitted.waveform
    motion = Oscillation(
        windows, disturbances, damping, phase, rest, waveform, fitted.method, fitted.why, part.cycles, derived
    )
    return Analysis(track, scene, options, samples, motion, effects, findings, derived.estimates)


def _without_period(samples: Conditioned, why: NoOscillation, scene: Scene, options: Options) -> Analysis:
    """Classify a recording without a clear period: a relaxation, two modes of similar strength, or a bob at rest."""
    relaxed = find_overdamped(samples)
    if isinstance(relaxed, Overdamped):
        return _overdamped(samples, relaxed, scene, options)
    if (two := find_two_modes(samples)) is not None:
        return _two_modes(samples, two, scene, options)
    return _still(samples, relaxed or why, scene, options)


def _overdamped(samples: Conditioned, found: Overdamped, scene: Scene, options: Options) -> Analysis:
    """Return the analysis of a motion that damping ends within a few cycles, or before one cycle is complete."""
    estimates = {**_at_rest(samples), **found.estimates, **spring_constant(found, scene)}
    return _ended(samples, found, overdamped_findings(found), estimates, scene, options)


def _two_modes(samples: Conditioned, two: TwoModes, scene: Scene, options: Options) -> Analysis:
    """Return the analysis of a recording of two oscillations, neither of which is the main one."""
    finding = Found("two_modes", {name: x.value for name, x in two.estimates.items()} | {"why": two.why})
    return _ended(samples, Still(two.why), (finding,), {**_at_rest(samples), **two.estimates}, scene, options)


def _still(samples: Conditioned, why: NoOscillation, scene: Scene, options: Options) -> Analysis:
    """Return the analysis of a recording without a motion to fit."""
    findings = [Found("no_oscillation", {"why": why.why})]
    if (count := held_count(samples)) > 1:
        findings += held_findings(count, 1.0 / samples.track.rate_hz)
    return _ended(samples, Still(why.why), findings, _at_rest(samples), scene, options)


def _ended(
    samples: Conditioned,
    motion: Motion,
    first: Iterable[Found],
    estimates: Mapping[str, Estimate],
    scene: Scene,
    options: Options,
) -> Analysis:
    track = samples.track
    findings = worded(
        track.unit,
        first,
        sample_findings(samples, samples.flags, samples.noise_m),
        clock_findings(track, Instrument.of(track)),
    )
    none: tuple[Effect, ...] = ()
    return Analysis(track, scene, options, samples, motion, none, findings, estimates)


def _at_rest(samples: Conditioned) -> dict[str, Estimate]:
    """Return the mean and the noise of the samples used."""
    y, noise_m, unit = samples.track.y[samples.used], samples.noise_m, samples.track.unit
    if not y.size:
        raise AnalysisError("no usable sample is left; see the counts of flagged samples")
    # If the distance steps or creeps, neighbouring samples are correlated: the mean is less certain than n suggests.
    u = float(np.std(y) * np.sqrt(correlation_length(y) / y.size))
    # A sensor with coarse steps gives nearly all distances alike at rest; the few others were flagged as false echoes.
    every = samples.track.y[np.isfinite(samples.track.y)]
    if (quantum_m := coarsest_step(np.sort(every), samples.quantum_m) or 0.0) > COARSE * noise_m:
        u = float(np.hypot(u, quantum_m / np.sqrt(12.0)))  # rounding error, which noise does not average out
    return {
        "offset": Estimate(float(np.mean(y)), u, unit),
        "noise": Estimate(noise_m, noise_m / np.sqrt(2.0 * y.size), unit),
    }
