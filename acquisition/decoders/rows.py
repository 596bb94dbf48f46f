"""From the numbers of the frames that one read completed to readings."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat

from acquisition.readings import NAN, NO_READINGS, Reading, Readings

__all__ = ["NAN", "rows"]

_NONE = repeat(-1)
_UNKNOWN = repeat(NAN)


def rows(
    host_ns: int,
    *,
    distance_m: Sequence[float] | None = None,
    echo_us: Sequence[float] | None = None,
    temperature_c: Sequence[float] | None = None,
    sequence: Sequence[int] | None = None,
    device_us: Sequence[int] | None = None,
) -> Readings:
    """Return one reading a frame, all stamped with the read that completed them.

    Parameters
    ----------
    host_ns : int
        Host clock of the read, ns.
    distance_m, echo_us : sequence of float
        One of the two, as the device measures; NaN means no target.
    temperature_c, sequence, device_us : sequence, optional
        What the device sends besides.
    """
    if not (distance_m if echo_us is None else echo_us):
        return NO_READINGS
    columns = (
        repeat(host_ns),
        _NONE if sequence is None else sequence,
        _NONE if device_us is None else device_us,
        _UNKNOWN if echo_us is None else echo_us,
        _UNKNOWN if distance_m is None else distance_m,
        _UNKNOWN if temperature_c is None else temperature_c,
    )
    return Readings(map(Reading, *columns))
