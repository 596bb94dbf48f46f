"""What the page shows: samples, marks and notes as far as the log has taken them, kept once for all who look."""

from __future__ import annotations

import json
import math
import secrets
import struct
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from acquisition.block import Block
from acquisition.source import ClockKind
from pipeline.track import F8, U8

__all__ = ["VERSION", "Series", "View", "json_of"]

VERSION = 1
"""Of the messages."""
MOST_PER_MESSAGE = 50_000
_HEAD, _F8 = struct.Struct("<4I"), np.dtype("<f8")
SAMPLES = 1
"""First number of a binary message: what follows are samples."""


class Series:
    """One sensor's samples; room grows by doubling, so that a sample costs the same at any length."""

    def __init__(self) -> None:
        self._t, self._y, self._flags = np.empty(1024), np.empty(1024), np.empty(1024, np.uint8)
        self._count = 0
        self._missing = self._looked_at = 0
        self._moment_ns: float | None = None

    def __len__(self) -> int:
        return self._count

    def push(self, block: Block) -> None:
        """Take samples."""
        stop = self._count + len(block)
        if stop > self._t.size:
            room = max(stop, 2 * self._t.size) - self._count
            self._t, self._y = (np.concatenate([c[: self._count], np.empty(room)]) for c in (self._t, self._y))
            self._flags = np.concatenate([self._flags[: self._count], np.empty(room, np.uint8)])
        new = slice(self._count, stop)
        self._t[new], self._y[new], self._flags[new] = block.t, block.distance, block.flags
        self._count = stop
        if self._moment_ns is None and block.host_ns is not None and len(block):
            self._moment_ns = float(block.host_ns[0]) - 1e9 * float(block.t[0])

    def missing(self) -> int:
        """Return how many samples measured nothing."""
        self._missing += int(np.count_nonzero(np.isnan(self._y[self._looked_at : self._count])))
        self._looked_at = self._count
        return self._missing

    def columns(self) -> tuple[F8, F8, U8]:
        """Return times in s, distances in m and flags, (n,) each, as they are now."""
        return self._t[: self._count], self._y[: self._count], self._flags[: self._count]

    def time_of(self, host_ns: int) -> float:
        """Return the record's time of a moment by the host's clock, s; NaN before the first sample."""
        return float("nan") if self._moment_ns is None else (host_ns - self._moment_ns) * 1e-9

    def message(self, sensor: int, first: int) -> bytes:
        """Return samples from a number on as a binary message, at most 50,000 of them.

        Four little-endian unsigned integers of 32 bits (1, sensor, first, count), then ``count`` times in s and
        ``count`` values as 64-bit floats; a missing sample is NaN.
        """
        stop = min(self._count, first + MOST_PER_MESSAGE)
        t, y = (column[first:stop].astype(_F8, copy=False).tobytes() for column in (self._t, self._y))
        return _HEAD.pack(SAMPLES, sensor, first, stop - first) + t + y


@dataclass(eq=False)
class View:
    """A run as the page has it.

    Parameters
    ----------
    source : {"LIVE", "REPLAY"}
    name, title : str
    rate_hz : float
        Nominal.
    sensors : list of str
    quantity, unit : str
        Of the values.
    clock : {"nominal", "device", "host"}
        Where the times come from.
    simulated : bool
        Simulated data never pass for measured ones.
    calibration : str
        How distances were calibrated, in words; empty where nobody says.
    series : list of Series
        One a sensor.
    session : str
        Another number for every start: a page that comes back to another run begins anew.
    marks : list of (float, str)
        Time in s and text.
    notes : list of str
        What befell the recording.
    ended : bool
    error : str
        Why nothing more is shown; empty while all is well.
    """

    source: Literal["LIVE", "REPLAY"]
    name: str
    title: str
    rate_hz: float
    sensors: list[str]
    quantity: str = "length"
    unit: str = "m"
    clock: ClockKind = "device"
    simulated: bool = False
    calibration: str = ""
    series: list[Series] = field(default_factory=list)
    session: str = field(default_factory=lambda: secrets.token_hex(8))
    marks: list[tuple[float, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    ended: bool = False
    error: str = ""

    def __post_init__(self) -> None:
        self.series = self.series or [Series() for _ in self.sensors]

    def hello(self, *, controls: bool) -> dict[str, Any]:
        """Return the first message to whoever looks."""
        names = ("session", "source", "name", "title", "rate_hz", "sensors", "quantity", "unit", "simulated", "clock")
        told = {name: getattr(self, name) for name in names}
        more = {"calibration": self.calibration, "controls": controls}
        return {"type": "hello", "version": VERSION, **told, **more}

    def state(self) -> dict[str, Any]:
        """Return where the run stands, as the log has it."""
        return {
            "type": "state",
            "samples": [len(series) for series in self.series],
            "missing": sum(series.missing() for series in self.series),
            "marks": [[t, text] for t, text in self.marks],
            "notes": self.notes[-20:],
            "ended": self.ended,
            "error": self.error,
        }


def json_of(content: Any) -> str:
    """Return JSON that browsers read: what is no number is null."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:  # rarely: to look at every number before takes as long again
        return json.dumps(_finite(content), allow_nan=False)


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
