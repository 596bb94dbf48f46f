"""Findings on the motion and its damping: period, rest position, second modes, laws, and where the model fails."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import words_of
from pipeline.damping.select import Damping
from pipeline.motion.at_rest import Rest
from pipeline.motion.by_samples import FEW_WINDOWS
from pipeline.motion.fitted import Oscillation, RestPosition
from pipeline.motion.kinds import Motion
from pipeline.motion.lines import Apart, TwoModes, find_several
from pipeline.motion.relaxation import Relaxation
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import NOTICEABLE, VERY_STRONG
from pipeline.samples.condition import Samples
from pipeline.units import amount, number
from pipeline.windows.demodulate import model_error


def kind_findings(motion: Motion, estimates: Mapping[str, Estimate]) -> Iterator[Notice]:
    """Yield what kind of motion a recording shows, if it is not an oscillation of many cycles."""
    if isinstance(motion, Relaxation) and motion.kind == "strong":
        ratio = motion.damping_ratio
        yield Notice("strongly_damped", {"damping_ratio": ratio.value, "with_u": str(ratio)})
    elif isinstance(motion, Relaxation):
        rates = {name: x for name, x in estimates.items() if name.startswith("relaxation_rate")}
        with_u = {name.removeprefix("relaxation_"): str(x) for name, x in rates.items()}
        yield Notice("overdamped", {**{name: x.value for name, x in rates.items()}, **with_u})
    elif isinstance(motion, TwoModes):
        both = {name: x.value for name, x in estimates.items() if "_mode_" in name}
        (first, first_s), (second, second_s) = (_mode(estimates, name) for name in ("first", "second"))
        beat_s = 1.0 / abs(1.0 / first_s - 1.0 / second_s)
        yield Notice("two_modes", {**both, "first": first, "second": second, "beat_s": beat_s})
    elif isinstance(motion, Rest):
        yield Notice("no_oscillation", motion.why.named)


def _mode(estimates: Mapping[str, Estimate], name: str) -> tuple[str, float]:
    """Return the period of a mode with its u and amplitude in words, and as a number."""
    period, size = estimates[f"{name}_mode_period"], estimates[f"{name}_mode_amplitude"]
    return f"{period} ({amount(size.value, size.unit)})", period.value


def apart_finding(line: Apart) -> Notice:
    """Return what a line is that was subtracted before the fit."""
    numbers = {"amplitude_m": line.amplitude, "frequency_hz": line.frequency_hz}
    if line.cause == "overtone":
        return Notice("overtone", numbers)
    return Notice("driven", {**numbers, "cause": "mains hum" if line.cause == "mains" else "a drive"})


def several_findings(samples: Samples, motion: Oscillation, notices: tuple[Notice, ...]) -> Iterator[Notice]:
    """Yield the lines that describe a recording, if one oscillation does not."""
    contradicted = not motion.damping.admissible or any(found.code == "model_misfit" for found in notices)
    if motion.phase.walk is not None or not contradicted:
        return
    lines = find_several(samples)
    if lines is not None and lines.are_several() and lines.leaves_noise(samples):
        yield Notice("several_lines", {"lines": len(lines.sizes), "listed": lines.listed(samples.track.unit)})


def fit_findings(fitted: Oscillation, samples: Samples) -> Iterator[Notice]:
    """Yield what the fits of the samples came to."""
    if fitted.phase.squared_rate is not None:
        best, omega = fitted.damping.best, fitted.phase.angular_frequency.value
        ratio = best.rate_at_start() / math.sqrt(omega**2 + fitted.phase.squared_rate)
        last = float(np.max(samples.track.t[samples.used])) - fitted.start_s
        ends = "stops" if best.amplitude(np.array([last]))[0] <= 0.0 else "goes_on"
        law, rms = words_of(best.law), fitted.waveform.rms
        yield Notice("strongly_damped", {ends: "", "ratio": ratio, "law": law, "rms_m": rms})
    for refused in fitted.refused:
        yield Notice("not_converged", refused.named)


def motion_findings(fitted: Oscillation) -> Iterator[Notice]:
    """Yield what the fit of an oscillation shows of its motion."""
    windows, phase, rest = fitted.windows, fitted.phase, fitted.rest
    count, omega = windows.t.size, phase.angular_frequency.value
    if count < FEW_WINDOWS:
        yield Notice("short_record", {"periods": windows.cycles.count, "windows": count})
    if windows.lost:
        lost = {"periods": windows.lost, "all_periods": windows.lost + count}
        yield Notice("missing_samples", lost, "warning")
    # In computed data drag itself shifts the frequency, by the square of the decrease of the amplitude in a radian.
    least = (fitted.damping.best.rate_at_start() / omega) ** 2
    if phase.bend is not None and phase.walk is None and abs(fitted.shift) > least:
        yield _changing(fitted)
    # In computed data, changes of the rest position below the error of the sinusoidal model affect no number.
    errors = model_error(windows.amplitude, windows.decay, windows.angular_frequency)
    if rest.drifts and rest.drift > float(np.max(errors)):
        yield _rest_drift(rest, fitted.damping.best.damping_rate().u)
    if rest.mean.unit == "m/s^2":
        yield Notice("one_axis")
    yield from _modes(fitted, rest.mean.unit)


def _changing(fitted: Oscillation) -> Notice:
    """Return how the frequency changes: with the amplitude, with time, or with one of them."""
    bend, shift = fitted.phase.bend, fitted.shift
    if bend is None or fitted.phase.of_amplitude:
        start = float(fitted.damping.best.joint.values[0])
        numbers = {"relative_shift": shift, "amplitude_m": start, "higher" if shift > 0 else "lower": abs(shift)}
        return Notice("amplitude_dependent_frequency", numbers)
    either = {"either": abs(shift)} if bend.by_amplitude else {}
    return Notice("frequency_drift", {"relative_shift": shift, "rises" if shift > 0 else "falls": abs(shift), **either})


def _rest_drift(rest: RestPosition, u_rate: float) -> Notice:
    numbers = {"drift_m": rest.drift}
    if rest.mean.unit == "m" and rest.mean.value > 0.0:
        share, seconds = rest.drift / rest.mean.value, float(np.ptp(rest.curve.domain))
        if share >= u_rate * seconds:
            numbers |= {"scale_change": share, "damping_rate_error": share / seconds}
    return Notice("rest_drift", numbers)


def _modes(fitted: Oscillation, unit: str) -> Iterator[Notice]:
    modes, main = fitted.modes, fitted.phase.angular_frequency.value / (2.0 * math.pi)
    own = [mode for mode in modes.members if mode.kind == "mode"]
    if not own:
        return
    f, size = own[0].frequency_hz, own[0].amplitude
    large = size > NOTICEABLE * float(np.median(fitted.windows.amplitude))
    further = ", ".join(f"{amount(m.amplitude, unit)} at {m.frequency_hz:.4g} Hz" for m in own[1:])
    numbers = {
        "frequency_hz": f,
        "amplitude_m": size,
        "beat_s": 1.0 / abs(f - main),
        "modes": len(own),
        "pendulum_metres": GRAVITY_M_PER_S2 / (2.0 * math.pi * f) ** 2 if f < main and unit == "m" else None,
        "further": further or None,
    }
    yield Notice("sideways_mode", numbers, "warning" if modes.subtracted is not None and large else "info")


def damping_findings(damping: Damping) -> Iterator[Notice]:
    """Yield which laws fit, which do not, and which cannot be distinguished."""
    rejected = [name for name, fit in damping.fits.items() if fit.rejected]
    if damping.fits and len(rejected) == len(damping.fits):
        nearest = min(damping.fits.values(), key=lambda fit: fit.reduced_chi2) if damping.by_statement else damping.best
        rival = damping.fits.get(nearest.beaten_by)
        driven = None if rival is None else words_of(rival.law)
        chi2 = nearest.reduced_chi2
        yield Notice("no_law_fits", {"reduced_chi2": chi2, "nearest": words_of(nearest.law), "driven": driven})
    elif damping.growth_rate:
        yield Notice("growing", {"growth_rate": damping.growth_rate})
    elif damping.stated:
        yield from _stated_law(damping)
    if rejected or damping.unfitted:
        unfitted = len(damping.unfitted)
        numbers = {"rejected": len(rejected) + unfitted, "tried": len(damping.fits) + unfitted}
        yield Notice("law_rejected", {**numbers, **_reasons(damping)})
    if len(damping.possible) > 1:
        laws = [damping.fits[name].law for name in damping.possible]
        undamped = next((words_of(law) for law in laws if len(law.parameters) == 1), None)
        names = ", ".join(words_of(law) for law in laws)
        yield Notice("laws_not_separable", {"laws": len(laws), "names": names, "undamped": undamped})


def _stated_law(damping: Damping) -> Iterator[Notice]:
    """Yield that a stated law was not fitted, that chi-square rejects it, or that another law beats it."""
    if not damping.by_statement:
        why = damping.unfitted.get(damping.stated, "its fit failed")
        yield Notice("stated_law_rejected", {"law": damping.stated, "why": why})
        return
    best = damping.best
    other = min((fit for fit in damping.fits.values() if not fit.rejected), key=lambda fit: fit.bic, default=best)
    excess = best.bic - other.bic
    if best.rejected or excess > VERY_STRONG:
        numbers = {"reduced_chi2": best.reduced_chi2, "other_chi2": other.reduced_chi2, "bic_excess": excess}
        yield Notice("stated_law_rejected", {**numbers, "law": best.name, "other": other.name})


def _reasons(damping: Damping) -> dict[str, str]:
    """Return the laws that are rejected, or have no fit, by the reason."""
    best = damping.best
    by_reason: dict[str, list[str]] = {}
    for fit in damping.fits.values():
        by_reason.setdefault(fit.rejection, []).append(f"{words_of(fit.law)}{_chi2(fit)}")
    shown = ("misfit", "negative", "beaten")
    reasons = {reason: ", ".join(laws) for reason, laws in by_reason.items() if reason in shown}
    if "misfit" in by_reason:
        reasons["selected"] = f"{words_of(best.law)}{_chi2(best)}"
    unfitted = [f"{name}, because {why}" for name, why in damping.unfitted.items()]
    return reasons | ({"unfitted": "; ".join(unfitted)} if unfitted else {})


def _chi2(fit: LawFit) -> str:
    # With as many parameters as windows there is no degree of freedom, and so no reduced chi-square.
    return f" ({number(fit.reduced_chi2)})" if fit.dof > 0 else ""
