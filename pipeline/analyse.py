"""The straight line from a track to findings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.damping import select as dampings
from pipeline.damping.select import Damping, fit_damping
from pipeline.errors import AnalysisError
from pipeline.motion import equation_fit as solutions
from pipeline.motion import phase as phases
from pipeline.motion import waveform_fit as fullfits
from pipeline.motion.equation_fit import MotionFit, MotionMisfit, fit_motion, moving_part
from pipeline.motion.overdamped import relaxation as relaxations
from pipeline.motion.overdamped.relaxation import Relaxation, find_relaxation, spring_constant
from pipeline.motion.phase import PhaseFit, fit_phase
from pipeline.motion.rest import Rest, fit_rest
from pipeline.motion.smoother import Smoothed, smooth
from pipeline.motion.waveform import Waveform, reconstruct
from pipeline.motion.waveform_fit import FullFit, fit_record
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.threads import one_thread
from pipeline.oscillation import condition as conditioning
from pipeline.oscillation import cycles as cycling
from pipeline.oscillation import demodulate as demodulation
from pipeline.oscillation import disturbances as separation
from pipeline.oscillation.condition import Conditioned, condition
from pipeline.oscillation.cycles import Cycles, NoOscillation, find_cycles
from pipeline.oscillation.demodulate import Demodulated, demodulate
from pipeline.oscillation.disturbances import Disturbances, separate
from pipeline.results import derive as derivation
from pipeline.results.derive import Derived, derive
from pipeline.results.effects import Effect, tabulate
from pipeline.results.findings import Finding, by_severity, count_quality, judge, judge_samples, judge_still
from pipeline.results.scene_findings import judge_scene
from pipeline.track import U8, Track

__all__ = ["Analysis", "Motion", "Params", "analyse"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of every stage.

    Parameters
    ----------
    condition, cycles, demodulate, disturbances, damping, phase, derive, relaxation, motion
        Of the stages of those names.
    full : pipeline.motion.waveform_fit.Params, optional
        Of the fit of the whole waveform; None leaves it out.
    """

    condition: conditioning.Params = field(default_factory=conditioning.Params)
    cycles: cycling.Params = field(default_factory=cycling.Params)
    demodulate: demodulation.Params = field(default_factory=demodulation.Params)
    disturbances: separation.Params = field(default_factory=separation.Params)
    damping: dampings.Params = field(default_factory=dampings.Params)
    phase: phases.Params = field(default_factory=phases.Params)
    derive: derivation.Params = field(default_factory=derivation.Params)
    full: fullfits.Params | None = None
    relaxation: relaxations.Params = field(default_factory=relaxations.Params)
    motion: solutions.Params = field(default_factory=solutions.Params)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """What the stages found in a record that oscillates."""

    cycles: Cycles
    demodulated: Demodulated
    damping: Damping
    phase: PhaseFit
    rest: Rest
    waveform: Waveform
    derived: Derived
    disturbances: Disturbances
    full: FullFit | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """One run, analysed.

    Parameters
    ----------
    track : Track
    scene : Scene
    params : Params
    conditioned : Conditioned
    motion : Motion or NoOscillation
        The latter says why there is nothing to fit; ``estimates`` then holds offset and noise alone. Where damping
        ends the motion within a few cycles it is a :class:`pipeline.motion.overdamped.relaxation.Relaxation` and
        brings its rates.
    effects : tuple of Effect
    findings : tuple of Finding
        Gravest first.
    estimates : mapping of str to Estimate
    """

    track: Track
    scene: Scene
    params: Params
    conditioned: Conditioned
    motion: Motion | NoOscillation
    effects: tuple[Effect, ...]
    findings: tuple[Finding, ...]
    estimates: Mapping[str, Estimate]

    @property
    def flags(self) -> U8:
        """(n,) uint8: the final flags of every sample."""
        return self.motion.demodulated.flags if isinstance(self.motion, Motion) else self.conditioned.flags

    @property
    def quality(self) -> dict[str, int]:
        """Counts of samples by flag, and of those used."""
        return count_quality(self.flags)

    @one_thread
    def smoothed(self) -> Smoothed:
        """Position, velocity and acceleration at every sample with their uncertainties; worked out when asked for.

        Raises
        ------
        AnalysisError
            If the record does not oscillate.

        Examples
        --------
        >>> t = np.arange(1000) / 100
        >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 3e-4 * np.random.default_rng(1).standard_normal(1000)
        >>> motion = analyse(Track.from_arrays(t, y)).smoothed()
        >>> error = motion.velocity + 0.05 * 8.3 * np.sin(8.3 * t)
        >>> bool(np.std(error) < 0.002 * 0.05 * 8.3)
        True
        """
        if isinstance(self.motion, NoOscillation):
            raise AnalysisError(f"there is no oscillation to smooth: {self.motion.why}")
        motion = self.motion
        return smooth(self.track, motion.demodulated, motion.phase, motion.rest, motion.disturbances)


