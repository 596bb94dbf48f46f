"""The analysis: from a track to estimates and findings, one stage after the other.

Read :func:`analyse` from top to bottom. Each stage is a function whose result is a noun. A sample is flagged by the
conditioning, by the choice of the part (as outside, or as clipped, which may take back a plateau of the conditioning),
by the windows, and by the last fit, which may take back only a window's false echo.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.analysis import Analysis
from pipeline.bench.scene import Scene
from pipeline.checks.echoes import echoes_by_chance, find_clusters
from pipeline.checks.halves import compare_halves
from pipeline.checks.judge import judge
from pipeline.checks.residual import Misfit
from pipeline.findings.finding import why, worded
from pipeline.findings.motion import (
    apart_finding,
    damping_findings,
    fit_findings,
    kind_findings,
    motion_findings,
    several_findings,
)
from pipeline.findings.samples import clock_findings, part_findings, sample_findings
from pipeline.findings.scene import scene_findings
from pipeline.motion.at_rest import Rest
from pipeline.motion.fitted import Oscillation
from pipeline.motion.kinds import Motion, fit_motion
from pipeline.motion.lines import Apart, TwoModes, find_apart
from pipeline.motion.pendulum import with_law_of_pendulum
from pipeline.motion.relaxation import Relaxation
from pipeline.notice import Notice
from pipeline.numerics.levels import ROUNDS
from pipeline.numerics.threads import one_thread
from pipeline.options import Options
from pipeline.parts.part import Part, find_part
from pipeline.results.derive import derive
from pipeline.results.effects import tabulate
from pipeline.samples.condition import Samples, condition
from pipeline.track import F8, Track

__all__ = ["Analysis", "Oscillation", "Relaxation", "Rest", "TwoModes", "analyse"]


class Measured(NamedTuple):
    """What follows from the samples: the motion in a part of them, and what is noticed about the two."""

    part: Part
    samples: Samples
    motion: Motion
    apart: tuple[Apart, ...]
    notices: tuple[Notice, ...]
    misfits: tuple[Misfit, ...]
    options: Options


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
    scene = scene or Scene()
    return conclude(measure(track, scene, options or Options()), scene)


def of_samples(scene: Scene) -> tuple[object, ...]:
    """Return what :func:`measure` uses of a scene: the stated law, the sensor, a pendulum, whether it has a spring."""
    sensor = (value for name, value in vars(scene).items() if name.startswith("sensor_"))
    return scene.damping_law, scene.hangs_on_spring, scene.pendulum_length_m, *sensor


@one_thread
def measure(track: Track, scene: Scene, options: Options) -> Measured:
    """Fit the motion to the samples; what it needs of the scene is :func:`of_samples`."""
    if options.stated is None and scene.damping_law is not None:
        options = replace(options, stated=scene.damping_law)
    if (ppm := scene.sensor_clock_ppm) is not None:
        track = replace(track, clock_rate=(1e-6 * ppm.value, 1e-6 * ppm.u))
    if track.unit == "m" and track.sigma_m is None and scene.sensor_sigma_m is not None:
        track = replace(track, sigma_m=scene.sensor_sigma_m.value)
    samples = condition(track)
    apart = list[Apart]()
    while len(apart) < ROUNDS and (line := find_apart(samples)) is not None:
        apart.append(line)
        samples = condition(samples.less(line.wave).track)
    part = find_part(samples)
    motion, samples = fit_motion(part, options), part.samples
    if apart:
        samples, motion = _with_lines(samples, motion, np.sum([line.wave for line in apart], axis=0))
    motion, differ = compare_halves(motion)
    if isinstance(motion, Oscillation) and scene.pendulum_length_m is not None:
        motion = with_law_of_pendulum(motion, scene.pendulum_length_m, samples.track.unit)
    notices, misfits = judge(samples, motion, scene, part.lost)
    return Measured(part, samples, motion, tuple(apart), (*differ, *notices), misfits, options)


def conclude(measured: Measured, scene: Scene) -> Analysis:
    """Derive the results on a bench: the estimates, the effects and the findings."""
    part, samples, motion, apart, notices, misfits, options = measured
    track = samples.track
    effects = tabulate(track, motion, scene) if isinstance(motion, Oscillation) else ()
    derived = derive(track, motion, scene, effects, misfits)
    constant = "spring_constant" in derived.estimates
    left_out = part_findings(part.beginning(motion.start_s), float(track.t[0]), float(track.t[-1]))
    shown: tuple[Iterable[Notice], ...]
    kind = tuple[Notice, ...]()
    if isinstance(motion, Oscillation):
        shown = _shown(samples, motion, derived.estimates["offset"].value, notices)
    else:
        kind = tuple(kind_findings(motion, derived.estimates))
        shown = (kind, notices, sample_findings(samples, motion.flags, samples.noise))
    # A missing or wrong mass changes the spring constant more than anything that the recording shows.
    bench = scene_findings(scene, effects, derived.estimates) if constant or effects else ()
    return Analysis(
        track=track,
        scene=scene,
        options=options,
        samples=samples,
        motion=motion,
        effects=effects,
        findings=worded(track.unit, bench, map(apart_finding, apart), left_out, *shown, clock_findings(track)),
        derived=derived,
        why="; ".join(why(each, track.unit) for each in kind),
    )


def _with_lines(samples: Samples, motion: Motion, wave: F8) -> tuple[Samples, Motion]:
    """Return samples and motion with the lines that were subtracted before the fit, (n,)."""
    if isinstance(motion, Oscillation):
        waveform = replace(motion.waveform, position=motion.waveform.position + wave)
        motion = replace(motion, waveform=waveform)
    return samples.less(-wave), motion


def _shown(
    samples: Samples, motion: Oscillation, offset: float, notices: tuple[Notice, ...]
) -> tuple[Iterable[Notice], ...]:
    """Return the findings on an oscillation and its samples in groups."""
    windows, track = motion.windows, samples.track
    swing = offset, float(motion.damping.best.joint.values[0])
    clusters, by_chance = find_clusters(track, windows, motion.phase), echoes_by_chance(samples.flags, windows)
    of_samples = sample_findings(samples, windows.flags, windows.noise, clusters, swing, by_chance=by_chance)
    several = several_findings(samples, motion, notices)
    return (
        several,
        motion_findings(motion),
        damping_findings(motion.damping),
        notices,
        of_samples,
        fit_findings(motion, samples),
    )
