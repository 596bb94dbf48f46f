"""Sensor filter: the effect of a sensor's running mean, running median or lag on an oscillation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate

__all__ = ["SensorFilter"]

PLACES = 1024  # number of phases of a cosine at which a median is taken


@dataclass(frozen=True, slots=True)
class SensorFilter:
    """The filters that a scene states, connected in series.

    Parameters
    ----------
    mean_samples, median_samples : Estimate or None
        Numbers of latest samples whose mean, or median, the sensor returns.
    lag_s : Estimate or None
        Time constant of a first-order lag, s.
    step_s : float
        Time from sample to sample, s.

    Notes
    -----
    A mean of the last n samples, h apart, reduces the oscillation :math:`\\cos\\omega t` to the amplitude
    :math:`\\sin(n\\omega h/2)/(n\\sin(\\omega h/2))` and delays its phase by :math:`(n-1)\\omega h/2`. A lag
    :math:`1/(1 + i\\omega\\tau)` reduces it to :math:`(1 + \\omega^2\\tau^2)^{-1/2}` and delays it by
    :math:`\\arctan\\omega\\tau`. A median leaves slopes unchanged, delayed by :math:`(n-1)\\omega h/2`, and cuts the
    crests. Its first harmonic is calculated from cosines with all phases between two samples. For many samples it loses
    :math:`(2/\\pi)(c - \\sin c\\cos c)` with :math:`c = (n-1)\\omega h/4`. Damping that is weak over the filter's
    length does not change these results.
    """

    mean_samples: Estimate | None
    median_samples: Estimate | None
    lag_s: Estimate | None
    step_s: float

    @classmethod
    def of(cls, scene: Scene, rate_hz: float) -> SensorFilter | None:
        """Return the filter that a scene states for a sensor with this sampling rate, 1/s; None if it states none.

        Examples
        --------
        >>> scene = Scene.from_mapping({"sensor": {"lag_s": 0.1}})
        >>> round(SensorFilter.of(scene, 100.0).gain(10.0), 4)
        0.7071
        """
        stages = scene.sensor_mean_samples, scene.sensor_median_samples, scene.sensor_lag_s
        return None if all(stage is None for stage in stages) else cls(*stages, 1.0 / rate_hz)

    @property
    def sizes(self) -> tuple[Estimate, Estimate, Estimate]:
        """The three sizes; an absent filter has the size at which it has no effect."""
        one, nothing = Estimate(1.0, 0.0, ""), Estimate(0.0, 0.0, "s")
        return self.mean_samples or one, self.median_samples or one, self.lag_s or nothing

    def gain(
        self, omega: float, mean: float | None = None, median: float | None = None, lag_s: float | None = None
    ) -> float:
        """Return the filtered amplitude of a unit oscillation with the angular frequency omega, rad/s.

        Parameters
        ----------
        omega : float
        mean, median, lag_s : float, optional
            Sizes that replace those stated; they serve to propagate uncertainties.
        """
        n, m, tau = self._sizes(mean, median, lag_s)
        turn = 0.5 * omega * self.step_s
        averaged = 1.0 if n == 1.0 else math.sin(n * turn) / (n * math.sin(turn))
        return averaged * self._passed(omega, m) / math.hypot(1.0, omega * tau)

    def delay(
        self, omega: float, mean: float | None = None, median: float | None = None, lag_s: float | None = None
    ) -> float:
        """Return the phase delay of the oscillation, rad; the parameters are those of :meth:`gain`."""
        n, m, tau = self._sizes(mean, median, lag_s)
        return (n + m - 2.0) * 0.5 * omega * self.step_s + math.atan(omega * tau)

    def shown(self, omega: float) -> float:
        """Return the relative loss of amplitude that the filter's correlation in the noise suggests.

        In the noise, a median looks like a mean of as many samples.
        """
        n, m, tau = (size.value for size in self.sizes)
        turn = 0.5 * omega * self.step_s
        means = [1.0 if k == 1.0 else abs(math.sin(k * turn) / (k * math.sin(turn))) for k in (n, m)]
        return math.hypot(1.0, omega * tau) / max(means[0] * means[1], 0.01) - 1.0

    def u_cut(self, omega: float) -> float:
        """Return the uncertainty of a median's loss: cut crests may have been left out as plateaus."""
        return (1.0 - self._passed(omega, self.sizes[1].value)) / math.sqrt(3.0)

    def _passed(self, omega: float, samples: float) -> float:
        """Return the first harmonic of a cosine after a running median, with the filter's delay removed."""
        count = round(samples)
        if count < 3:  # the median of two is their mean
            return math.cos(0.5 * (count - 1) * omega * self.step_s)
        angle = np.linspace(0.0, 2.0 * math.pi, PLACES, endpoint=False)
        window = (np.arange(count) - 0.5 * (count - 1)) * omega * self.step_s
        return float(2.0 * np.mean(np.median(np.cos(angle[:, None] + window), axis=1) * np.cos(angle)))

    def _sizes(self, mean: float | None, median: float | None, lag_s: float | None) -> tuple[float, float, float]:
        given = (mean, median, lag_s)
        n, m, tau = (own.value if x is None else x for own, x in zip(self.sizes, given, strict=True))
        return n, m, tau
