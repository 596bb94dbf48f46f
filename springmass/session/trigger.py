"""When a recording starts by itself: the bob leaves its place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.block import Block

__all__ = ["Disarmed", "Trigger", "Watch"]


class Disarmed(Exception):
    """Somebody would not wait for the trigger any longer."""


@dataclass(frozen=True, slots=True)
class Trigger:
    """When to start recording.

    Parameters
    ----------
    threshold_m : float
        The first sensor's distance must leave its rest position by more than this, m.
    keep_s : float
        Seconds from before that moment that belong to the run.
    """

    threshold_m: float
    keep_s: float = 2.0


class Watch:
    """Looks for the moment in the first sensor's samples.

    Parameters
    ----------
    trigger : Trigger
    rest_m : float
        What distances are measured from, m; NaN: the first one that comes.
    """

    def __init__(self, trigger: Trigger, rest_m: float = math.nan) -> None:
        self._threshold_m = trigger.threshold_m
        self._rest_m = rest_m

    def moment_ns(self, block: Block) -> int | None:
        """Return the host's stamp of the first sample that is off its place, None where there is none."""
        known = np.isfinite(block.distance)
        if block.host_ns is None or not known.any():
            return None
        if math.isnan(self._rest_m):
            self._rest_m = float(block.distance[known][0])
        off = known & (np.abs(block.distance - self._rest_m) > self._threshold_m)
        return int(block.host_ns[off.argmax()]) if off.any() else None
