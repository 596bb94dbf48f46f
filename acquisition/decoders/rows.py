"""From the numbers of the frames that one read completed to readings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from acquisition.readings import NO_READINGS, Readings

__all__ = ["NAN", "rows"]

NAN = math.nan

_NONE = np.array([-1], np.int64)
_UNKNOWN = np.array([NAN])


def rows(
    host_ns: int,
    *,
    distance_m: Sequence[float] | None = None,
    echo_us: Sequence[float] | None = None,
    temperature_c: Sequence[float] | None = None,
    sequence: Sequence[int] | None = None,
    device_us: Sequence[int] | None = None,
) -> Readings:
    """Return one row a frame, all stamped with the read that completed them.

    Parameters
    ----------
    host_ns : int
        Host clock of the read, ns.
    distance_m, echo_us : sequence of float
        One of the two, as the device measures; NaN means no target, and flags the row ``MISSING``.
    temperature_c, sequence, device_us : sequence, optional
        What the device sends besides.

    Notes
    -----
    It runs once a read, which mostly completes one frame: ``repeat`` of a constant costs a third of ``np.full``.
    """
    measured = np.array(distance_m if echo_us is None else echo_us, np.float64)
    n = measured.size
    if n == 0:
        return NO_READINGS
    unknown = _UNKNOWN.repeat(n)
    return Readings(
        host_ns=np.array([host_ns], np.int64).repeat(n),
        sequence=_NONE.repeat(n) if sequence is None else np.array(sequence, np.int64),
        device_us=_NONE.repeat(n) if device_us is None else np.array(device_us, np.int64),
        echo_us=unknown if echo_us is None else measured,
        distance_m=unknown.copy() if echo_us is not None else measured,
        temperature_c=unknown.copy() if temperature_c is None else np.array(temperature_c, np.float64),
        flags=np.isnan(measured).view(np.uint8),  # Flag.MISSING is bit 0, as True is
    )
