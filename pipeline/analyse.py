"""The straight line from a track to findings, with one branch for each kind of motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.bench.sensor_filter import SensorFilter
from pipeline.damping import select as dampings
from pipeline.errors import AnalysisError
from pipeline.motion import equation_fit as equations
from pipeline.motion import overdamped as relaxations
from pipeline.motion import phase as phases
from pipeline.motion import waveform_fit as fullfits
from pipeline.motion.equation_fit import EquationFit, EquationMisfit, fit_equation
from pipeline.motion.kinds import Fitted, Windows, astray, by_equation, by_windows, incoherent, see_windows
from pipeline.motion.overdamped import Overdamped, find_overdamped, spring_constant
from pipeline.motion.smoother import Smoothed, smooth
from pipeline.motion.two_modes import TwoModes, find_two_modes
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.threads import one_thread
from pipeline.oscillation import condition as conditioning
from pipeline.oscillation import cycles as cycling
from pipeline.oscillation import demodulate as demodulation
from pipeline.oscillation import disturbances as separation
from pipeline.oscillation import segments as segmentation
from pipeline.oscillation.condition import Conditioned, coarsest_step, condition
from pipeline.oscillation.cycles import Cycles, NoOscillation
from pipeline.registry.quantities import check_quantity
from pipeline.results import derive as derivation
from pipeline.results.checks.clock_findings import judge_clock
from pipeline.results.checks.contact import find_contact
from pipeline.results.checks.finding import Checked, Finding, by_severity
from pipeline.results.checks.halves import judge_halves
from pipeline.results.checks.modulation import judge_modulation
from pipeline.results.checks.plausibility import judge_plausibility
from pipeline.results.checks.sample_findings import STEPS, count_quality, find_clusters, judge_samples
from pipeline.results.checks.segment_findings import judge_rows, judge_segments
from pipeline.results.checks.self_check import check_residuals, holding, judge_held
from pipeline.results.checks.wave_slips import find_wave_slips
from pipeline.results.derive import Derived, derive
from pipeline.results.effects import Effect, tabulate
from pipeline.results.findings import judge, judge_fits, judge_overdamped, judge_scene
from pipeline.track import U8, Track

__all__ = ["STANDARD", "Analysis", "Oscillation", "Overdamped", "Params", "Still", "analyse"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of every stage.

    Parameters
    ----------
    condition, cycles, demodulate, segments, disturbances, damping, phase, derive, relaxation, motion
        Of the stages of those names.
    full : pipeline.motion.waveform_fit.Params, optional
        Of the fit of the whole waveform; None leaves it out.
    settle : bool
        Whether the whole waveform is fitted where the halves of a record contradict the model of the windows.
    """

    condition: conditioning.Params = field(default_factory=conditioning.Params)
    cycles: cycling.Params = field(default_factory=cycling.Params)
    demodulate: demodulation.Params = field(default_factory=demodulation.Params)
    segments: segmentation.Params = field(default_factory=segmentation.Params)
    disturbances: separation.Params = field(default_factory=separation.Params)
    damping: dampings.Params = field(default_factory=dampings.Params)
    phase: phases.Params = field(default_factory=phases.Params)
    derive: derivation.Params = field(default_factory=derivation.Params)
    full: fullfits.Params | None = None
    settle: bool = True
    relaxation: relaxations.Params = field(default_factory=relaxations.Params)
    motion: equations.Params = field(default_factory=equations.Params)


STANDARD = Params()
MOST_ROWS = 50_000  # of a record whose waveform is fitted though nobody asked for it
BEATING = 0.3  # of the amplitude, by which periods miss the oscillation found: there may be two


@dataclass(frozen=True, slots=True, eq=False)
class Oscillation(Fitted):
    """What the stages found in a record that oscillates, strongly damped or not: the fit, and what follows."""

    cycles: Cycles
    derived: Derived


@dataclass(frozen=True, slots=True)
class Still:
    """A record in which nothing moves that these stages know.

    Parameters
    ----------
    why : str
        One sentence.
    """

    why: str


