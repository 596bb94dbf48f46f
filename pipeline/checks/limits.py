"""Limits: whether the recorded motion is possible for a bob on a spring, and measurable by a distance sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.checks.residual import Misfit, Outcome
from pipeline.motion.fitted import Oscillation
from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.numerics.robust import median
from pipeline.samples.condition import Samples
from pipeline.windows.cycles import aliased


class Limit(NamedTuple):
    """Range of a number of the motion, the numbers that its finding shows, and what it adds to the uncertainties."""

    code: str
    number: str
    shown: tuple[str, ...]
    least: float = -math.inf
    most: float = math.inf
    misfit: Callable[[Mapping[str, float]], Misfit] | None = None
    of_spring: bool = True  # whether it holds only for a bob on a spring


def _too_fast(numbers: Mapping[str, float]) -> Misfit:
    return Misfit("implausible_motion", {"amplitude": numbers["amplitude_m"] * (1.0 - 1.0 / numbers["gravities"])})


def _no_distance(numbers: Mapping[str, float]) -> Misfit:
    return Misfit("implausible_distance", {"offset": max(numbers["amplitude_m"], numbers["rest_m"])})


# Below two samples per period the frequency is aliased by the sampling theorem, and below four, which is chosen, noise
# decides; uneven times have no aliases.
ENOUGH = 4.0
LIMITS = (
    Limit("undersampled", "samples_per_period", ("samples_per_period",), least=ENOUGH, of_spring=False),
    # A bob on a spring that can only pull reaches 1, and little more if the spring goes slack.
    Limit("implausible_motion", "gravities", ("gravities", "amplitude_m", "frequency_hz"), most=1.2, misfit=_too_fast),
    # Extension of the spring by the bob at rest: 25 m correspond to a period of 10 s.
    Limit("implausible_sag", "sag_metres", ("period_s", "sag_metres"), most=25.0),
    # The longest range of an ultrasonic rangefinder is 10 m (MaxBotix XL-MaxSonar), and a tenth is added.
    Limit("implausible_distance", "farthest_m", ("low_m", "high_m"), most=11.0, misfit=_no_distance),
    Limit("implausible_distance", "nearest_m", ("low_m", "high_m"), least=math.ulp(0.0), misfit=_no_distance),
    Limit("implausible_distance", "share_of_distance", ("low_m", "high_m"), most=1.0, misfit=_no_distance),
)


def beyond_limits(samples: Samples, fitted: Oscillation, *, spring: bool) -> Iterator[Outcome]:
    """Yield every limit that the motion exceeds; without a spring only that of its samples per period.

    The spring can only pull, so the bob never accelerates downward faster than in free fall: :math:`A\\omega^2 \\le g`,
    and not much more if the spring goes slack. For a recorded acceleration :math:`A\\omega^2` is the amplitude itself.
    The excess enters the uncertainties. If the amplitude is n times as large as gravity allows, its relative
    uncertainty is :math:`1 - 1/n`. If a distance is impossible, the uncertainty of the rest position is as large as the
    rest position. The bob at rest extends its spring by :math:`g/\\omega^2`.
    """
    numbers = _numbers(samples, fitted)
    reported = set()
    for limit in (each for each in LIMITS if spring or not each.of_spring):
        if limit.code in reported or not (numbers[limit.number] < limit.least or numbers[limit.number] > limit.most):
            continue
        reported.add(limit.code)
        misfit = None if limit.misfit is None else limit.misfit(numbers)
        yield Outcome(limit.code, {name: numbers[name] for name in limit.shown}, misfit)


def _numbers(samples: Samples, fitted: Oscillation) -> dict[str, float]:
    """Return the numbers by name, NaN where they have no meaning for the record's quantity."""
    track, windows = samples.track, fitted.windows
    used = windows.used
    t, y = track.t[used], track.y[used]
    omega, amplitude = fitted.phase.angular_frequency.value, float(np.max(np.abs(windows.amplitude)))
    f, rest = omega / (2.0 * math.pi), abs(float(np.mean(windows.offset)))
    per_value = {"m": omega**2, "m/s": omega, "m/s^2": 1.0}.get(track.unit, math.nan)
    per_period = 1.0 / (median(np.diff(t)) * f) if t.size > 1 else math.nan
    numbers = {
        "samples_per_period": math.nan if per_period < ENOUGH and not aliased(t) else per_period,
        "frequency_hz": f,
        "period_s": 1.0 / f,
        "amplitude_m": amplitude,
        "rest_m": rest,
        "gravities": amplitude * per_value / GRAVITY_M_PER_S2,
        "sag_metres": GRAVITY_M_PER_S2 / omega**2 if math.isfinite(per_value) else math.nan,
        **dict.fromkeys(("low_m", "high_m", "farthest_m", "nearest_m", "share_of_distance"), math.nan),
    }
    # If distances start from zero at the first sample, as after integration of a velocity, their zero has no meaning.
    if track.unit == "m" and y.size and track.y[0] != 0.0:
        low, high = float(np.min(y)), float(np.max(y))
        numbers |= {"low_m": low, "high_m": high, "farthest_m": max(high, -low)}
        # Positions counted from rest have both signs; no sensor of distances gives many negative ones.
        if float(np.mean(y < 0.0)) < NEGLIGIBLE:
            numbers |= {"nearest_m": low, "share_of_distance": amplitude / rest if rest else math.inf}
    return numbers
