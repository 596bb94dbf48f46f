"""Sensor filter: the effect of a sensor's running mean and lag on an oscillation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate


@dataclass(frozen=True, slots=True)
class SensorFilter:
    """The filters that a scene states, connected in series.

    A mean of the last n samples, h apart, reduces the oscillation :math:`\\cos\\omega t` to the amplitude
    :math:`\\sin(n\\omega h/2)/(n\\sin(\\omega h/2))` and delays its phase by :math:`(n-1)\\omega h/2`. A lag
    :math:`1/(1 + i\\omega\\tau)` reduces it to :math:`(1 + \\omega^2\\tau^2)^{-1/2}` and delays it by
    :math:`\\arctan\\omega\\tau`. Damping that is weak over the filter's length does not change these results.
    """

    mean_samples: Estimate
    lag_s: Estimate
    step_s: float

    @classmethod
    def of(cls, scene: Scene, rate_hz: float) -> SensorFilter | None:
        """Return the filter that a scene states for a sensor with this sampling rate, 1/s; None if it states none.

        >>> scene = Scene.from_mapping({"sensor": {"lag_s": 0.1}})
        >>> round(SensorFilter.of(scene, 100.0).gain(10.0), 4)
        0.7071
        """
        mean, lag = scene.sensor_mean_samples, scene.sensor_lag_s
        if mean is None and lag is None:
            return None
        return cls(mean or Estimate(1.0, 0.0, ""), lag or Estimate(0.0, 0.0, "s"), 1.0 / rate_hz)

    def gain(self, omega: float, mean: float | None = None, lag_s: float | None = None) -> float:
        """Return the filtered amplitude of a unit oscillation; other sizes than those stated serve to propagate u."""
        n, tau = self.mean_samples.value if mean is None else mean, self.lag_s.value if lag_s is None else lag_s
        turn = 0.5 * omega * self.step_s
        averaged = 1.0 if n == 1.0 else math.sin(n * turn) / (n * math.sin(turn))
        return averaged / math.hypot(1.0, omega * tau)

    def delay(self, omega: float, mean: float | None = None, lag_s: float | None = None) -> float:
        """Return the phase delay of the oscillation, rad; the parameters are those of :meth:`gain`."""
        n, tau = self.mean_samples.value if mean is None else mean, self.lag_s.value if lag_s is None else lag_s
        return (n - 1.0) * 0.5 * omega * self.step_s + math.atan(omega * tau)