@one_thread
def analyse(track: Track, scene: Scene | None = None, params: Params | None = None) -> Analysis:
    """Turn a track into estimates, laws, effects and findings.

    Parameters
    ----------
    track : Track
    scene : Scene, optional
        What is known of the bench; left out, nothing is.
    params : Params, optional

    Returns
    -------
    Analysis

    Raises
    ------
    AnalysisError
        If fewer than eight samples are usable.
    TrackError
        If the track is no length.

    Examples
    --------
    >>> t = np.arange(1000) / 100
    >>> rng = np.random.default_rng(1)
    >>> y = 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t) + 1e-4 * rng.standard_normal(1000)
    >>> print(analyse(Track.from_arrays(t, y)).estimates["period"])  # 2 pi / 8.3 = 0.757010
    0.757011 +- 0.000022 s
    """
    track.demand_length()
    scene, params = scene or Scene(), params or Params()
    if track.sigma_m is None and scene.sensor_sigma_m is not None:
        track = replace(track, sigma_m=scene.sensor_sigma_m.value)
    conditioned = condition(track, params.condition)
    cycles = find_cycles(conditioned, params.cycles)
    stopped = False
    share = 0.75 if isinstance(cycles, NoOscillation) else 0.25
    if (moving := moving_part(conditioned, share)) is not None:
        trimmed = find_cycles(moving, params.cycles)
        stopped = not isinstance(trimmed, NoOscillation)
        cycles = trimmed if stopped else cycles
    if isinstance(cycles, NoOscillation):
        return _still(track, scene, params, conditioned, find_relaxation(conditioned, params.relaxation) or cycles)
    demodulated = demodulate(conditioned, cycles, params.demodulate)
    if (why := _no_sinusoid(conditioned, demodulated)) is not None:
        return _still(track, scene, params, conditioned, find_relaxation(conditioned, params.relaxation) or why)
    demodulated, disturbances = separate(conditioned, cycles, demodulated, params.disturbances, params.demodulate)
    start = float(track.t[np.argmax(conditioned.used)])
    damping = fit_damping(demodulated, start, params.damping)
    solved = fit_motion(conditioned, demodulated, damping, params.motion, params.damping, stopped=stopped)
    strong = damping.best.rate_at_start() > params.relaxation.least_damping * demodulated.angular_frequency
    linear = not isinstance(solved, MotionFit) or solved.damping.selected == "linear"
    if strong and linear and isinstance(relaxed := find_relaxation(conditioned, params.relaxation), Relaxation):
        return _still(track, scene, params, conditioned, relaxed)
    if isinstance(solved, MotionFit):
        demodulated, disturbances = solved.windows(demodulated), Disturbances.nothing(conditioned)
        damping, phase, rest = solved.damping, solved.phase(demodulated), solved.rest(demodulated)
        waveform = solved.waveform
    else:
        phase = fit_phase(demodulated, damping, params.phase)
        rest = fit_rest(demodulated)
        waveform = reconstruct(disturbances.conditioned.track, demodulated, phase, rest)
    full = None
    if params.full is not None and not isinstance(solved, MotionFit):
        # The record without modes and with their columns: as good as the whole record with them, for the columns span
        # what was taken out. Values and intervals agree to rounding, and put_back serves both tiers.
        extra = disturbances.columns(track.t)
        full = fit_record(
            disturbances.conditioned, demodulated, damping, phase, rest, waveform, extra=extra, params=params.full
        )
        demodulated = replace(demodulated, flags=full.flags)
        damping, phase, rest, waveform = full.damping, full.phase, full.rest, full.waveform
    rest, waveform = rest.stepping(disturbances.steps), waveform.with_disturbances(disturbances, track.t)
    instrument = Instrument.of(track, u_crystal=params.derive.u_clock_nominal)
    effects = tabulate(
        scene,
        damping,
        phase,
        rest,
        noise_m=demodulated.noise_m,
        instrument=instrument,
        disturbances=disturbances,
    )
    derived = derive(demodulated, damping, phase, rest, scene, effects, instrument=instrument, params=params.derive)
    findings = by_severity(
        judge(conditioned, cycles, demodulated, damping, phase, rest, waveform, disturbances),
        judge_scene(scene, effects),
        () if full is None or full.converged else (_not_converged(full),),
        () if solved is None else (_on_solution(solved),),
    )
    motion = Motion(cycles, demodulated, damping, phase, rest, waveform, derived, disturbances, full)
    return Analysis(track, scene, params, conditioned, motion, effects, findings, derived.estimates)


