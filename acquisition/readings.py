"""Readings: the frames that a decoder finds in the bytes of a port, before they get a sensor time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8, U8, Flag

__all__ = ["COLUMNS", "NO_READINGS", "Read", "Reading", "Readings", "carried"]

NAN = math.nan

Read = tuple[int, int, bytes]
"""One read of a port: channel (the sensor's number within the run), host time in ns, bytes."""


class Reading(NamedTuple):
    """The content of one frame.

    A frame for "no target" has neither an echo nor a distance. A frame that fails its check gives no reading; the
    decoder counts it as a fault.

    Parameters
    ----------
    host_ns : int, ns
        Host time of the read that completed the frame.
    sequence : int
        The device's counter as sent; -1 if it sends none.
    device_us : int, us
        The device's clock as sent (it may wrap at 2^32); -1 if it sends none.
    echo_us : float, us
        Time of flight there and back; NaN if the device sends a distance instead.
    distance_m : float, m
        Distance as sent; NaN if the device sends an echo time instead or saw no target.
    temperature_c : float, degC
        NaN if it sends none.
    """

    host_ns: int
    sequence: int = -1
    device_us: int = -1
    echo_us: float = NAN
    distance_m: float = NAN
    temperature_c: float = NAN


COLUMNS = (*Reading._fields, "flags")
"""The columns of readings."""


def carried(values: F8, known: NDArray[np.bool_], before: float) -> F8:
    """Return values (n,) with each unknown one replaced by the last known one, or by ``before`` if there is none."""
    if known.all():
        return values
    latest = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.where(latest >= 0, values[latest], before)


class Readings(tuple[Reading, ...]):
    """Consecutive readings of one rangefinder: a tuple of rows with properties for its columns as arrays.

    Notes
    -----
    During a recording a read of the port usually completes one frame. Seven arrays for one row would cost more than
    decoding it, so the arrays are made only on demand.
    """

    __slots__ = ()

    @property
    def host_ns(self) -> I8:
        """(n,) int64, ns."""
        return np.array([row.host_ns for row in self], np.int64)

    @property
    def sequence(self) -> I8:
        """(n,) int64; -1 if there is none."""
        return np.array([row.sequence for row in self], np.int64)

    @property
    def device_us(self) -> I8:
        """(n,) int64, us; -1 if there is none."""
        return np.array([row.device_us for row in self], np.int64)

    @property
    def echo_us(self) -> F8:
        """(n,) float64, us; NaN if there is none."""
        return np.array([row.echo_us for row in self], np.float64)

    @property
    def distance_m(self) -> F8:
        """(n,) float64, m; NaN if there is none."""
        return np.array([row.distance_m for row in self], np.float64)

    @property
    def temperature_c(self) -> F8:
        """(n,) float64, degC; NaN if there is none."""
        return np.array([row.temperature_c for row in self], np.float64)

    @property
    def flags(self) -> U8:
        """(n,) uint8: ``Flag.MISSING`` for readings without echo and distance."""
        silent = np.isnan(self.echo_us) & np.isnan(self.distance_m)
        return np.where(silent, np.uint8(Flag.MISSING), np.uint8(0))


NO_READINGS = Readings()
"""What a decoder returns if no frame was completed."""
