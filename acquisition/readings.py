"""Readings: the contents of the frames that a decoder finds in the bytes of a port, before timing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from acquisition.block import B1, F8, I8, U8, Flag

NAN = math.nan

Read = tuple[int, int, bytes]
"""One read of a port, as a tuple of channel (number of the sensor within the run), host time in ns, and bytes."""


class Reading(NamedTuple):
    """The content of one frame.

    A frame that reports "no target" has neither an echo time nor a distance. A frame that fails its check gives no
    reading; the decoder counts it as a fault.

    Parameters
    ----------
    host_ns : int, ns
        Host time of the read that completed the frame.
    sequence : int
        Counter value that the device sent; -1 if it sends none.
    device_us : int, us
        Clock time that the device sent (it may wrap at 2^32); -1 if it sends none.
    echo_us : float, us
        Round-trip time of flight; NaN if the device sends a distance instead or saw no target.
    distance_m : float, m
        Distance that the device sent; NaN if it sends an echo time instead or saw no target.
    temperature_c : float, degC
        Temperature that the device sent; NaN if it sends none.
    """

    host_ns: int
    sequence: int = -1
    device_us: int = -1
    echo_us: float = NAN
    distance_m: float = NAN
    temperature_c: float = NAN


class Readings(tuple[Reading, ...]):
    """Consecutive readings of one rangefinder: a tuple of rows, with the columns of the samples as arrays on demand.

    During a recording, a read usually completes one frame. Arrays for one row would take longer than decoding it.
    """

    __slots__ = ()

    @property
    def host_ns(self) -> I8:
        """Host times in ns, (n,) int64."""
        return np.array([row.host_ns for row in self], np.int64)

    @property
    def echo_us(self) -> F8:
        """Echo times in us, (n,) float64; NaN for readings without one."""
        return np.array([row.echo_us for row in self], np.float64)

    @property
    def distance_m(self) -> F8:
        """Distances in m, (n,) float64; NaN for readings without one."""
        return np.array([row.distance_m for row in self], np.float64)

    @property
    def flags(self) -> U8:
        """Flags, (n,) uint8: ``Flag.MISSING`` for readings with neither an echo time nor a distance, else 0."""
        silent = np.isnan(self.echo_us) & np.isnan(self.distance_m)
        return np.where(silent, np.uint8(Flag.MISSING), np.uint8(0))


NO_READINGS = Readings()


def carried(values: F8, known: B1, before: float) -> F8:
    """Return the (n,) values with unknown ones replaced by the last known value before them, initially ``before``."""
    if known.all():
        return values
    latest = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.where(latest >= 0, values[latest], before)
