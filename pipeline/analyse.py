"""The analysis: from a track to estimates and findings, one stage after the other.

Read :func:`analyse` from top to bottom. Each stage is a function whose result is a noun. A sample is flagged by the
conditioning, by the choice of the part (as outside, or as clipped, which may take back a plateau of the conditioning),
by the windows, and by the last fit, which may take back only a window's false echo.
"""

from __future__ import annotations

from dataclasses import replace

from pipeline.analysis import Analysis, Oscillation, Still
from pipeline.bench.scene import Scene
from pipeline.bench.sensor_filter import SensorFilter
from pipeline.checks.echoes import echoes_by_chance, find_clusters
from pipeline.checks.judge import judge
from pipeline.checks.residual import COARSE
from pipeline.closed import overdamped, still, two_modes, without_period
from pipeline.damping.select import Damping, fit_laws
from pipeline.findings.finding import worded
from pipeline.findings.motion import damping_findings, fit_findings, motion_findings
from pipeline.findings.samples import clock_findings, part_findings, sample_findings
from pipeline.findings.scene import scene_findings
from pipeline.modes.mode import Modes
from pipeline.modes.subtract import separate
from pipeline.motion.averaged import check_coherence, fit_windows, typical_miss
from pipeline.motion.by_samples import FEW_WINDOWS, fit_samples
from pipeline.motion.equation import fit_equation
from pipeline.motion.fitted import Fitted
from pipeline.motion.relaxation import LEAST_DAMPING, Relaxation, find_relaxation
from pipeline.motion.two_modes import WEAKER, find_two_modes
from pipeline.numerics.threads import one_thread
from pipeline.options import Options
from pipeline.parts.part import check_sinusoid, find_part, start_of
from pipeline.results.derive import derive
from pipeline.results.effects import tabulate
from pipeline.samples.condition import Samples, condition
from pipeline.track import Track
from pipeline.windows.cycles import NoOscillation
from pipeline.windows.demodulate import Windows
from pipeline.windows.rounding import rounded

__all__ = ["Analysis", "Oscillation", "Relaxation", "Still", "analyse"]


@one_thread
def analyse(track: Track, scene: Scene | None = None, options: Options | None = None) -> Analysis:
    """Turn a track into estimates, laws, effects and findings.

    The damping law of the scene counts as the stated law unless ``options`` state another. An :class:`AnalysisError`
    says that fewer than eight samples are usable.

    >>> import numpy as np
    >>> t = np.arange(1000) / 100
    >>> rng = np.random.default_rng(1)
    >>> y = 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t) + 1e-4 * rng.standard_normal(1000)
    >>> print(analyse(Track.from_arrays(t, y)).estimates["period"])  # 2 pi / 8.3 = 0.757010
    0.757010 +- 0.000022 s
    """
    scene, options = scene or Scene(), options or Options()
    if options.stated is None and scene.damping_law is not None:
        options = replace(options, stated=scene.damping_law)
    if (ppm := scene.sensor_clock_ppm) is not None:
        track = replace(track, clock_rate=(1e-6 * ppm.value, 1e-6 * ppm.u))
    if track.unit == "m" and track.sigma_m is None and scene.sensor_sigma_m is not None:
        track = replace(track, sigma_m=scene.sensor_sigma_m.value)
    samples = condition(track)
    part = find_part(samples)
    if isinstance(part, NoOscillation):
        return without_period(samples, part, scene, options)
    samples, track = part.samples, part.samples.track
    if (why := check_sinusoid(samples, part.windows)) is not None:
        return without_period(samples, why, scene, options)
    windows, modes = separate(samples, part.cycles, part.windows, sought=options.modes)
    windows = rounded(windows, samples.quantum)
    begin, coarse = start_of(samples, windows.angular_frequency), (samples.quantum or 0.0) > COARSE * windows.noise
    laws = fit_laws(windows, begin, options.laws, options.known_law, track.unit, coarse=coarse)

    # For strong damping, or friction that stops the bob, the equation of motion is fitted, not its cycle average.
    solved = fit_equation(samples, windows, laws, stopped=part.stopped)
    fitted = solved if isinstance(solved, Fitted) else _averaged(windows, modes, laws, samples, options)
    if _may_relax(fitted, laws) and isinstance(relaxed := find_relaxation(samples), Relaxation):
        return overdamped(samples, relaxed, scene, options)
    missed = 0.0 if fitted.method == "equation" else typical_miss(fitted)
    incoherent = check_coherence(fitted, missed)
    if (incoherent or missed > WEAKER) and (two := find_two_modes(samples)) is not None:
        return two_modes(samples, two, scene, options)
    if incoherent is not None:
        return still(samples, incoherent, scene, options)

    found, misfits = judge(samples, fitted, SensorFilter.of(scene, track.rate_hz), part.lost)
    effects = tabulate(track, fitted, scene)
    derived = derive(track, fitted, scene, effects, misfits)
    windows, swing = fitted.windows, (derived.estimates["offset"].value, fitted.damping.best.joint.values[0])
    findings = worded(
        track.unit,
        # A missing or wrong mass changes the spring constant more than anything that the recording shows.
        scene_findings(scene, effects, derived.estimates),
        part_findings(part.partition, float(track.t[0]), float(track.t[-1])),
        motion_findings(part.cycles, fitted),
        damping_findings(fitted.damping),
        found,
        sample_findings(
            samples,
            windows.flags,
            windows.noise,
            find_clusters(track, windows, fitted.phase),
            swing,
            by_chance=echoes_by_chance(samples.flags, windows),
        ),
        fit_findings(fitted, solved if isinstance(solved, str) else ""),
        clock_findings(track),
    )
    motion = Oscillation.of(fitted, part.cycles, derived)
    return Analysis(
        track=track,
        scene=scene,
        options=options,
        samples=samples,
        motion=motion,
        effects=effects,
        findings=findings,
        estimates=derived.estimates,
    )


def _averaged(windows: Windows, modes: Modes, laws: Damping, samples: Samples, options: Options) -> Fitted:
    fitted = fit_windows(windows, modes, laws)
    by_samples = options.rows == "samples" or windows.t.size < FEW_WINDOWS
    return fit_samples(fitted, samples) if by_samples else fitted


def _may_relax(fitted: Fitted, laws: Damping) -> bool:
    """Return whether the damping is strong and, if the equation of motion was fitted, linear."""
    linear = fitted.method != "equation" or fitted.damping.best is fitted.damping.of_powers(1)
    return linear and laws.best.rate_at_start() / fitted.windows.angular_frequency > LEAST_DAMPING
