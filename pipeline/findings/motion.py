"""Findings on the motion: period, rest position and second modes, and where the model does not describe the motion."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.checks.harmonics import Harmonics
from pipeline.checks.model import Contradiction, ModelCheck
from pipeline.checks.plausibility import Plausibility
from pipeline.checks.sensor import Smoothing
from pipeline.findings.finding import Finding
from pipeline.motion.equation_fit import EquationFit, EquationMisfit
from pipeline.motion.fitted import Fitted
from pipeline.motion.overdamped import Overdamped
from pipeline.motion.waveform import Rest
from pipeline.motion.waveform_fit import FullFit
from pipeline.numerics.quantity import amount, plural
from pipeline.track import Track
from pipeline.windows.cycles import Cycles
from pipeline.windows.demodulate import model_error

__all__ = [
    "fit_findings",
    "harmonics_finding",
    "model_finding",
    "motion_findings",
    "overdamped_finding",
    "plausibility_findings",
    "smoothing_finding",
]

TOLD = 0.002  # minimum share of harmonics in the amplitude for a warning; the uncertainties include smaller ones
SIDEWAYS = 0.01  # share of a second mode in the amplitude above which the finding is a warning and not a note
FEWEST = 4  # minimum number of windows for the test of a damping law


def overdamped_finding(found: Overdamped) -> Finding:
    """Return the finding on a motion that damping ends within a few cycles, or before one cycle is complete.

    Parameters
    ----------
    found : Overdamped
    """
    if found.kind == "strong":
        return Finding(
            "strongly_damped",
            "info",
            f"Strong damping (damping ratio {found.damping_ratio}): the equation of motion was fitted.",
            f"{found.why}. The fit is one solution with linear drag; no damping law was chosen.",
        )
    kind = "critically damped" if found.kind == "critical" else "overdamped"
    return Finding("overdamped", "warning", f"The motion is {kind}: it does not oscillate.", f"{found.why}.")


def fit_findings(full: FullFit | None, solved: EquationFit | EquationMisfit | None) -> Iterator[Finding]:
    """Yield findings on the result of the fits of the whole motion.

    Parameters
    ----------
    full : FullFit or None
        The fit of the waveform.
    solved : EquationFit, EquationMisfit or None
        The fit of the equation of motion.
    """
    if full is not None and not full.converged:
        yield Finding(
            "not_converged",
            "warning",
            "The fit of the whole waveform did not converge; the values of standard accuracy are given.",
            f"Tried: {full.tried}.",
        )
    if isinstance(solved, EquationFit):
        yield Finding(
            "strongly_damped",
            "info",
            "Strong damping: the equation of motion was solved and fitted, not a decaying sinusoid.",
            f"{solved.why}.",
        )
    elif solved is not None:
        yield Finding(
            "not_converged",
            "warning",
            "The damping is strong, but the equation of motion does not fit; an averaged law is given.",
            f"{solved.why}.",
        )


def motion_findings(cycles: Cycles, fitted: Fitted, rest: Rest) -> Iterator[Finding]:
    """Yield findings on the motion from its fit.

    Parameters
    ----------
    cycles : Cycles
    fitted : Fitted
    rest : Rest
    """
    demodulated, phase = fitted.demodulated, fitted.phase
    unit = rest.mean.unit
    if demodulated.t.size < FEWEST:
        yield Finding(
            "short_record",
            "warning",
            f"Only {cycles.count:.1f} periods were analysed, too few to measure the damping.",
            values={"periods": cycles.count},
        )
    if demodulated.lost:
        yield Finding(
            "missing_samples",
            "warning",
            f"{demodulated.lost} of {demodulated.lost + demodulated.t.size} periods have too few usable samples.",
            "They have no amplitude.",
            {"periods": demodulated.lost},
        )
    if phase.backbone is not None:
        start = phase.damping.best.joint["A0"].value
        shift = phase.backbone.value * start**2 / phase.angular_frequency.value
        # In computed data drag itself shifts the frequency, by the square of the decrease of the amplitude in a radian.
        by_drag = (phase.damping.best.rate_at_start() / phase.angular_frequency.value) ** 2
        if abs(shift) > by_drag:
            yield Finding(
                "amplitude_dependent_frequency",
                "warning",
                f"At {amount(start, unit, '.0f')} the frequency is {100.0 * abs(shift):.2g} % "
                f"{'higher' if shift > 0 else 'lower'} than in very small swings; the period is an average.",
                "The frequency changes with the square of the amplitude. The stated period is the average "
                "over the run; its uncertainty does not cover the period at other amplitudes.",
                {"relative_shift": shift, "amplitude_m": start},
            )
    # In computed data, changes of the rest position below the error of the sinusoidal model affect no number.
    errors = model_error(demodulated.amplitude, demodulated.decay, demodulated.angular_frequency)
    if rest.drifts and rest.drift_m > float(np.max(errors)):
        yield _rest_finding(rest, phase.damping.best.damping_rate().u)
    yield from _mode_findings(fitted, unit)


def _rest_finding(rest: Rest, u_rate: float) -> Finding:
    unit = rest.mean.unit
    text, values = "", {"drift_m": rest.drift_m}
    if unit == "m" and rest.mean.value > 0.0:
        share, seconds = rest.drift_m / rest.mean.value, float(np.ptp(rest.t))
        if share >= u_rate * seconds:
            text += (
                f"If the scale of the sensor drifts, as when sensor or air warm up, amplitudes change by {share:.2%} "
                f"and the damping rate is wrong by about {share / seconds:.1g} 1/s."
            )
            values["damping_rate_error"] = share / seconds
    message = f"The rest position drifts by {amount(rest.drift_m, unit)}."
    return Finding("rest_drift", "warning", message, text.strip(), values)


def _mode_findings(fitted: Fitted, unit: str) -> Iterator[Finding]:
    disturbances, main = fitted.disturbances, fitted.phase.angular_frequency.value / (2.0 * math.pi)
    own = [mode for mode in disturbances.sideways.modes if mode.kind == "mode"]
    if not own:
        return
    mode = own[0]
    f, size_m = mode.frequency.value, mode.amplitude.value
    share = size_m / float(np.median(fitted.demodulated.amplitude))
    details = [f"It beats with the oscillation every {1.0 / abs(f - main):.2g} s."]
    if f < main and unit == "m":
        long_m = GRAVITY_M_PER_S2 / (2.0 * math.pi * f) ** 2
        details.append(f"A pendulum {long_m:.2g} m long has this frequency.")
    if len(own) > 1:
        rest = ", ".join(f"{amount(m.amplitude.value, unit)} at {m.frequency.value:.4g} Hz" for m in own[1:])
        details.append(f"Further modes: {rest}.")
    fate = "the fit includes it" if disturbances.modelled else "too small to affect the amplitude"
    yield Finding(
        "sideways_mode",
        "warning" if disturbances.modelled and share > SIDEWAYS else "info",
        f"A second oscillation shows, {amount(size_m, unit)} at {f:.4g} Hz, perhaps sideways; {fate}.",
        " ".join(details),
        {"frequency_hz": f, "amplitude_m": size_m, "beat_s": 1.0 / abs(f - main), "modes": float(len(own))},
    )


def harmonics_finding(found: Harmonics, unit: str) -> Finding | None:
    """Return the finding on periods that are no sinusoids; None if the difference is small.

    Parameters
    ----------
    found : Harmonics
    unit : str
        Unit of the samples.
    """
    if found.share < TOLD:
        return None
    if found.even > 0.9 and found.second > 0.95:
        cause = "even harmonics: a bent distance scale, or a spring that goes slack"
    elif found.even < 0.1:
        cause = "odd harmonics: a scale that levels off, or stops, at both ends"
    else:
        end = {True: "near", False: "far"} if unit == "m" else {True: "lower", False: "upper"}
        cause = f"largest at the {end[found.near_end]} end: an echo, a plateau or a stop there, or a slack spring"
    return Finding(
        "not_sinusoidal",
        "warning",
        f"In every period the motion differs from a sinusoid by up to {amount(found.peak_m, unit)} "
        f"({found.share:.1%} of the amplitude).",
        f"Likely cause, {cause}. The uncertainties of amplitude, rest position and damping were increased by as much.",
        {"peak_m": found.peak_m, "share": found.share},
    )


def smoothing_finding(found: Smoothing, unit: str) -> Finding:
    """Return the finding on a sensor that smooths.

    Parameters
    ----------
    found : Smoothing
    unit : str
        Unit of the samples.
    """
    return Finding(
        "smoothed_sensor",
        "warning",
        f"Neighbouring {plural(unit)} are correlated ({found.correlation:.2f}): the sensor smooths its readings.",
        f"The readings are alike over {found.samples:.2g} samples, as after a running mean or a lag. It makes the "
        f"amplitude too small by up to {found.loss:.1%} and the motion late by {found.late_s:.2g} s; the uncertainties "
        "include that. State it in the scene ([sensor] mean_samples or lag_s) to correct for it.",
        {"correlation": found.correlation, "amplitude_loss": found.loss, "late_s": found.late_s},
    )


def model_finding(check: ModelCheck, unit: str) -> Finding | None:
    """Return the finding on a model that does not describe the whole run; None if it does.

    Parameters
    ----------
    check : ModelCheck
    unit : str
        Unit of the samples.
    """
    if not check.contradictions:
        return None
    details = []
    if Contradiction.RESIDUALS in check.contradictions:
        message = (
            f"Residuals ({amount(check.rms_m, unit)}) exceed the scatter in a period "
            f"({amount(check.noise_m, unit)}); the uncertainties were increased."
        )
    elif Contradiction.HALVES in check.contradictions:
        message = f"The two halves of the run disagree by {check.halves:.2g} standard uncertainties of one model."
    elif Contradiction.COLOUR in check.contradictions:
        message = (
            f"Residuals are correlated ({check.correlation:.2f} at a lag of {check.lag_s:.2g} s): they are not noise."
        )
    else:
        message = (
            f"The phases scatter {math.sqrt(check.phase_chi2):.2g} times as much as expected; the uncertainties were "
            "increased."
        )
    if check.scatter_excess_m:
        details.append(
            f"Amplitudes of single periods scatter by {amount(check.scatter_excess_m, unit)} beyond their noise."
        )
    if Contradiction.PHASE in check.contradictions:
        details.append(f"The reduced chi-square of the phases is {check.phase_chi2:.2g}.")
    if Contradiction.COLOUR in check.contradictions:
        details.append(f"The residuals have a correlation of {check.correlation:.2f} at a lag of {check.lag_s:.3g} s.")
    if Contradiction.HALVES in check.contradictions:
        details.append(f"The halves differ from one model by {check.halves:.2g} standard uncertainties.")
    return Finding(
        "model_misfit",
        "warning",
        message,
        " ".join(details),
        {
            "rms_m": check.rms_m,
            "noise_m": check.noise_m,
            "phase_chi2": check.phase_chi2,
            "halves": check.halves,
            "correlation": check.correlation,
            "lag_s": check.lag_s,
        },
    )


def plausibility_findings(found: Plausibility, track: Track) -> Iterator[Finding]:
    """Yield findings on motions that are impossible for a bob on a spring, or not measurable by a distance sensor.

    Parameters
    ----------
    found : Plausibility
    track : Track
    """
    if found.undersampled:
        yield Finding(
            "undersampled",
            "warning",
            f"There are only {found.samples_per_period:.2g} samples per period: another frequency gives the same "
            "samples.",
            "A faster oscillation would look the same.",
            {"samples_per_period": found.samples_per_period},
        )
    if found.too_fast:
        other = "a velocity read as distance" if track.unit == "m" else f"counts read as {track.unit}"
        yield Finding(
            "implausible_motion",
            "warning",
            f"The motion needs {found.gravities:.2g} times the acceleration of gravity: probably a wrong unit.",
            f"No bob on a hanging spring reaches an amplitude of {found.amplitude:.3g} {track.unit} at "
            f"{found.frequency_hz:.4g} Hz. Likely a wrong unit, mains hum, or {other}.",
            {"gravities": found.gravities, "frequency_hz": found.frequency_hz},
        )
    if found.too_slow:
        yield Finding(
            "implausible_sag",
            "warning",
            f"A period of {1.0 / found.frequency_hz:.4g} s would stretch the spring by {found.sag_m:.3g} m.",
            "Likely times in ms or us were read as seconds, or this is not a bob on a spring.",
            {"period_s": 1.0 / found.frequency_hz, "sag_m": found.sag_m},
        )
    if found.out_of_range:
        yield Finding(
            "implausible_distance",
            "warning",
            f"Distances from {found.low_m:.4g} to {found.high_m:.4g} m are outside the range of a rangefinder.",
            "Likely a wrong unit, a velocity read as a distance, or displacements, whose offset is not a distance. "
            "The uncertainty of the rest position was increased.",
            {"low_m": found.low_m, "high_m": found.high_m},
        )
