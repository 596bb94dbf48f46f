"""Read one MotionSensor.vi file as samples, with remarks."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.families.motion_sensor.layout import Layout, find_layout, no_column_line
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.samples import value_traps
from acquisition.recordings.sampling.timing import check_rate
from acquisition.recordings.sampling.velocity import find_tick
from acquisition.recordings.tables.cells import EMPTY, UNREAD, scaled
from acquisition.recordings.tables.channel import Samples, read_samples
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import says_simulated, text_of
from acquisition.recordings.units import LENGTHS

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
    samples: Samples
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
    layout, first, delimiter = find_layout(path, text, channel, unit)
    quantity, power = layout.quantity, LENGTHS[layout.unit]
    read, lines, traps = read_rows(path, text, first, delimiter)
    columns = [each.of_size(lines.rows) for each in read]
    if len(columns) < layout.columns:
        raise FormatError(
            path, f"expected rows of {layout.columns} numbers, got none", "check the file", line=first.number
        )
    # Every cell of a row must be a number, and nothing may follow them.
    forms = [each.decimals for each in columns if each.decimals is not None]
    damaged = np.any([form <= EMPTY for form in forms[: layout.columns]], axis=0)
    damaged |= np.any([form != EMPTY for form in forms[layout.columns :]], axis=0)
    value = replace(columns[1], name=quantity, unit=layout.unit, decimals=np.where(damaged, UNREAD, forms[1]))
    lines = replace(lines, cut=not lines.ended and bool(damaged[-1:].any()))
    table = Table((value,), times=replace(columns[0], unit="s"), lines=lines)
    samples = read_samples(path, table, value, power, rate_hz, difference=quantity == "velocity")
    found = list(traps)
    if layout.assumed:
        message = f"no column line: read as time (s) and {layout.assumed}, in {layout.unit}"
        found.append(Trap("unit_assumed", message))
    found.extend(samples.traps)
    stated = None
    if layout.columns == 3:
        stated, constant = _usual(scaled(columns[2].values, columns[2].decimals, power)[samples.sound])
        if constant and stated is not None:
            size = f"{stated / 10.0**power:g} {layout.unit}"
            message = f"the error column is a constant {size}: a stated value, not the noise"
            found.append(Trap("stated_error_is_not_noise", message))
        elif stated is not None and layout.assumed:
            raise no_column_line(path, "three columns that all vary", first.number)
    quantum = samples.resolution
    if quantity == "distance":
        quantum, seen = value_traps(samples.value, samples.flags, samples.resolution, samples.line)
        found.extend(seen)
    return Column(path, data, layout, samples, quantum, stated, tuple(found))


def _usual(stated: F8) -> tuple[float | None, bool]:
    """Return the median of the stated errors (m), and whether it is constant."""
    if stated.size and bool((stated == stated[0]).all()):
        return float(stated[0]), True  # avoids a copy of a column of millions of rows
    finite = stated[np.isfinite(stated)]
    if not finite.size:
        return None, False
    usual = float(np.partition(finite, finite.size // 2)[finite.size // 2])
    return usual, bool(np.mean(finite == usual) >= _CONSTANT)
