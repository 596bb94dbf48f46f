"""Limits: whether the recorded motion is possible for a bob on a spring, and measurable by a distance sensor."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.bench.plausible import LONGEST_RANGE_M
from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.checks.residual import Misfit, Outcome
from pipeline.motion.fitted import Oscillation
from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.numerics.robust import median
from pipeline.samples.condition import Samples
from pipeline.windows.cycles import aliased

# Below two samples per period the frequency is aliased by the sampling theorem, and below four, which is chosen, noise
# decides; uneven times have no aliases.
ENOUGH = 4.0


def beyond_limits(samples: Samples, fitted: Oscillation, *, spring: bool) -> Iterator[Outcome]:
    """Yield every limit that the motion exceeds; without a spring only that of its samples per period.

    The spring can only pull, so the bob never accelerates downward faster than in free fall: :math:`A\\omega^2 \\le g`,
    and not much more if the spring goes slack. For a recorded acceleration :math:`A\\omega^2` is the amplitude itself.
    The excess enters the uncertainties. If the amplitude is n times as large as gravity allows, its relative
    uncertainty is :math:`1 - 1/n`. If a distance is impossible, the uncertainty of the rest position is as large as the
    rest position. The bob at rest extends its spring by :math:`g/\\omega^2`, 10 m at a period of 6 s.
    """
    track, windows = samples.track, fitted.windows
    t, y = track.t[windows.used], track.y[windows.used]
    omega, amplitude = fitted.phase.angular_frequency.value, float(np.max(np.abs(windows.amplitude)))
    period_s = 2.0 * math.pi / omega
    per_period = period_s / median(np.diff(t)) if t.size > 1 else math.inf
    if per_period < ENOUGH and aliased(t):
        yield Outcome("undersampled", {"samples_per_period": per_period})
    if not spring:
        return
    if (per_value := {"m": omega**2, "m/s": omega, "m/s^2": 1.0}.get(track.unit)) is not None:
        # A bob on a spring that can only pull reaches 1, and little more if the spring goes slack.
        if (gravities := amplitude * per_value / GRAVITY_M_PER_S2) > 1.2:
            numbers = {"gravities": gravities, "amplitude_m": amplitude, "frequency_hz": 1.0 / period_s}
            misfit = Misfit("implausible_motion", {"amplitude": amplitude * (1.0 - 1.0 / gravities)})
            yield Outcome("implausible_motion", numbers, misfit)
        if (sag_metres := GRAVITY_M_PER_S2 / omega**2) > LONGEST_RANGE_M:
            yield Outcome("implausible_sag", {"period_s": period_s, "sag_metres": sag_metres})
    # If distances start from zero at the first sample, as after integration of a velocity, their zero has no meaning.
    if track.unit == "m" and y.size and track.y[0] != 0.0:
        low, high, rest = float(np.min(y)), float(np.max(y)), abs(float(np.mean(windows.offset)))
        # Positions counted from rest have both signs; no sensor of distances gives many negative ones.
        below = float(np.mean(y < 0.0)) < NEGLIGIBLE and (low <= 0.0 or amplitude > rest)
        if below or max(high, -low) > 1.1 * LONGEST_RANGE_M:
            misfit = Misfit("implausible_distance", {"offset": max(amplitude, rest)})
            yield Outcome("implausible_distance", {"low_m": low, "high_m": high}, misfit)
