"""Readings: what a decoder makes of the bytes off the wire, before they have a sensor time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8, I8, U8

__all__ = ["NO_READINGS", "Readings", "join"]


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Consecutive readings of one rangefinder, one row a frame.

    A frame that says "no target" is a row with NaN and ``Flag.MISSING``; a frame that fails its check is no row but a
    counted fault of the decoder.

    Parameters
    ----------
    host_ns : (n,) int64, ns
        Host clock of the read that completed the frame.
    sequence : (n,) int64
        The device's own counter as sent, -1 where it sends none.
    device_us : (n,) int64, us
        The device's own clock as sent (it may wrap at 2^32), -1 where it sends none.
    echo_us : (n,) float64, us
        Time of flight there and back, NaN where the device sends a distance instead.
    distance_m : (n,) float64, m
        As the device states it, NaN where it sends an echo time instead or saw no target.
    temperature_c : (n,) float64, degC
        NaN where it sends none.
    flags : (n,) uint8
        Sums of ``acquisition.block.Flag`` bits.
    """

    host_ns: I8
    sequence: I8
    device_us: I8
    echo_us: F8
    distance_m: F8
    temperature_c: F8
    flags: U8

    def __len__(self) -> int:
        return int(self.host_ns.size)


def _empty() -> Readings:
    whole, real = np.empty(0, np.int64), np.empty(0)
    return Readings(whole, whole, whole, real, real, real, np.empty(0, np.uint8))


NO_READINGS = _empty()
"""What a decoder returns where no frame was completed."""


def join(parts: Iterable[Readings]) -> Readings:
    """Return readings one after the other as one."""
    rows = [part for part in parts if len(part)]
    if not rows:
        return NO_READINGS
    return Readings(*(np.concatenate([getattr(row, name) for row in rows]) for name in Readings.__slots__))
