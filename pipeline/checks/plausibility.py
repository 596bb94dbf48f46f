"""Plausibility: whether the recorded motion is possible for a bob on a spring, and measurable by the sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.checks.misfit import Misfit
from pipeline.motion.averaged import Phase
from pipeline.numerics.robust import median
from pipeline.samples.condition import Conditioned
from pipeline.track import UNUSABLE
from pipeline.windows.demodulate import Demodulated

# Maximum distance that an ultrasonic rangefinder measures, m: the longest range is 10 m (MaxBotix XL-MaxSonar), and a
# tenth is added.
FARTHEST_M = 11.0
# Maximum acceleration over that of gravity. A bob on a spring that can only pull reaches 1, and little more if the
# spring goes slack.
MOST_GRAVITIES = 1.2
LONGEST_SAG_M = 25.0  # maximum extension of the spring by the bob at rest, m: 25 m correspond to a period of 10 s
# Minimum number of samples per period: below two the frequency is aliased, and below four noise decides.
FEWEST_PER_PERIOD = 4.0


@dataclass(frozen=True, slots=True)
class Plausibility:
    """Features of the motion that are impossible for a bob on a spring, or not measurable by a rangefinder.

    Parameters
    ----------
    undersampled, too_fast, too_slow, out_of_range : bool
        Whether each limit is exceeded.
    samples_per_period, frequency_hz, amplitude, gravities, sag_m : float
        The numbers compared with the limits. The amplitude is in the unit of the track; numbers that have no meaning
        for its quantity are NaN.
    low_m, high_m : float
        The smallest and the largest distance; NaN if distances have no defined zero.
    misfits : tuple of Misfit
    """

    undersampled: bool
    too_fast: bool
    too_slow: bool
    out_of_range: bool
    samples_per_period: float
    frequency_hz: float
    amplitude: float
    gravities: float
    sag_m: float
    low_m: float
    high_m: float
    misfits: tuple[Misfit, ...]


def check_plausibility(conditioned: Conditioned, demodulated: Demodulated, phase: Phase) -> Plausibility:
    """Compare a motion with the limits for a bob on a spring and for a distance sensor.

    Parameters
    ----------
    conditioned, demodulated, phase
        Outputs of the stages with the same names.

    Notes
    -----
    The spring can only pull, so the bob never accelerates downward faster than in free fall: :math:`A\\omega^2 \\le g`,
    and not much more if the spring goes slack. For a recorded acceleration :math:`A\\omega^2` is the amplitude itself.
    The excess enters the uncertainties. If the amplitude is n times as large as gravity allows, its relative
    uncertainty is :math:`1 - 1/n`. If a distance is impossible, the uncertainty of the rest position is as large as the
    rest position. The bob at rest extends its spring by :math:`g/\\omega^2`.
    """
    track = conditioned.track
    used = (demodulated.flags & UNUSABLE) == 0
    t, y = track.t[used], track.y[used]
    omega = phase.angular_frequency.value
    f = omega / (2.0 * math.pi)
    amplitude = float(np.max(np.abs(demodulated.amplitude)))
    per_period = 1.0 / (median(np.diff(t)) * f) if t.size > 1 else math.nan
    per_value = {"m": omega**2, "m/s": omega, "m/s^2": 1.0}.get(track.unit, math.nan)
    gravities = amplitude * per_value / GRAVITY_M_PER_S2
    sag_m = GRAVITY_M_PER_S2 / omega**2 if math.isfinite(gravities) else math.nan
    too_fast = gravities > MOST_GRAVITIES
    misfits = []
    if too_fast:
        misfits.append(Misfit(name="implausible_motion", amplitude_m=amplitude * (1.0 - 1.0 / gravities)))
    out_of_range, low_m, high_m = False, math.nan, math.nan
    # If distances start from zero at the first sample, as after integration of a velocity, their zero has no meaning.
    if track.unit == "m" and y.size and track.y[0] != 0.0:
        low_m, high_m = float(np.min(y)), float(np.max(y))
        mean = abs(float(np.mean(demodulated.offset)))
        if out_of_range := low_m <= 0.0 or high_m > FARTHEST_M or amplitude > mean:
            misfits.append(Misfit(name="implausible_distance", offset_m=max(amplitude, mean)))
    return Plausibility(
        per_period < FEWEST_PER_PERIOD,
        too_fast,
        sag_m > LONGEST_SAG_M,
        out_of_range,
        per_period,
        f,
        amplitude,
        gravities,
        sag_m,
        low_m,
        high_m,
        tuple(misfits),
    )