Motion = Oscillation | Overdamped | Still


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """One run, analysed.

    Parameters
    ----------
    track : Track
    scene : Scene
    params : Params
    conditioned : Conditioned
    motion : Oscillation, Overdamped or Still
        Of an overdamped motion ``estimates`` hold the rates, of a still one offset and noise alone.
    effects : tuple of Effect
    findings : tuple of Finding
        Gravest first.
    estimates : mapping of str to Estimate
        By names of :data:`pipeline.registry.quantities.QUANTITIES`.

    Raises
    ------
    ValueError
        If the name of an estimate is not registered.
    """

    track: Track
    scene: Scene
    params: Params
    conditioned: Conditioned
    motion: Motion
    effects: tuple[Effect, ...]
    findings: tuple[Finding, ...]
    estimates: Mapping[str, Estimate]

    def __post_init__(self) -> None:
        for name in self.estimates:
            check_quantity(name)

    @property
    def flags(self) -> U8:
        """(n,) uint8: the final flags of every sample."""
        return self.motion.demodulated.flags if isinstance(self.motion, Oscillation) else self.conditioned.flags

    @property
    def quality(self) -> dict[str, int]:
        """Counts of samples by flag, and of those used."""
        return count_quality(self.flags)

    @one_thread
    def smoothed(self) -> Smoothed:
        """Position, velocity and acceleration at every sample with their uncertainties; worked out when called.

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
        motion = self.motion
        if not isinstance(motion, Oscillation):
            raise AnalysisError(f"there is no oscillation to smooth: {motion.why}")
        return smooth(self.track, motion.demodulated, motion.phase, motion.rest, motion.disturbances)


Found = tuple[Motion, tuple[Effect, ...], tuple[Finding, ...], Mapping[str, Estimate]]
"""What one branch finds: the last four attributes of an analysis."""


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

    Examples
    --------
    >>> t = np.arange(1000) / 100
    >>> rng = np.random.default_rng(1)
    >>> y = 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t) + 1e-4 * rng.standard_normal(1000)
    >>> print(analyse(Track.from_arrays(t, y)).estimates["period"])  # 2 pi / 8.3 = 0.757010
    0.757010 +- 0.000022 s
    """
    scene, params = scene or Scene(), params or STANDARD
    if track.unit == "m" and track.sigma_m is None and scene.sensor_sigma_m is not None:
        track = replace(track, sigma_m=scene.sensor_sigma_m.value)
    conditioned = condition(track, params.condition)
    windows = see_windows(
        conditioned,
        params.condition,
        params.cycles,
        params.demodulate,
        params.segments,
        params.disturbances,
        params.damping,
    )
    conditioned = conditioned if isinstance(windows, NoOscillation) else windows.conditioned
    solved = _solve_equation(windows, params)
    relaxed = find_overdamped(conditioned, params.relaxation) if _may_be_overdamped(windows, solved, params) else None
    if isinstance(relaxed, Overdamped):
        found = _overdamped(conditioned, scene, relaxed)
    elif isinstance(windows, NoOscillation):
        two = find_two_modes(conditioned) if windows.code == "no_oscillation" else None
        found = _still(conditioned, relaxed or windows) if two is None else _two_modes(conditioned, two)
    elif isinstance(solved, EquationFit):  # strongly damped
        found = _oscillation(windows, by_equation(windows, solved), solved, scene, params)
    else:
        fitted = by_windows(windows, params.phase, params.full)
        typical = astray(fitted)
        why = incoherent(fitted, conditioned.track, typical)
        two = find_two_modes(conditioned) if why is not None or typical > BEATING else None
        if two is not None:
            found = _two_modes(conditioned, two)
        elif why is not None:
            found = _still(conditioned, why)
        else:
            found = _oscillation(windows, fitted, solved, scene, params)
    return Analysis(conditioned.track, scene, params, conditioned, *found)


def _solve_equation(windows: Windows | NoOscillation, params: Params) -> EquationFit | EquationMisfit | None:
    """Return the solution of the equation of motion that a strongly damped oscillation follows."""
    if isinstance(windows, NoOscillation):
        return None
    return fit_equation(
        windows.conditioned,
        windows.demodulated,
        windows.damping,
        params.motion,
        params.damping,
        stopped=windows.stopped,
    )


def _may_be_overdamped(
    windows: Windows | NoOscillation, solved: EquationFit | EquationMisfit | None, params: Params
) -> bool:
    """Whether no oscillation is seen, or one whose damping is strong and, as far as its equation was solved, linear."""
    if isinstance(windows, NoOscillation):
        return windows.code == "no_oscillation"
    linear = not isinstance(solved, EquationFit) or solved.damping.selected == "linear"
    return linear and windows.damping_ratio > params.relaxation.least_damping


