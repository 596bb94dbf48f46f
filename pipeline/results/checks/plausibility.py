"""Plausibility: whether a bob on a spring, seen by a sensor of distance or acceleration, can do what is recorded."""

from __future__ import annotations

import math

import numpy as np

from pipeline.motion.phase import PhaseFit
from pipeline.numerics.robust import median
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.rows import MAINS_HZ
from pipeline.results.checks.finding import GRAVITY_M_PER_S2, Checked, Finding, Misfit
from pipeline.track import UNUSABLE

__all__ = ["judge_plausibility"]

FARTHEST_M = 11.0  # that ultrasonic sensors of the bench reach
MOST_GRAVITIES = 1.2
LONGEST_SAG_M = 25.0  # that a spring of the bench is stretched by its bob: a period of 10 s
FEWEST = 4.0  # samples a period


def judge_plausibility(conditioned: Conditioned, demodulated: Demodulated, phase: PhaseFit) -> Checked:
    """Return what no bob on a spring does, or no distance sensor sees, and how little of the numbers that leaves.

    Parameters
    ----------
    conditioned : Conditioned
        The record as it came.
    demodulated, phase
        Outputs of the stages of those names.

    Notes
    -----
    A bob hangs from a spring that pulls only, so it never falls faster than freely: :math:`A\\omega^2 \\le g`, and
    not much more while the spring goes slack; of an acceleration that is the amplitude itself. What goes beyond enters
    the uncertainties: of an amplitude n times as large as gravity lets it be, the share :math:`1 - 1/n`; of a distance
    that cannot be, all; of the mains, all. The bob stretches its spring by :math:`g/\\omega^2`.
    """
    track = conditioned.track
    used = (demodulated.flags & UNUSABLE) == 0
    t, y = track.t[used], track.y[used]
    omega = phase.angular_frequency.value
    f = omega / (2.0 * math.pi)
    amplitude = float(np.max(np.abs(demodulated.amplitude)))
    rate_hz = 1.0 / median(np.diff(t)) if t.size > 1 else math.nan
    found, misfits = [], []
    if rate_hz < FEWEST * f:
        found.append(
            Finding(
                "undersampled",
                "warning",
                f"only {rate_hz / f:.2g} samples fall on a period: the bob may move several times as fast as the "
                "record shows, and a wave of the same samples has another period; record at ten samples a period and "
                "more",
            )
        )
    per_value = {"m": omega**2, "m/s": omega, "m/s^2": 1.0}.get(track.unit)
    if per_value is None:
        return Checked(tuple(found))
    gravities = amplitude * per_value / GRAVITY_M_PER_S2
    if gravities > MOST_GRAVITIES:
        misfits.append(Misfit(name="implausible_motion", amplitude_m=amplitude * (1.0 - 1.0 / gravities)))
        mains = _mains(f, rate_hz)
        if mains is not None:
            misfits.append(Misfit(name="mains_hum", amplitude_m=amplitude, clock=1.0))
            found.append(
                Finding(
                    "mains_hum",
                    "warning",
                    f"what oscillates at {f:.4g} Hz is the mains, {mains:.0f} Hz{_alias(f, mains)}, and no bob: none "
                    "of the numbers is of a motion, and their uncertainties are as large as they; see to the sensor's "
                    "supply and earth, and record a bob that moves",
                )
            )
        found.append(
            Finding(
                "implausible_motion",
                "warning",
                f"an amplitude of {amplitude:.3g} {track.unit} at {f:.4g} Hz needs {gravities:.2g} times the "
                "acceleration of gravity, which no bob hanging from a spring reaches: likely a wrong unit, hum, or "
                f"{'a velocity read as distance' if track.unit == 'm' else f'counts read as {track.unit}'}; check "
                "unit and column",
            )
        )
    sag_m = GRAVITY_M_PER_S2 / omega**2
    if sag_m > LONGEST_SAG_M:
        found.append(
            Finding(
                "implausible_sag",
                "warning",
                f"a bob that swings once in {1.0 / f:.4g} s stretches its spring by {sag_m:.3g} m, as long as a "
                "pendulum of that period is: likely times in ms or us read as seconds, or no bob on a spring; check "
                "the unit of the times (--time-unit)",
            )
        )
    # Where distances are counted from the first sample, as from a velocity, their zero says nothing.
    if track.unit == "m" and y.size and track.y[0] != 0.0:
        low, high = float(np.min(y)), float(np.max(y))
        mean = float(np.mean(demodulated.offset))
        if low <= 0.0 or high > FARTHEST_M or amplitude > abs(mean):
            misfits.append(Misfit(name="implausible_distance", offset_m=max(amplitude, abs(mean))))
            found.append(
                Finding(
                    "implausible_distance",
                    "warning",
                    f"distances from {low:.4g} to {high:.4g} m: no sensor of the bench measures that (0.02 to "
                    f"{FARTHEST_M:g} m). Likely a wrong unit, a velocity read as distance, or displacements, whose "
                    "offset is no distance; check unit and column",
                )
            )
    return Checked(tuple(found), tuple(misfits))


def _mains(f: float, rate_hz: float) -> float | None:
    """The mains frequency that a line at f is, itself or folded by the sampling."""
    for mains in MAINS_HZ:
        folded = abs(mains - rate_hz * round(mains / rate_hz))
        if min(abs(f - folded), abs(f - mains)) < 0.02 * f:
            return mains
    return None


def _alias(f: float, mains: float) -> str:
    return "" if abs(f - mains) < 0.02 * f else " folded by the sampling"
