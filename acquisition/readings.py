"""Readings: what a decoder makes of the bytes off the wire, before they have a sensor time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8, U8, Flag

__all__ = ["COLUMNS", "NO_READINGS", "Read", "Reading", "Readings", "carried"]

NAN = math.nan

Read = tuple[int, int, bytes]
"""What was read of a port at a time: channel (the sensor's number within the run), host's stamp in ns, bytes."""


class Reading(NamedTuple):
    """What one frame says.

    A frame that says "no target" has neither an echo nor a distance; a frame that fails its check is no reading but a
    counted fault of the decoder.

    Parameters
    ----------
    host_ns : int, ns
        Host clock of the read that completed the frame.
    sequence : int
        The device's own counter as sent, -1 where it sends none.
    device_us : int, us
        The device's own clock as sent (it may wrap at 2^32), -1 where it sends none.
    echo_us : float, us
        Time of flight there and back, NaN where the device sends a distance instead.
    distance_m : float, m
        As the device states it, NaN where it sends an echo time instead or saw no target.
    temperature_c : float, degC
        NaN where it sends none.
    """

    host_ns: int
    sequence: int = -1
    device_us: int = -1
    echo_us: float = NAN
    distance_m: float = NAN
    temperature_c: float = NAN


COLUMNS = (*Reading._fields, "flags")
"""The columns that readings have."""


def carried(values: F8, known: NDArray[np.bool_], before: float) -> F8:
    """Return values (n,) with the last known one in place of each that is not, and ``before`` in front of the first."""
    if known.all():
        return values
    latest = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.where(latest >= 0, values[latest], before)


class Readings(tuple[Reading, ...]):
    """Consecutive readings of one rangefinder: a tuple of rows, that gives its columns as arrays when asked.

    Notes
    -----
    Live, a read of the port completes one frame. Seven arrays for one row cost more than all the rest of decoding it,
    so there are none before many rows are at hand.
    """

    __slots__ = ()

    @property
    def host_ns(self) -> I8:
        """(n,) int64, ns."""
        return np.array([row.host_ns for row in self], np.int64)

    @property
    def sequence(self) -> I8:
        """(n,) int64, -1 where there is none."""
        return np.array([row.sequence for row in self], np.int64)

    @property
    def device_us(self) -> I8:
        """(n,) int64, us, -1 where there is none."""
        return np.array([row.device_us for row in self], np.int64)

    @property
    def echo_us(self) -> F8:
        """(n,) float64, us, NaN where there is none."""
        return np.array([row.echo_us for row in self], np.float64)

    @property
    def distance_m(self) -> F8:
        """(n,) float64, m, NaN where there is none."""
        return np.array([row.distance_m for row in self], np.float64)

    @property
    def temperature_c(self) -> F8:
        """(n,) float64, degC, NaN where there is none."""
        return np.array([row.temperature_c for row in self], np.float64)

    @property
    def flags(self) -> U8:
        """(n,) uint8: ``Flag.MISSING`` where there is neither echo nor distance."""
        silent = np.isnan(self.echo_us) & np.isnan(self.distance_m)
        return np.where(silent, np.uint8(Flag.MISSING), np.uint8(0))


NO_READINGS = Readings()
"""What a decoder returns where no frame was completed."""
