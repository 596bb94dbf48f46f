"""Start a recording automatically when the bob leaves its rest position."""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.block import Block


class Disarmed(Exception):
    """The user stopped waiting for the trigger."""


@dataclass(frozen=True, slots=True)
class Trigger:
    """The run starts when the first sensor's distance leaves its rest position; it keeps the time before that."""

    threshold_m: float
    keep_s: float


class Watch:
    """Detects the moment of the trigger in the first sensor's samples; without a rest position, from the first one."""

    def __init__(self, trigger: Trigger, rest_m: float = math.nan) -> None:
        self._threshold_m = trigger.threshold_m
        self._rest_m = rest_m

    def moment_ns(self, block: Block) -> int | None:
        """Return the host's timestamp of the first sample beyond the threshold; None if there is no such sample."""
        measured = np.isfinite(block.distance)
        if block.host_ns is None or not measured.any():
            return None
        if math.isnan(self._rest_m):
            self._rest_m = float(block.distance[measured][0])
        off = measured & (np.abs(block.distance - self._rest_m) > self._threshold_m)
        return int(block.host_ns[off.argmax()]) if off.any() else None
