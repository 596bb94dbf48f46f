"""The kind of motion: which of the fits a recording gets."""

from __future__ import annotations

from dataclasses import replace

from pipeline.damping.select import Damping, fit_laws
from pipeline.modes.mode import Modes
from pipeline.modes.subtract import separate
from pipeline.motion.at_rest import Rest, rest_of
from pipeline.motion.averaged import check_coherence, fit_windows, typical_miss
from pipeline.motion.by_samples import FEW_WINDOWS, fit_samples
from pipeline.motion.equation import fit_equation
from pipeline.motion.fitted import Oscillation, Refusal
from pipeline.motion.lines import WEAKER, find_several
from pipeline.motion.relaxation import LEAST_DAMPING, Relaxation, find_relaxation
from pipeline.motion.two_modes import TwoModes, find_two_modes
from pipeline.numerics.levels import NEGLIGIBLE, VERY_STRONG
from pipeline.options import Options
from pipeline.parts.part import Part, check_sinusoid, start_of
from pipeline.samples.condition import COARSE, Samples
from pipeline.windows.cycles import NoOscillation
from pipeline.windows.demodulate import Windows
from pipeline.windows.rounding import rounded

Motion = Oscillation | Relaxation | TwoModes | Rest


def fit_motion(part: Part, options: Options) -> Motion:
    """Return the motion of a part: an oscillation, a relaxation, two modes of similar strength, or none.

    For strong damping, or friction that stops the bob, the equation of motion is fitted, not its cycle average.
    """
    samples, windows = part.samples, part.windows
    if isinstance(windows, NoOscillation):
        return _without_cycles(samples, windows)
    if (bent := check_sinusoid(samples, windows)) is not None:
        return _without_cycles(samples, bent, _strongest_lines(samples))
    windows, modes = separate(samples, windows, sought=options.modes and part.walk is None)
    windows = rounded(windows, samples.quantum)
    start_s, coarse = start_of(samples, windows.angular_frequency), (samples.quantum or 0.0) > COARSE * windows.noise
    laws = fit_laws(windows, start_s, options.laws, options.known_law, samples.track.unit, coarse=coarse)
    if part.walk is not None:
        fitted = fit_windows(windows, modes, laws)
        phase = replace(fitted.phase, angular_frequency=part.walk.angular_frequency, small_swings=None, walk=part.walk)
        return replace(fitted, phase=phase)
    solved = fit_equation(samples, windows, laws, stopped=part.stopped)
    fitted = solved if isinstance(solved, Oscillation) else _averaged(windows, modes, laws, samples, options)
    if isinstance(solved, Refusal):
        fitted = replace(fitted, refused=solved)
    if _may_relax(fitted, laws) and isinstance(relaxed := find_relaxation(samples), Relaxation):
        return relaxed
    missed = 0.0 if fitted.method == "equation" else typical_miss(fitted)
    incoherent = check_coherence(fitted, missed)
    if (incoherent or missed > WEAKER) and (two := find_two_modes(samples)) is not None:
        return two
    if incoherent is None:
        return fitted
    return rest_of(samples, f"{incoherent.why}{_strongest_lines(samples)}")


def _without_cycles(samples: Samples, why: NoOscillation, lines: str = "") -> Relaxation | TwoModes | Rest:
    relaxed = find_relaxation(samples)
    if isinstance(relaxed, Relaxation):
        return relaxed
    return find_two_modes(samples) or rest_of(samples, f"{(relaxed or why).why}{lines}")


def _strongest_lines(samples: Samples) -> str:
    """Return the lines that make up nearly all of a record, in words; empty if there are none."""
    lines = find_several(samples)
    if lines is None or lines.left > NEGLIGIBLE:
        return ""
    return f"; the strongest lines are {lines.listed(samples.track.unit)}"


def _averaged(windows: Windows, modes: Modes, laws: Damping, samples: Samples, options: Options) -> Oscillation:
    fitted = fit_windows(windows, modes, laws)
    by_samples = options.rows == "samples" or windows.t.size < FEW_WINDOWS
    return fit_samples(fitted, samples) if by_samples else fitted


def _may_relax(fitted: Oscillation, laws: Damping) -> bool:
    """Return whether the damping is strong and, as far as the equation of motion shows, linear.

    Linear drag, the simpler law, stands unless another one is better by very strong evidence after its price.
    """
    best, alone = fitted.damping.best, fitted.damping.of_powers(1)
    linear = alone is not None and not alone.rejected and alone.bic - best.bic <= VERY_STRONG
    strong = laws.best.rate_at_start() > LEAST_DAMPING * fitted.windows.angular_frequency
    return strong and (linear or fitted.method != "equation")