def _not_converged(full: FullFit) -> Finding:
    return Finding(
        "not_converged",
        "warning",
        f"the fit of the whole waveform did not converge in {full.steps} Gauss-Newton steps from the windows' values; "
        "these stand, as at standard accuracy",
    )


def _on_solution(solved: MotionFit | MotionMisfit) -> Finding:
    if isinstance(solved, MotionFit):
        return Finding("strongly_damped", "info", solved.why)
    return Finding("not_converged", "warning", solved.why)


def _no_sinusoid(conditioned: Conditioned, demodulated: Demodulated) -> NoOscillation | None:
    """Why the motion is no oscillation although its spectrum has a peak: a step or a ramp has one too."""
    most = demodulated.amplitude.size * 9 // 10
    size = float(np.partition(demodulated.amplitude, most)[most])
    left = demodulated.noise_m
    if not size > 1e-12 * float(np.max(np.abs(demodulated.offset))):
        return NoOscillation("the distance does not follow the period that its spectrum shows")
    if left > 0.15 * size and left > 4.0 * conditioned.noise_m:
        return NoOscillation(
            f"the distance moves, but not to and fro: a sinusoid of {size * 1e3:.3g} mm leaves {left * 1e3:.3g} mm"
        )
    return None


def _still(track: Track, scene: Scene, params: Params, conditioned: Conditioned, why: NoOscillation) -> Analysis:
    y = track.y[conditioned.used]
    if not y.size:
        raise AnalysisError("no usable sample is left; see the counts of flagged samples")
    # Where the distance steps or creeps, neighbours say the same: their number would make the mean look certain.
    u = float(np.std(y) * np.sqrt(correlation_length(y) / y.size))
    estimates = {
        "offset": Estimate(float(np.mean(y)), float(u), "m"),
        "noise": Estimate(conditioned.noise_m, conditioned.noise_m / np.sqrt(2.0 * y.size), "m"),
    }
    if isinstance(why, Relaxation):
        estimates = {**estimates, **why.estimates, **spring_constant(why, scene)}
    findings = (
        judge_still(why),
        *judge_samples(conditioned, conditioned.flags, conditioned.noise_m),
    )
    return Analysis(track, scene, params, conditioned, why, (), findings, estimates)
