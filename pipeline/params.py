"""Options of an analysis, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.checks import harmonics, model, plausibility
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
    harmonics, model, plausibility
        Options of the checks with the same names in :mod:`pipeline.checks`.
    """

    harmonics: harmonics.Params = field(default_factory=harmonics.Params)

    model: model.Params = field(default_factory=model.Params)
    plausibility: plausibility.Params = field(default_factory=plausibility.Params)


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of every stage.

    Parameters
    ----------
    condition, cycles, demodulate, segments, disturbances, damping, phase, derive, relaxation, motion, checks
        Options of the stages with the same names.
    full : pipeline.motion.waveform_fit.Params, optional
        Options of the fit of the whole waveform; None omits this fit.
    most_parts : int
        Maximum number of times that a freely moving part is sought within the part found before.
    early, late : float
        Shares of the samples used. If the bob stops before the share ``early``, its rest is left out. If it stops later
        but before ``late``, its rest is left out only if the whole recording shows no oscillation, or if a time at rest
        was already left out.
    beating : float
        Threshold for trying a fit of two modes: the share of the amplitude by which typical periods differ from the
        fitted oscillation. The typical difference is about this large if one mode is a third of the other.
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
    most_parts: int = 4
    early: float = 0.25
    late: float = 0.75
    beating: float = 0.3
    relaxation: overdamped.Params = field(default_factory=overdamped.Params)
    motion: equation_fit.Params = field(default_factory=equation_fit.Params)
    checks: CheckParams = field(default_factory=CheckParams)


STANDARD = Params()
