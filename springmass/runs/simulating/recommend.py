"""Recommend the error of a simulation: the given tolerance, or else an error that scene or sensor cannot resolve."""

from __future__ import annotations

from pipeline.dynamics.band import spread
from pipeline.errors import DynamicsError
from springmass.runs.simulating.prepared import Prepared
from springmass.runs.simulating.simulation import DEFAULT_TOLERANCE, default_tolerance

__all__ = ["wanted_error"]

UNSEEN = 0.1  # error as a fraction of a sample's noise that no record can reveal


def wanted_error(ready: Prepared, seconds: float, tolerance: float | None) -> tuple[float, str]:
    """Return the largest acceptable error relative to the amplitude, and the source of this value.

    Parameters
    ----------
    ready : Prepared
    seconds : float
        Duration of the run, s.
    tolerance : float or None
        Tolerance that the user gave; it is returned unchanged.
    """
    if tolerance is not None:
        return tolerance, "the tolerance asked for"
    start = ready.problem.amplitude_m()
    if ready.values():
        try:
            band = spread(ready.solved, seconds, ready.measured)
        except DynamicsError:
            pass  # the values are too uncertain or the run is too long for a band, so the noise decides
        else:
            found = default_tolerance(band)
            return (
                found,
                f"a hundredth of the band, {band.relative_u:.1g} of the amplitude, at least 1e-6, at most 1e-3",
            )
    sigma = ready.stated.sensor_sigma_m
    if sigma is not None and start > 0.0:
        return UNSEEN * sigma.value / start, f"a tenth of the sensor's noise, {sigma.value:g} m"
    return DEFAULT_TOLERANCE, "the default: the scene states neither uncertainties nor the sensor's noise"
