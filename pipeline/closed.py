"""Analyses of recordings without a period to be averaged over: a relaxation, two modes, or a bob at rest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from pipeline.analysis import Analysis, Motion, Still
from pipeline.bench.scene import Scene
from pipeline.checks.residual import COARSE
from pipeline.checks.sensor import held_count, held_numbers
from pipeline.errors import AnalysisError
from pipeline.findings.finding import worded
from pipeline.findings.motion import relaxation_findings
from pipeline.findings.samples import clock_findings, sample_findings
from pipeline.motion.relaxation import Relaxation, find_relaxation, spring_constant
from pipeline.motion.two_modes import TwoModes, find_two_modes
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length
from pipeline.options import Options
from pipeline.samples.condition import Samples, coarsest_step
from pipeline.windows.cycles import NoOscillation


def without_period(samples: Samples, why: NoOscillation, scene: Scene, options: Options) -> Analysis:
    """Classify a recording without a clear period: a relaxation, two modes of similar strength, or a bob at rest."""
    relaxed = find_relaxation(samples)
    if isinstance(relaxed, Relaxation):
        return overdamped(samples, relaxed, scene, options)
    if (two := find_two_modes(samples)) is not None:
        return two_modes(samples, two, scene, options)
    return still(samples, relaxed or why, scene, options)


def overdamped(samples: Samples, found: Relaxation, scene: Scene, options: Options) -> Analysis:
    """Return the analysis of a motion that damping ends within a few cycles, or before one cycle is complete."""
    estimates = {**_at_rest(samples), **found.estimates, **spring_constant(found, scene)}
    return _ended(samples, found, relaxation_findings(found), estimates, scene, options)


def two_modes(samples: Samples, two: TwoModes, scene: Scene, options: Options) -> Analysis:
    """Return the analysis of a recording of two oscillations, neither of which is the main one."""
    finding = Notice("two_modes", {name: x.value for name, x in two.estimates.items()} | {"why": two.why})
    return _ended(samples, Still(two.why), (finding,), {**_at_rest(samples), **two.estimates}, scene, options)


def still(samples: Samples, why: NoOscillation, scene: Scene, options: Options) -> Analysis:
    """Return the analysis of a recording without a motion to fit."""
    findings = [Notice("no_oscillation", {"why": why.why})]
    if (count := held_count(samples)) > 1:
        findings.append(Notice("held_samples", held_numbers(count, 1.0 / samples.track.rate_hz)))
    return _ended(samples, Still(why.why), findings, _at_rest(samples), scene, options)


def _ended(
    samples: Samples,
    motion: Motion,
    first: Iterable[Notice],
    estimates: Mapping[str, Estimate],
    scene: Scene,
    options: Options,
) -> Analysis:
    track = samples.track
    findings = worded(track.unit, first, sample_findings(samples, samples.flags, samples.noise), clock_findings(track))
    return Analysis(
        track=track,
        scene=scene,
        options=options,
        samples=samples,
        motion=motion,
        effects=(),
        findings=findings,
        estimates=estimates,
    )


def _at_rest(samples: Samples) -> dict[str, Estimate]:
    """Return the mean and the noise of the samples used."""
    y, noise, unit = samples.track.y[samples.used], samples.noise, samples.track.unit
    if not y.size:
        raise AnalysisError("no usable sample is left", "see the counts of flagged samples")
    # If the distance steps or creeps, neighbouring samples are correlated: the mean is less certain than n suggests.
    u = float(np.std(y) * np.sqrt(correlation_length(y) / y.size))
    # A sensor with coarse steps gives nearly all distances alike at rest; the few others were flagged as false echoes.
    every = samples.track.y[np.isfinite(samples.track.y)]
    if (quantum := coarsest_step(np.sort(every), samples.quantum) or 0.0) > COARSE * noise:
        u = float(np.hypot(u, quantum / np.sqrt(12.0)))  # rounding error, which noise does not average out
    return {
        "offset": Estimate(float(np.mean(y)), u, unit),
        "noise": Estimate(noise, noise / np.sqrt(2.0 * y.size), unit),
    }
