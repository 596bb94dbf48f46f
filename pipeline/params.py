"""Options of an analysis, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.checks import harmonics, model, plausibility, sensor
from pipeline.damping import select as damping
from pipeline.motion import equation_fit, overdamped, phase, waveform_fit
from pipeline.results import derive
from pipeline.samples import condition
from pipeline.windows import cycles, demodulate, disturbances, segments

__all__ = ["STANDARD", "CheckParams", "Params"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckParams:
    """Options of the checks.

    Parameters
    ----------
    harmonics, sensor, model, plausibility
        Of the checks in :mod:`pipeline.checks` of those names.
    """

    harmonics: harmonics.Params = field(default_factory=harmonics.Params)
    sensor: sensor.Params = field(default_factory=sensor.Params)
    model: model.Params = field(default_factory=model.Params)
    plausibility: plausibility.Params = field(default_factory=plausibility.Params)


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of every stage.

    Parameters
    ----------
    condition, cycles, demodulate, segments, disturbances, damping, phase, derive, relaxation, motion, checks
        Of the stages of those names.
    full : pipeline.motion.waveform_fit.Params, optional
        Of the fit of the whole waveform; None leaves it out.
    settle : bool
        Whether the whole waveform is fitted where the halves of a run contradict the model of the windows.
    most_settled : int
        Samples of a run up to which that is done though nobody asked for it: 50,000 take about a second.
    most_parts : int
        Times that a freely moving part is looked for within the part found before.
    early, late : float
        Shares of the samples used. A bob that stops before the first share is looked at without its rest; one that
        stops before the second, only where the whole recording shows no oscillation.
    beating : float
        Share of the amplitude by which periods miss the oscillation fitted, from which two modes are tried: where one
        is a third of the other, the middle of the motion is off by as much.
    """

    condition: condition.Params = field(default_factory=condition.Params)
    cycles: cycles.Params = field(default_factory=cycles.Params)
    demodulate: demodulate.Params = field(default_factory=demodulate.Params)
    segments: segments.Params = field(default_factory=segments.Params)
    disturbances: disturbances.Params = field(default_factory=disturbances.Params)
    damping: damping.Params = field(default_factory=damping.Params)
    phase: phase.Params = field(default_factory=phase.Params)
    derive: derive.Params = field(default_factory=derive.Params)
    full: waveform_fit.Params | None = None
    settle: bool = True
    most_settled: int = 50_000
    most_parts: int = 4
    early: float = 0.25
    late: float = 0.75
    beating: float = 0.3
    relaxation: overdamped.Params = field(default_factory=overdamped.Params)
    motion: equation_fit.Params = field(default_factory=equation_fit.Params)
    checks: CheckParams = field(default_factory=CheckParams)


STANDARD = Params()
