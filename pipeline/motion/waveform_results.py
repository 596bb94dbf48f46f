"""What a full fit's state says, in the form of the stages that it refines: phase, rest position and waveform."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.damping.select import Damping
from pipeline.motion.phase import PhaseFit, backbone_unit, wrapped
from pipeline.motion.rest import Rest
from pipeline.motion.waveform import Waveform
from pipeline.motion.waveform_model import Record, State
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import solve_weighted
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, Track

__all__ = ["refined_phase", "refined_rest", "refined_waveform"]


def refined_phase(
    phase: PhaseFit, damping: Damping, demodulated: Demodulated, state: State, covariance: F8
) -> PhaseFit:
    """Return the phase with the full fit's values; the frequency reported is the record's mean here too."""
    before = np.array([phase.t0 - phase.middle])
    gradient = np.array([1.0, before[0], 0.0])[: state.turning.size]
    omega = Estimate(float(state.turning[1]), math.sqrt(covariance[1, 1]), "rad/s")
    backbone = None
    if state.area is not None:
        gradient[2] = float(np.interp(before, *state.area)[0])
        backbone = Estimate(float(state.turning[2]), math.sqrt(covariance[2, 2]), backbone_unit(phase.exponent))
        tau = demodulated.t - phase.middle
        u = np.maximum(np.sqrt(demodulated.covariance[:, 1, 1]), 1e-12)
        line = solve_weighted(np.stack([np.ones(tau.size), tau], axis=1), state.angle(tau), u)
        omega = Estimate(float(line.values[1]), phase.angular_frequency.u, "rad/s")
    at_start = Estimate(
        wrapped(float(state.angle(before)[0])), math.sqrt(float(gradient @ covariance @ gradient)), "rad"
    )
    return replace(
        phase,
        angular_frequency=omega,
        phase=at_start,
        backbone=backbone,
        coefficients=state.turning,
        damping=damping,
    )


def refined_rest(record: Record, rest: Rest, middle: float, linear: F8, covariance: F8) -> Rest:
    """Return the rest position with the full fit's constant or curve."""
    if record.order == 0:
        mean = record.level + float(linear[0])
        return replace(rest, mean=Estimate(mean, math.sqrt(covariance[0, 0]), "m"), curve=np.full(rest.t.size, mean))
    curve = record.level + linear[: record.order + 1] @ record.rest(rest.t - middle)
    return replace(rest, curve=curve, drift_m=float(np.ptp(curve)))


def refined_waveform(record: Record, track: Track, state: State, noise_m: float) -> Waveform:
    """Return the model at every sample; its velocity is that of the oscillation, without drift and extra columns."""
    position = np.empty(record.tau.size)
    velocity = np.empty(record.tau.size)
    for part in record.parts():
        angle = state.angle(record.tau[part])
        amplitude = state.law.amplitude(record.elapsed[part], state.theta)
        rate = np.full(angle.size, state.turning[1])
        if state.area is not None:
            rate += state.turning[2] * np.abs(amplitude) ** state.exponent
        cosine = np.cos(angle)
        position[part] = record.level + state.linear @ record.linear(part) + amplitude * cosine
        velocity[part] = -state.law.rate(amplitude, state.theta) * cosine - amplitude * rate * np.sin(angle)
    residual = track.y - position
    return Waveform(position, velocity, residual, noise_m)
