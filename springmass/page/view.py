"""The contents of the page: samples, marks and notes of the log, stored once for all viewers."""

from __future__ import annotations

import json
import math
import secrets
import struct
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from acquisition.block import Block
from acquisition.recordings.recording import Trap
from acquisition.source import ClockKind, SourceInfo
from pipeline.track import F8, U8, Track
from springmass.runs.tracks import to_track

__all__ = ["VERSION", "Series", "View", "json_of"]

VERSION = 1
"""Version of the messages."""
MOST_PER_MESSAGE = 50_000
_HEAD, _F8 = struct.Struct("<4I"), np.dtype("<f8")
FIRST_SAMPLES = 1000
"""Number of samples whose time stamps determine t = 0; later ones would add the difference of the clocks' rates."""
SAMPLES = 1
"""First number of a binary message that contains samples."""


class Series:
    """One sensor's samples; the storage grows by doubling, so that the cost per sample stays constant."""

    def __init__(self) -> None:
        self._t, self._y, self._flags = np.empty(1024), np.empty(1024), np.empty(1024, np.uint8)
        self._host_ns = np.empty(1024, np.int64)
        self._count = 0
        self._missing = self._looked_at = 0
        self._moment_ns: float | None = None

    def __len__(self) -> int:
        return self._count

    def push(self, block: Block) -> None:
        """Append samples."""
        stop = self._count + len(block)
        if stop > self._t.size:
            room = max(stop, 2 * self._t.size) - self._count
            self._t, self._y = (np.concatenate([c[: self._count], np.empty(room)]) for c in (self._t, self._y))
            self._flags = np.concatenate([self._flags[: self._count], np.empty(room, np.uint8)])
            self._host_ns = np.concatenate([self._host_ns[: self._count], np.empty(room, np.int64)])
        new = slice(self._count, stop)
        self._t[new], self._y[new], self._flags[new] = block.t, block.distance, block.flags
        self._host_ns[new] = -1 if block.host_ns is None else block.host_ns
        early = min(len(block), FIRST_SAMPLES - self._count)
        if block.host_ns is not None and early > 0:
            # A time stamp may be late, but never early.
            moment_ns = float((block.host_ns[:early] - 1e9 * block.t[:early]).min())
            self._moment_ns = moment_ns if self._moment_ns is None else min(self._moment_ns, moment_ns)
        self._count = stop

    def missing(self) -> int:
        """Return the number of missing samples."""
        self._missing += int(np.count_nonzero(np.isnan(self._y[self._looked_at : self._count])))
        self._looked_at = self._count
        return self._missing

    def columns(self) -> tuple[F8, F8, U8]:
        """Return times in s, distances in m and flags, (n,) each, as they are now."""
        return self._t[: self._count], self._y[: self._count], self._flags[: self._count]

    def block(self) -> Block:
        """Return all samples as they are now."""
        t, y, flags = self.columns()
        return Block(0, t, y, flags, self._host_ns[: self._count])

    def time_of(self, host_ns: int) -> float:
        """Convert a time of the host's clock in ns to a time of the record in s; NaN before the first sample."""
        return float("nan") if self._moment_ns is None else (host_ns - self._moment_ns) * 1e-9

    def message(self, sensor: int, first: int) -> bytes:
        """Return at most 50,000 samples, starting at index ``first``, as a binary message.

        Four little-endian unsigned integers of 32 bits (1, sensor, first, count), then ``count`` times in s and
        ``count`` values as 64-bit floats; a missing sample is NaN.
        """
        stop = min(self._count, first + MOST_PER_MESSAGE)
        t, y = (column[first:stop].astype(_F8, copy=False).tobytes() for column in (self._t, self._y))
        return _HEAD.pack(SAMPLES, sensor, first, stop - first) + t + y


@dataclass(eq=False)
class View:
    """A run as the page shows it.

    Parameters
    ----------
    source : {"LIVE", "REPLAY"}
    name, title : str
    rate_hz : float
        Nominal sampling rate.
    sensors : list of str
    quantity, unit : str
        Quantity and unit of the values.
    clock : {"nominal", "device", "host"}
        Source of the times.
    simulated : bool
        Whether the data are simulated; such data are always marked as simulated.
    calibration : str
        How distances were calibrated, in words; empty if unknown.
    series : list of Series
        One series per sensor.
    session : str
        Identifier that differs between starts, so that a page that reconnects to another run begins anew.
    marks : list of (float, str)
        Time in s and text.
    notes : list of str
        Events of the recording, in words.
    ended : bool
    error : str
        Why no further samples are shown; empty without an error.
    recorded : Track or None
        For a saved run: the first sensor's samples in the form for an analysis.
    info : SourceInfo or None
        For a run that is being recorded: properties of its first sensor.
    provenance : mapping
        The provenance from the log so far, in the form of a run file: sensor, events and, after the end, how the log
        was decoded.
    traps : tuple of Trap
        Traps that the reader found in the file.
    zero : mapping
        ``rest_m`` and ``noise_m`` as measured before the run; empty if they were not measured.
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
    recorded: Track | None = None
    info: SourceInfo | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    traps: tuple[Trap, ...] = ()
    zero: dict[str, float] = field(default_factory=dict)

    def track(self) -> Track:
        """Return the first sensor's samples so far, in the form for an analysis."""
        if self.recorded is not None:
            return self.recorded
        info = self.info or SourceInfo("live", self.name, self.rate_hz, clock=self.clock)
        return to_track(self.series[0].block(), info, recorded_format="wire", provenance=self.provenance)

    def __post_init__(self) -> None:
        self.series = self.series or [Series() for _ in self.sensors]

    def hello(self, *, controls: bool) -> dict[str, Any]:
        """Return the first message to a viewer."""
        names = ("session", "source", "name", "title", "rate_hz", "sensors", "quantity", "unit", "simulated", "clock")
        fields = {name: getattr(self, name) for name in names}
        more = {"calibration": self.calibration, "controls": controls}
        return {"type": "hello", "version": VERSION, **fields, **more}

    def state(self) -> dict[str, Any]:
        """Return the state of the run according to its log."""
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
    """Return JSON that browsers can read, with null for numbers that are not finite."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:  # rare; checking every number in advance would double the time
        return json.dumps(_finite(content), allow_nan=False)


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
