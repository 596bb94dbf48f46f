"""Findings on the motion: period, rest position and second modes, and where the model does not describe the motion."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.motion.averaged import Fitted, Rest
from pipeline.motion.by_samples import FEW_WINDOWS
from pipeline.motion.overdamped import Overdamped
from pipeline.numerics.levels import NOTICEABLE
from pipeline.numerics.quantity import amount
from pipeline.registry.found import Found
from pipeline.windows.cycles import Cycles
from pipeline.windows.demodulate import model_error


def overdamped_findings(found: Overdamped) -> Iterator[Found]:
    """Yield what damping does that ends a motion within a few cycles, or before one cycle is complete."""
    if found.kind == "strong":
        yield Found("strongly_damped", {"damping_ratio": found.damping_ratio.value, "why": found.why})
    else:
        rates = {name: x.value for name, x in found.estimates.items() if name.startswith("relaxation_rate")}
        yield Found("overdamped", {**rates, "why": found.why})


def fit_findings(fitted: Fitted, misfit: str) -> Iterator[Found]:
    """Yield what the fits of the samples came to; ``misfit`` says why the equation of motion was not fitted."""
    if fitted.method == "equation":
        yield Found("strongly_damped", {"why": fitted.why})
    elif fitted.why:
        yield Found("not_converged", {"tried": fitted.why})
    if misfit:
        yield Found("not_converged", {"why": misfit})


def motion_findings(cycles: Cycles, fitted: Fitted) -> Iterator[Found]:
    """Yield what the fit shows of the motion."""
    demodulated, phase, rest = fitted.demodulated, fitted.phase, fitted.rest
    windows, omega = demodulated.t.size, phase.angular_frequency.value
    if windows < FEW_WINDOWS:
        yield Found("short_record", {"periods": cycles.count, "windows": windows})
    if demodulated.lost:
        lost = {"periods": demodulated.lost, "all_periods": demodulated.lost + windows}
        yield Found("missing_samples", lost, "warning")
    if phase.backbone is not None:
        start, shift = fitted.first_shift(phase.backbone.value)
        # In computed data drag itself shifts the frequency, by the square of the decrease of the amplitude in a radian.
        if abs(shift) > (fitted.damping.best.rate_at_start() / omega) ** 2:
            numbers = {"relative_shift": shift, "amplitude_m": start}
            yield Found("amplitude_dependent_frequency", {**numbers, "higher" if shift > 0 else "lower": abs(shift)})
    # In computed data, changes of the rest position below the error of the sinusoidal model affect no number.
    errors = model_error(demodulated.amplitude, demodulated.decay, demodulated.angular_frequency)
    if rest.drifts and rest.drift_m > float(np.max(errors)):
        yield _rest_drift(rest, fitted.damping.best.damping_rate().u)
    if rest.mean.unit == "m/s^2":
        yield Found("one_axis")
    yield from _modes(fitted, rest.mean.unit)


def _rest_drift(rest: Rest, u_rate: float) -> Found:
    numbers = {"drift_m": rest.drift_m}
    if rest.mean.unit == "m" and rest.mean.value > 0.0:
        share, seconds = rest.drift_m / rest.mean.value, float(np.ptp(rest.t))
        if share >= u_rate * seconds:
            numbers |= {"scale_change": share, "damping_rate_error": share / seconds}
    return Found("rest_drift", numbers)


def _modes(fitted: Fitted, unit: str) -> Iterator[Found]:
    disturbances, main = fitted.disturbances, fitted.phase.angular_frequency.value / (2.0 * math.pi)
    own = [mode for mode in disturbances.sideways.modes if mode.kind == "mode"]
    if not own:
        return
    f, size_m = own[0].frequency.value, own[0].amplitude.value
    large = size_m > NOTICEABLE * float(np.median(fitted.demodulated.amplitude))
    further = ", ".join(f"{amount(m.amplitude.value, unit)} at {m.frequency.value:.4g} Hz" for m in own[1:])
    numbers = {
        "frequency_hz": f,
        "amplitude_m": size_m,
        "beat_s": 1.0 / abs(f - main),
        "modes": len(own),
        "pendulum_metres": GRAVITY_M_PER_S2 / (2.0 * math.pi * f) ** 2 if f < main and unit == "m" else None,
        "further": further or None,
    }
    yield Found("sideways_mode", numbers, "warning" if disturbances.modelled and large else "info")
