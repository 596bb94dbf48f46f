"""Calibration: convert echo times and stated distances to metres; its numbers are stored with the result."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acquisition.block import F8
from acquisition.errors import CalibrationError

SPEED_OF_SOUND_M_PER_S = 344.0
RANGES = {"scale": (1e-3, 1e3), "offset_m": (-1e4, 1e4), "u_scale": (0.0, 1e3), "u_offset_m": (0.0, 1e4)}
MAD_TO_SIGMA = 1.482602218505602


@dataclass(frozen=True, slots=True)
class Calibration:
    """The conversion of readings to distances.

    An echo time gives :math:`d = s\\,c\\,\\tau/2 + d_0`; a distance stated by the device gives
    :math:`d = s\\,d_r + d_0`. The offset is there because the face of the transducer is not the zero of the scale.
    """

    speed_of_sound_m_per_s: float = SPEED_OF_SOUND_M_PER_S
    scale: float = 1.0
    offset_m: float = 0.0
    u_scale: float = 0.0
    u_offset_m: float = 0.0

    def __post_init__(self) -> None:
        if not 100.0 < self.speed_of_sound_m_per_s < 2000.0:
            raise CalibrationError(
                f"the speed of sound must lie between 100 and 2000 m/s, got {self.speed_of_sound_m_per_s:g}",
                "use 344 for air at room temperature",
            )
        for name, (low, high) in RANGES.items():
            if not low <= getattr(self, name) <= high:
                raise CalibrationError(
                    f"{name} of a calibration must lie in {low:g} to {high:g}, got {getattr(self, name):g}"
                )

    def distance(self, echo_us: ArrayLike, distance_m: ArrayLike) -> F8:
        """Return the distances in m from echo times in us or, if an echo time is NaN, from the stated distance in m."""
        raw = np.where(np.isfinite(echo_us), 0.5e-6 * self.speed_of_sound_m_per_s * np.asarray(echo_us), distance_m)
        return np.asarray(self.scale * raw + self.offset_m)

    def restated(self, point: StillPoint, before: Calibration) -> StillPoint:
        """Convert a rest position measured with the calibration ``before`` to this calibration."""
        ratio = self.scale / before.scale
        rest_m = (point.rest_m - before.offset_m) * ratio + self.offset_m
        return StillPoint(rest_m, point.u_rest_m * ratio, point.noise_m * ratio, point.samples)

    @classmethod
    def from_mapping(cls, numbers: Mapping[str, Any]) -> Calibration:
        """Return the calibration of numbers by name, as logs have them; unknown names raise a CalibrationError."""
        try:
            return cls(**{name: float(value) for name, value in numbers.items()})
        except (TypeError, ValueError) as error:
            raise CalibrationError(
                f"expected numbers of a calibration ({', '.join(cls.__slots__)}), got {dict(numbers)}"
            ) from error


@dataclass(frozen=True, slots=True)
class StillPoint:
    """A measurement of the bob at rest: position, its uncertainty, and the standard deviation of one distance, m."""

    rest_m: float
    u_rest_m: float
    noise_m: float
    samples: int


def from_still(distance: F8) -> StillPoint:
    """Return the rest position and the noise from (n,) distances in m, measured while the bob hangs still.

    The bob moves if the distances scatter by more than five times the noise and by more than 0.5 mm.
    """
    measured = distance[np.isfinite(distance)]
    if measured.size < 10:
        raise CalibrationError(
            f"a rest position needs at least ten distances, got {measured.size} in {distance.size} readings",
            "check that the sensor sees the bob",
        )
    rest_m = float(np.median(measured))
    total = MAD_TO_SIGMA * float(np.median(np.abs(measured - rest_m)))
    # First differences contain the noise, but almost no slow motion.
    steps = MAD_TO_SIGMA * float(np.median(np.abs(np.diff(measured)))) / math.sqrt(2.0)
    if total > max(5.0 * steps, 5e-4):
        raise CalibrationError(
            f"the bob moves: its positions scatter by {total * 1e3:.2g} mm, but the noise is {steps * 1e3:.2g} mm",
            "wait until it hangs still",
        )
    noise = max(total, steps)
    return StillPoint(rest_m, 1.2533 * noise / math.sqrt(measured.size), noise, int(measured.size))


def against_ruler(
    measured: tuple[StillPoint, ...], known_m: tuple[float, ...], u_known_m: float, base: Calibration | None = None
) -> Calibration:
    """Return the calibration that maps rest positions, measured with ``base``, to known distances.

    One distance by the ruler gives the offset. Two or more also give the scale, if their range is at least a tenth of
    the largest distance. A scale that differs from 1 by more than a tenth is refused, for example a wrong unit.
    """
    base = base or Calibration()
    if not measured or len(measured) != len(known_m):
        raise CalibrationError(
            f"expected a measurement for each ruler distance, got {len(measured)} for {len(known_m)}", "measure again"
        )
    x = np.array([point.rest_m for point in measured])
    y = np.array(known_m)
    u = np.hypot(u_known_m, [point.u_rest_m for point in measured])
    if len(measured) == 1 or np.ptp(y) < 0.1 * np.max(np.abs(y)):
        weight = 1.0 / u**2
        shift = float(np.sum(weight * (y - x)) / np.sum(weight))
        u_shift = float(np.sum(weight) ** -0.5)
        return Calibration(base.speed_of_sound_m_per_s, base.scale, base.offset_m + shift, base.u_scale, u_shift)
    (scale, shift), covariance = np.polyfit(x, y, 1, w=1.0 / u, cov="unscaled")
    if abs(scale - 1.0) > 0.1:
        raise CalibrationError(f"expected a scale within a tenth of 1, got {scale:.3g}", "check the unit of the ruler")
    return Calibration(
        base.speed_of_sound_m_per_s,
        base.scale * float(scale),
        float(scale) * base.offset_m + float(shift),
        base.scale * math.sqrt(float(covariance[0, 0])),
        math.sqrt(float(covariance[1, 1])),
    )
