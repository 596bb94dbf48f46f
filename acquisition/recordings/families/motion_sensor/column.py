"""Read one MotionSensor.vi file as samples, with remarks."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8
from acquisition.recordings.families.motion_sensor.layout import Layout, find_layout, no_column_line
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.samples import value_traps
from acquisition.recordings.sampling.timing import check_rate
from acquisition.recordings.sampling.velocity import find_tick
from acquisition.recordings.tables.channel import ChannelSamples, read_rows, to_samples
from acquisition.recordings.tables.contents import Channel
from acquisition.recordings.tables.text import says_simulated, text_of
from acquisition.recordings.units import LENGTHS

__all__ = ["Column", "read_column"]

_CONSTANT = 0.95


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """The times and the quantity of one file.

    Parameters
    ----------
    path : str
    data : bytes
    layout : Layout
    samples : ChannelSamples
        Values in m or m/s.
    quantum : float
        Step of which all distances are multiples, m: the last printed digit or a multiple of it.
    stated_error_m : float or None
    traps : tuple of Trap
    """

    path: str
    data: bytes
    layout: Layout
    samples: ChannelSamples
    quantum: float
    stated_error_m: float | None
    traps: tuple[Trap, ...]

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return os.path.basename(self.path)

    @property
    def simulated(self) -> bool:
        """Whether the title or the file's name marks simulated data."""
        return says_simulated(f"{self.layout.title} {self.name}")

    def tick(self) -> float | None:
        """Return the step (m or m/s) of which all values are multiples; None if there is no evident step."""
        return find_tick(self.samples.value, self.samples.resolution)


def read_column(path: str, data: bytes, channel: str | None, rate_hz: float | None, unit: str | None) -> Column:
    """Read one file; for arguments and errors see :class:`acquisition.recordings.base.Format`."""
    check_rate(path, rate_hz)
    text = text_of(path, data)
    layout, sheet = find_layout(path, text, channel, unit)
    quantity, is_velocity = layout.quantity, layout.quantity == "velocity"
    power = LENGTHS[layout.unit]
    described = Channel(quantity, layout.unit, sheet, column=1, time=0, time_unit="s", difference=is_velocity)
    samples = to_samples(path, described, read_rows(path, described, power), rate_hz, text.zeros)
    traps = []
    if layout.assumed:
        message = f"no column line: read as time (s) and {layout.assumed}, in {layout.unit}"
        traps.append(Trap("unit_assumed", message))
    traps.extend(samples.traps)
    stated = None
    if samples.behind:
        stated, constant = _usual(samples.behind[0])
        if constant and stated is not None:
            message = (
                f"the error column is a constant {stated / 10.0**power:g} {layout.unit}: a stated value, not the noise"
            )
            traps.append(Trap("stated_error_is_not_noise", message))
        elif stated is not None and layout.assumed:
            raise no_column_line(path, "three columns that all vary", sheet.first_line)
    quantum = samples.resolution
    if not is_velocity:
        quantum, value_traps_found = value_traps(samples.value, samples.flags, samples.resolution, samples.line)
        traps.extend(value_traps_found)
    return Column(path, data, layout, samples, quantum, stated, tuple(traps))


def _usual(stated: F8) -> tuple[float | None, bool]:
    """Return the median of the stated errors (m), and whether it is constant."""
    if stated.size and bool((stated == stated[0]).all()):
        return float(stated[0]), True  # avoids a copy of a column of millions of rows
    finite = stated[np.isfinite(stated)]
    if not finite.size:
        return None, False
    usual = float(np.partition(finite, finite.size // 2)[finite.size // 2])
    return usual, bool(np.mean(finite == usual) >= _CONSTANT)
