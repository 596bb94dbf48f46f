"""The kind of motion: who decides it, in one table.

The candidates of :data:`CANDIDATES` are asked in their order. Each says by what is known until then whether it is
admitted, with the source of its limit, and then gives a fit or a refusal. The last fit stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.damping.laws.drag import Drag
from pipeline.damping.select import Damping, fit_laws
from pipeline.modes.mode import Modes
from pipeline.modes.subtract import separate
from pipeline.motion.at_rest import Rest, rest_of
from pipeline.motion.averaged import fit_windows, typical_miss
from pipeline.motion.by_samples import FEW_WINDOWS, fit_samples
from pipeline.motion.equation import drags, fit_equation
from pipeline.motion.fitted import Oscillation
from pipeline.motion.lines import WEAKER, TwoModes, find_several, find_two_modes
from pipeline.motion.relaxation import LEAST_DAMPING, Relaxation, find_relaxation
from pipeline.notice import Refusal
from pipeline.numerics.levels import FEWEST_FOR_LINE, NEGLIGIBLE, NOTICEABLE, VERY_STRONG
from pipeline.options import Options
from pipeline.parts.part import Part, check_sinusoid, start_of
from pipeline.samples.condition import COARSE
from pipeline.windows.demodulate import Windows
from pipeline.windows.rounding import rounded

Motion = Oscillation | Relaxation | TwoModes | Rest


class Cyclic(NamedTuple):
    """A part that consists of cycles: its windows, the other modes in it, and the laws of its amplitude."""

    windows: Windows
    modes: Modes
    laws: Damping


class Evidence(NamedTuple):
    """What is known of a part when a candidate is asked."""

    part: Part
    options: Options
    cycles: Cyclic | None
    motion: Motion | None  # the last fit
    refused: tuple[Refusal, ...]


def fit_motion(part: Part, options: Options) -> Motion:
    """Return the motion of a part: an oscillation, a relaxation, two modes of similar strength, or none."""
    cycles = _cycles(part, options)
    if isinstance(cycles, Refusal):
        known = Evidence(part, options, cycles=None, motion=None, refused=(cycles,))
    else:
        known = Evidence(part, options, cycles=cycles, motion=None, refused=())
    for candidate in CANDIDATES:
        outcome = candidate(known)
        if isinstance(outcome, Refusal):
            known = known._replace(refused=(*known.refused, outcome))
        elif outcome is not None:
            known = known._replace(motion=outcome)
    assert known.motion is not None
    return known.motion


def _cycles(part: Part, options: Options) -> Cyclic | Refusal:
    """Return the cycles of a part, or why it has none."""
    samples, windows = part.samples, part.windows
    if isinstance(windows, Refusal):
        return windows
    if (bent := check_sinusoid(samples, windows)) is not None:
        return bent
    windows, modes = separate(samples, windows, sought=options.modes and part.walk is None)
    windows = rounded(windows, samples.quantum)
    start_s, coarse = start_of(samples, windows.angular_frequency), (samples.quantum or 0.0) > COARSE * windows.noise
    laws = fit_laws(windows, start_s, options.laws, options.known_law, samples.track.unit, coarse=coarse)
    return Cyclic(windows, modes, laws)


def _by_equation(known: Evidence) -> Oscillation | Refusal | None:
    """Solve the equation of motion if averages over a cycle do not suffice.

    They are exact to first order of the damping ratio, and for linear drag or none exact, but they leave open whether
    friction has stopped the bob.
    """
    if known.cycles is None or known.part.walk is not None or not drags(known.cycles.laws):
        return None
    windows, _, laws = known.cycles
    best, ratio = laws.best, laws.best.rate_at_start() / windows.angular_frequency
    exact = isinstance(best.law, Drag) and set(best.law.powers) <= {1}
    ends = best.amplitude(np.array([float(np.max(windows.t)) - laws.t0]))[0] <= 0.0
    if not (known.part.stopped or ratio > LEAST_DAMPING or (not exact and (ratio > NOTICEABLE or ends))):
        return None
    return fit_equation(known.part.samples, windows, laws)


def _by_cycles(known: Evidence) -> Oscillation | None:
    """Average over cycles if the equation was not solved; the frequency is that of the walk if noise drives it."""
    if known.cycles is None or known.motion is not None:
        return None
    windows, modes, laws = known.cycles
    fitted = fit_windows(windows, modes, laws)
    if (walk := known.part.walk) is not None:
        phase = replace(fitted.phase, angular_frequency=walk.angular_frequency, small_swings=None, walk=walk)
        return replace(fitted, phase=phase)
    if known.options.rows == "samples" or windows.t.size < FEW_WINDOWS:
        fitted = fit_samples(fitted, known.part.samples)
    return replace(fitted, refused=(*known.refused, *fitted.refused))


def _by_relaxation(known: Evidence) -> Relaxation | Refusal | None:
    """Fit a relaxation if there are no cycles, or strong and, as far as the equation of motion shows, linear damping.

    Linear drag, the simpler law, stands unless another one is better by very strong evidence after its price.
    """
    if isinstance(fitted := known.motion, Oscillation) and known.cycles is not None:
        damping, laws = fitted.damping, known.cycles.laws
        alone = damping.of_powers(1)
        linear = alone is not None and not alone.rejected and alone.bic - damping.best.bic <= VERY_STRONG
        strong = laws.best.rate_at_start() > LEAST_DAMPING * fitted.windows.angular_frequency
        if known.part.walk is not None or not strong or (fitted.method == "equation" and not linear):
            return None
    return find_relaxation(known.part.samples)


def _by_two_modes(known: Evidence) -> TwoModes | Refusal | None:
    """Fit two modes if nothing is fitted yet, or windows miss the average by as much as a second mode that counts."""
    return find_two_modes(known.part.samples) if known.motion is None or _missed(known) > WEAKER else None


def _at_rest(known: Evidence) -> Rest | None:
    """Return no motion if nothing is fitted, or half of the phasors differ from the average by more than their length.

    Random phasors do. The strongest lines are named if they make up nearly all of a record that has a period.
    """
    samples, missed = known.part.samples, _missed(known)
    if known.motion is None:
        first = known.refused[0]
        why = next((each for each in known.refused if each.code == "exponential"), first)
        periodic = first.code in ("no_period", "bent")
    elif missed >= 1.0 and known.cycles is not None and known.cycles.windows.t.size >= FEWEST_FOR_LINE:
        why, periodic = Refusal("incoherent", {"percent": 100.0 * missed}), True
    else:
        return None
    if periodic:
        lines = find_several(samples)
        if lines is not None and lines.left <= NEGLIGIBLE:
            why = replace(why, numbers={**why.numbers, "listed": lines.listed(samples.track.unit)})
    return rest_of(samples, why)


def _missed(known: Evidence) -> float:
    """Return by how much of their amplitude half of the windows miss the motion averaged over cycles."""
    motion = known.motion
    if not isinstance(motion, Oscillation) or motion.method == "equation" or known.part.walk is not None:
        return 0.0
    return typical_miss(motion)


CANDIDATES: tuple[Callable[[Evidence], Motion | Refusal | None], ...] = (
    _by_equation,
    _by_cycles,
    _by_relaxation,
    _by_two_modes,
    _at_rest,
)