def _oscillation(
    windows: Windows, fitted: Fitted, solved: EquationFit | EquationMisfit | None, scene: Scene, params: Params
) -> Found:
    """What follows from an oscillation, however it was fitted."""
    fitted = fitted.in_unit(windows.conditioned.track.unit)
    track, cycles = windows.conditioned.track, windows.cycles
    demodulated, damping, phase = fitted.demodulated, fitted.damping, fitted.phase
    disturbances = fitted.disturbances
    rest = fitted.rest.stepping(disturbances.steps)
    waveform = fitted.waveform.with_disturbances(disturbances)
    instrument = Instrument.of(track, u_crystal=params.derive.u_clock_nominal)
    noise_m = demodulated.noise_m
    effects = tabulate(scene, damping, phase, rest, noise_m=noise_m, instrument=instrument, disturbances=disturbances)
    u_amplitude = damping.best.joint["A0"].u
    # Strong damping bends every period: its own solution holds what would look like harmonics.
    bent = isinstance(solved, EquationFit)
    smoothing = SensorFilter.of(scene, track.rate_hz)
    checked = Checked.together(
        judge_rows(windows.conditioned, waveform.rms_m),
        Checked()
        if bent
        else check_residuals(windows.conditioned, demodulated, disturbances, phase, u_amplitude, smoothing),
        judge_plausibility(windows.conditioned, demodulated, phase),
        Checked() if bent else judge_modulation(demodulated, damping, phase, track.unit),
        Checked() if bent else judge_halves(fitted, track.unit, _fit_whole(windows, fitted, params)),
    )
    derived = derive(
        demodulated,
        damping,
        phase,
        rest,
        scene,
        effects,
        instrument=instrument,
        params=params.derive,
        misfits=checked.misfits,
        smoothing=smoothing,
    )
    slips = find_wave_slips(track, demodulated)
    clusters = find_clusters(demodulated, lambda rows: phase.total(track.t[rows]), slips)
    findings = by_severity(
        judge_segments(windows.segments, find_contact(windows.conditioned, windows.segments, cycles.frequency_hz)),
        judge(cycles, demodulated, damping, phase, rest, waveform, disturbances, derived.coefficients),
        checked.findings,
        judge_samples(windows.conditioned, demodulated.flags, noise_m, clusters, slips),
        judge_scene(scene, effects),
        judge_fits(fitted.full, solved),
        judge_clock(track, instrument),
    )
    motion = Oscillation(demodulated, disturbances, damping, phase, rest, waveform, fitted.full, cycles, derived)
    return motion, effects, findings, derived.estimates


def _fit_whole(windows: Windows, fitted: Fitted, params: Params) -> Callable[[], Fitted] | None:
    """Return the fit of the whole waveform, to be made where windows contradict themselves; None for long records."""
    if not params.settle or fitted.full is not None or len(windows.conditioned.track) > MOST_ROWS:
        return None
    unit = windows.conditioned.track.unit
    # What it is asked for depends on no law that the windows speak against.
    return lambda: by_windows(windows, params.phase, fullfits.Params(besides=())).in_unit(unit)


def _overdamped(conditioned: Conditioned, scene: Scene, found: Overdamped) -> Found:
    """A motion that damping ends within a few cycles or without any."""
    estimates = {**_at_rest(conditioned), **found.estimates, **spring_constant(found, scene)}
    return found, (), _findings(conditioned, judge_overdamped(found)), estimates


def _still(conditioned: Conditioned, why: NoOscillation) -> Found:
    """A record without any motion to fit."""
    findings = _findings(conditioned, Finding(why.code, "error", why.why))
    if (held := holding(conditioned)) > 1:
        findings = by_severity(findings, (judge_held(held, 1.0 / conditioned.track.rate_hz, conditioned.track.unit),))
    return Still(why.why), (), findings, _at_rest(conditioned)


def _two_modes(conditioned: Conditioned, two: TwoModes) -> Found:
    """A record of two oscillations, neither of which is the motion."""
    findings = _findings(conditioned, Finding("two_modes", "error", two.why))
    return Still(two.why), (), findings, {**_at_rest(conditioned), **two.estimates}


def _at_rest(conditioned: Conditioned) -> dict[str, Estimate]:
    """Mean and noise of the samples used."""
    y, noise_m, unit = conditioned.track.y[conditioned.used], conditioned.noise_m, conditioned.track.unit
    if not y.size:
        raise AnalysisError("no usable sample is left; see the counts of flagged samples")
    # Where the distance steps or creeps, neighbours say the same: their number would make the mean look certain.
    u = float(np.std(y) * np.sqrt(correlation_length(y) / y.size))
    # Of a sensor at rest between two steps all but a few distances are alike, and these few were taken for echoes.
    every = conditioned.track.y[np.isfinite(conditioned.track.y)]
    if (quantum_m := coarsest_step(np.sort(every), conditioned.quantum_m) or 0.0) > STEPS * noise_m:
        u = float(np.hypot(u, quantum_m / np.sqrt(12.0)))  # rounding that noise does not reach over stays
    return {
        "offset": Estimate(float(np.mean(y)), u, unit),
        "noise": Estimate(noise_m, noise_m / np.sqrt(2.0 * y.size), unit),
    }


def _findings(conditioned: Conditioned, first: Finding) -> tuple[Finding, ...]:
    track = conditioned.track
    samples = judge_samples(conditioned, conditioned.flags, conditioned.noise_m)
    return by_severity((first,), samples, judge_clock(track, Instrument.of(track)))
