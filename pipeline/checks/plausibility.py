"""Plausibility: whether a bob on a spring, seen by a sensor of distance or acceleration, can do what is recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.checks.misfit import Misfit
from pipeline.motion.phase import PhaseFit
from pipeline.numerics.robust import median
from pipeline.samples.condition import Conditioned
from pipeline.track import UNUSABLE
from pipeline.windows.demodulate import Demodulated

__all__ = ["Params", "Plausibility", "check_plausibility"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`check_plausibility`.

    Parameters
    ----------
    farthest_m : float
        That an ultrasonic rangefinder reaches: 10 m of the largest (MaxBotix XL-MaxSonar), and a tenth more.
    most_gravities : float
        Acceleration over that of gravity: a bob on a spring that only pulls reaches 1, and little more while the
        spring is slack.
    longest_sag_m : float
        By which a bob stretches its spring: 25 m belong to a period of 10 s.
    fewest_per_period : float
        Samples: below two the frequency is folded, and below four noise decides.
    """

    farthest_m: float = 11.0
    most_gravities: float = 1.2
    longest_sag_m: float = 25.0
    fewest_per_period: float = 4.0


@dataclass(frozen=True, slots=True)
class Plausibility:
    """What no bob on a spring does, or no rangefinder sees.

    Parameters
    ----------
    undersampled, too_fast, too_slow, out_of_range : bool
        Whether each limit is exceeded.
    samples_per_period, frequency_hz, amplitude, gravities, sag_m : float
        The amplitude in the unit of the track; NaN where a number has no meaning for it.
    low_m, high_m : float
        The least and the largest distance.
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


def check_plausibility(
    conditioned: Conditioned, demodulated: Demodulated, phase: PhaseFit, params: Params | None = None
) -> Plausibility:
    """Return what no bob on a spring does, or no distance sensor sees.

    Parameters
    ----------
    conditioned, demodulated, phase
        Outputs of the stages of those names.
    params : Params, optional

    Notes
    -----
    A bob hangs from a spring that pulls only, so it never falls faster than freely: :math:`A\\omega^2 \\le g`, and
    not much more while the spring goes slack; of an acceleration that is the amplitude itself. What goes beyond enters
    the uncertainties: of an amplitude n times as large as gravity lets it be, the share :math:`1 - 1/n`; of a distance
    that cannot be, all. The bob stretches its spring by :math:`g/\\omega^2`.
    """
    params = params or Params()
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
    too_fast = gravities > params.most_gravities
    misfits = []
    if too_fast:
        misfits.append(Misfit(name="implausible_motion", amplitude_m=amplitude * (1.0 - 1.0 / gravities)))
    out_of_range, low_m, high_m = False, math.nan, math.nan
    # Where distances count from the first sample, as from a velocity, their zero has no meaning.
    if track.unit == "m" and y.size and track.y[0] != 0.0:
        low_m, high_m = float(np.min(y)), float(np.max(y))
        mean = abs(float(np.mean(demodulated.offset)))
        if out_of_range := low_m <= 0.0 or high_m > params.farthest_m or amplitude > mean:
            misfits.append(Misfit(name="implausible_distance", offset_m=max(amplitude, mean)))
    return Plausibility(
        per_period < params.fewest_per_period,
        too_fast,
        sag_m > params.longest_sag_m,
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
