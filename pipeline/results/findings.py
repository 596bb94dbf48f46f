"""Judge: say in words what holds, what does not, and what the record cannot show."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.bench.spring import HEAVIEST_SHARE
from pipeline.damping.mixture import MixedDrag, find_mixed
from pipeline.damping.select import Damping
from pipeline.motion.equation_fit import EquationFit, EquationMisfit
from pipeline.motion.overdamped import Overdamped
from pipeline.motion.phase import PhaseFit, words_on_exponent
from pipeline.motion.waveform import Rest, Waveform
from pipeline.motion.waveform_fit import FullFit
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.quantity import amount
from pipeline.oscillation.cycles import Cycles
from pipeline.oscillation.demodulate import Demodulated, model_error
from pipeline.oscillation.disturbances import Disturbances
from pipeline.results.checks.finding import GRAVITY_M_PER_S2, Finding, by_severity
from pipeline.results.effects import Effect

__all__ = ["judge", "judge_fits", "judge_overdamped", "judge_scene"]


def judge_overdamped(found: Overdamped) -> Finding:
    """Return what is said of a motion that damping ends within a few cycles or without any.

    Parameters
    ----------
    found : Overdamped
    """
    if found.kind == "strong":
        return Finding(
            "strongly_damped",
            "info",
            f"{found.why}; it was fitted as one solution of the equation of motion with linear drag, "
            "and no damping law was chosen",
        )
    return Finding("overdamped", "warning", found.why)


def judge_fits(full: FullFit | None, solved: EquationFit | EquationMisfit | None) -> tuple[Finding, ...]:
    """Return what is said of the fits of a whole record, the gravest first.

    Parameters
    ----------
    full : FullFit or None
        Of the waveform.
    solved : EquationFit, EquationMisfit or None
        Of the equation of motion.
    """
    findings = []
    if full is not None and not full.converged:
        findings.append(
            Finding(
                "not_converged",
                "warning",
                f"the fit of the whole waveform did not converge from where the windows arrived: "
                f"{full.tried}; the windows' values stand, as at standard accuracy",
            )
        )
    if isinstance(solved, EquationFit):
        findings.append(Finding("strongly_damped", "info", solved.why))
    elif solved is not None:
        findings.append(Finding("not_converged", "warning", solved.why))
    return tuple(findings)


def judge_scene(scene: Scene, effects: tuple[Effect, ...]) -> tuple[Finding, ...]:
    """Return what to know of the inputs that results were derived from.

    Parameters
    ----------
    scene : Scene
    effects : tuple of Effect
        Say whether the spring's mass is in the model.

    Examples
    --------
    >>> bare = Scene.from_mapping({"bob": {"mass_kg": 0.2}})
    >>> [finding.code for finding in judge_scene(bare, ())]
    ['spring_mass_missing', 'uncertainty_missing']
    """
    springs = any(effect.name == "spring_mass" and effect.included for effect in effects)
    used = {
        "[bob] mass_kg": scene.bob_mass_kg,
        "[spring] mass_kg": scene.spring_mass_kg if springs else None,
        "[disc] diameter_m": scene.disc_diameter_m,
    }
    exact = [name for name, estimate in used.items() if estimate is not None and estimate.u == 0]
    found = []
    if unusual := scene.unusual():
        message = f"the scene states what no bench has: {'; '.join(unusual)}; check value and unit"
        found.append(Finding("scene_implausible", "warning", message))
    if scene.bob_mass_kg is not None and scene.spring_mass_kg is None:
        message = (
            "the scene does not weigh the spring, a part of which swings along: the spring constant counts none of it, "
            f"and its uncertainty a spring of 0 to {HEAVIEST_SHARE:g} of the bob's mass; write [spring] mass_kg"
        )
        found.append(Finding("spring_mass_missing", "warning", message))
    if exact:
        message = (
            f"the scene states {', '.join(exact)} without an uncertainty: taken as exact, so what is derived from "
            f"{'it' if len(exact) == 1 else 'them'} is less certain than its u says; write {{ value = ..., u = ... }}"
        )
        found.append(Finding("uncertainty_missing", "warning", message))
    return tuple(found)


def judge(
    cycles: Cycles,
    demodulated: Demodulated,
    damping: Damping,
    phase: PhaseFit,
    rest: Rest,
    waveform: Waveform,
    disturbances: Disturbances | None = None,
    stated: Mapping[str, Estimate] | None = None,
) -> tuple[Finding, ...]:
    """Return what is said of a motion that oscillates and of its laws of damping, the gravest first.

    Parameters
    ----------
    cycles, demodulated, damping, phase, rest, waveform, disturbances
        Outputs of the stages of those names.
    stated : mapping of str to Estimate, optional
        The coefficients that the results give, with all that they are uncertain by.
    """
    findings = [
        *_damping_findings(damping, stated or {}),
        *_motion_findings(cycles, demodulated, phase, rest, waveform),
        *_mode_findings(demodulated, phase, disturbances, rest.mean.unit),
    ]
    return by_severity(findings)


def _damping_findings(damping: Damping, stated: Mapping[str, Estimate]) -> Iterator[Finding]:
    rejected = [name for name, fit in damping.fits.items() if fit.rejected]
    if damping.fits and len(rejected) == len(damping.fits):
        yield Finding(
            "no_law_fits",
            "warning",
            f"no damping law describes the amplitude's fall to within its scatter; {damping.best.law.words} "
            f"comes nearest (reduced chi-square {_number(damping.best.reduced_chi2)}): period and amplitudes hold, "
            "quote the amplitude against time rather than the law's coefficients",
        )
    yield from _rejections(damping)
    if (mixed := find_mixed(damping)) is not None:
        yield Finding("mixed_drag", "info", _words_on_mixed(mixed, damping, stated))
    drags = [name for name in damping.admissible if name != "none"]
    if len(damping.admissible) > 1:
        names = ", ".join(damping.admissible)
        tail = "" if drags == list(damping.admissible) else "; it does not even show for certain that there is any"
        yield Finding("laws_not_separable", "info", f"the record cannot tell these damping laws apart: {names}{tail}")


def _words_on_mixed(mixed: MixedDrag, damping: Damping, stated: Mapping[str, Estimate]) -> str:
    fit = mixed.fit
    # One number has one uncertainty wherever it stands.
    told = stated if set(stated) == set(fit.law.parameters[1:]) else fit.joint.estimates()
    terms = " and ".join(f"{name} = {told[name]}" for name in fit.law.parameters[1:])
    alone = ", ".join(f"{damping.fits[name].law.words} by {_number(excess)}" for name, excess in mixed.against.items())
    words = f"{fit.law.words}: {terms}; the BIC of one term alone is higher, of {alone}"
    if not fit.rejected:
        return words
    power = damping.fits.get("power")
    free = "" if power is None else f"; a free power of the amplitude is n = {power.joint['n']}"
    return (
        f"{words}. Constant coefficients do not hold from the first amplitude to the last (reduced chi-square "
        f"{_number(fit.reduced_chi2)}): uncertainties and BIC are by what they leave{free}"
    )


def _rejections(damping: Damping) -> Iterator[Finding]:
    """One sentence for each reason that speaks against laws, with the laws."""
    by_reason: dict[str, list[str]] = {}
    for fit in damping.fits.values():
        # As many parameters as windows leave no degree of freedom, and so no reduced chi-square.
        chi2 = f" ({_number(fit.reduced_chi2)})" if fit.dof > 0 else ""
        by_reason.setdefault(fit.rejection, []).append(f"{fit.law.words}{chi2}")
    best = damping.best
    leaves = f", where {damping.selected} leaves {best.reduced_chi2:.2g}" if best.dof > 0 else ""
    if "misfit" in by_reason:
        yield Finding(
            "law_rejected",
            "info",
            f"rejected by their reduced chi-square{leaves}: {', '.join(by_reason['misfit'])}",
        )
    if "negative" in by_reason:
        yield Finding(
            "law_rejected",
            "info",
            "rejected because a coefficient is negative beyond three standard uncertainties (reduced chi-square in "
            f"brackets): {', '.join(by_reason['negative'])}",
        )
    for fit in damping.fits.values():
        if fit.rejection == "not converged":
            yield Finding("law_rejected", "info", f"{fit.law.words}: no convergence after {fit.tried}")
    for name, why in damping.unfitted.items():
        yield Finding("law_rejected", "info", f"no fit of the law {name}: {why}")


def _number(value: float) -> str:
    """Three digits, in full."""
    if value > 1e6:
        return "over a million"
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"


def _motion_findings(
    cycles: Cycles, demodulated: Demodulated, phase: PhaseFit, rest: Rest, waveform: Waveform
) -> Iterator[Finding]:
    if demodulated.t.size < 4:
        yield Finding(
            "short_record",
            "warning",
            f"only {cycles.count:.1f} periods were recorded: damping and its law need ten and more",
        )
    if demodulated.lost:
        yield Finding(
            "missing_samples",
            "warning",
            f"{demodulated.lost} of {demodulated.lost + demodulated.t.size} periods hold too few usable samples "
            "and carry no amplitude",
        )
    if phase.backbone is not None:
        start = phase.damping.best.joint["A0"].value
        shift = phase.backbone.value * start**phase.exponent / phase.angular_frequency.value
        # A computed record shows how drag itself bends the phase, by the square of what it damps within a radian.
        by_drag = (phase.damping.best.rate_at_start() / phase.angular_frequency.value) ** 2
        if abs(shift) > by_drag:
            yield Finding(
                "amplitude_dependent_frequency",
                "warning",
                f"the frequency depends on amplitude: it is {100.0 * abs(shift):.2g}% "
                f"{'higher' if shift > 0 else 'lower'} at {amount(start, rest.mean.unit, '.0f')} than at rest and "
                f"shifts with {words_on_exponent(phase.exponent)}; the period given is the record's mean, its "
                "uncertainty covers the bend",
            )
    # What a computed record's rest position does within its digits disturbs no number.
    errors = model_error(demodulated.amplitude, demodulated.decay, demodulated.angular_frequency)
    if rest.moves and rest.range_m > float(np.max(errors)):
        yield Finding("rest_drift", "warning", _words_on_rest(rest, phase.damping.best.damping_rate().u))
    ratio = waveform.rms_m / demodulated.noise_m if demodulated.noise_m > 0 else 1.0
    excess, unit = phase.damping.scatter.excess, rest.mean.unit
    if ratio > 1.5:
        extra = f"; amplitudes of single periods scatter by {amount(excess, unit)} beyond their noise" if excess else ""
        yield Finding(
            "correlated_residuals",
            "warning",
            f"the smooth model leaves {amount(waveform.rms_m, unit)} where samples scatter by "
            f"{amount(demodulated.noise_m, unit)} within a period{extra}; uncertainties were widened by what is left",
        )


def _mode_findings(
    demodulated: Demodulated, phase: PhaseFit, disturbances: Disturbances | None, unit: str
) -> Iterator[Finding]:
    own = [] if disturbances is None else [mode for mode in disturbances.sideways.modes if mode.kind == "mode"]
    if disturbances is None or not own:
        return
    main = phase.angular_frequency.value / (2.0 * math.pi)
    mode = own[0]
    f, share = mode.frequency.value, mode.amplitude.value / float(np.median(demodulated.amplitude))
    long_m = GRAVITY_M_PER_S2 / (2.0 * math.pi * f) ** 2
    pendulum = f"; a pendulum {long_m:.2g} m long swings like that" if f < main and unit == "m" else ""
    others = f", and {len(own) - 1} more" if len(own) > 1 else ""
    fate = "they were" if others else "it was"
    yield Finding(
        "sideways_mode",
        "warning" if disturbances.modelled and share > 0.01 else "info",
        f"a second mode of {amount(mode.amplitude.value, unit)} at {f:.4g} Hz beats with the oscillation every "
        f"{1.0 / abs(f - main):.2g} s{pendulum}{others}; "
        + (f"{fate} fitted along" if disturbances.modelled else f"{fate} left in, too small to disturb the amplitude"),
    )


def _words_on_rest(rest: Rest, u_rate: float) -> str:
    unit = rest.mean.unit
    drift = f"drifts by {amount(rest.drift_m, unit)} during the record" if rest.drifts else ""
    shown = [f"{amount(step.height.value, unit, '+.2g')} at {step.time.value:.4g} s" for step in rest.steps[:5]]
    more = f" and {len(rest.steps) - 5} more" if len(rest.steps) > 5 else ""
    jumps = f"jumps {len(rest.steps)} time{'s' * (len(rest.steps) > 1)}: {', '.join(shown)}{more}" if shown else ""
    said = f"the rest position {' and '.join(part for part in (drift, jumps) if part)}"
    if not rest.drifts or unit != "m" or not rest.mean.value > 0.0:
        return said
    share, seconds = rest.drift_m / rest.mean.value, float(np.ptp(rest.t))
    if share < u_rate * seconds:
        return said
    return (
        f"{said}; if it is the scale that drifts, as of a sensor or air that warms, amplitudes go along by "
        f"{share:.2g} of themselves, and the damping rate is off by some {share / seconds:.1g} 1/s"
    )
