"""What the page shows of a recording: samples, marks and notes, stored once for all viewers."""

from __future__ import annotations

import json
import secrets
import struct
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from acquisition.block import Block, ClockKind, SourceInfo
from acquisition.buffer import GrowingColumns
from springmass.loading.loaded import Loaded
from springmass.loading.options import AnalysisOptions
from springmass.result.run_json import plain
from springmass.runs.rolling import COLUMNS, columns_of, live_run
from springmass.runs.run import Run
from storage.wire_log.wire_samples import Origin

PROTOCOL_VERSION = 2  # of the messages
MOST_PER_MESSAGE = 50_000
SHOWN_NOTES = 20  # the latest
_HEAD = struct.Struct("<4I")


class SensorSamples(GrowingColumns):
    """The samples of one sensor, the number without a distance, and the host time of t = 0."""

    def __init__(self) -> None:
        super().__init__(*COLUMNS)
        self.missing = 0
        self.origin = Origin()

    def push(self, block: Block) -> None:
        """Append samples."""
        self.append(*columns_of(block))
        self.missing += int(np.count_nonzero(np.isnan(block.distance)))
        self.origin.push(block)

    def message(self, sensor: int, first: int) -> bytes:
        """Return at most 50,000 samples, starting at index ``first``, as a binary message.

        Four little-endian unsigned integers of 32 bits (1, sensor, first, count), then ``count`` times in s and
        ``count`` values as 64-bit floats; a missing sample is NaN.
        """
        t, y = self[first : first + MOST_PER_MESSAGE][:2]
        return _HEAD.pack(1, sensor, first, t.size) + t.astype("<f8").tobytes() + y.astype("<f8").tobytes()


@dataclass(eq=False)
class View:
    """A run as the page shows it, with one series per sensor.

    ``session`` differs between runs, so that a page that reconnects to another run begins anew. ``zero`` has the rest
    position and noise measured before the run. ``loaded`` is a saved run; ``info``, ``scene`` and ``provenance`` are
    those of a run that is being recorded.
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
    series: list[SensorSamples] = field(default_factory=list)
    session: str = field(default_factory=lambda: secrets.token_hex(8))
    marks: list[tuple[float, str]] = field(default_factory=list)
    notes: deque[str] = field(default_factory=lambda: deque(maxlen=SHOWN_NOTES))
    ended: bool = False
    error: str = ""
    loaded: Loaded | None = None
    info: SourceInfo | None = None
    scene: Mapping[str, Any] | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    zero: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.series = self.series or [SensorSamples() for _ in self.sensors]

    def live_run(self, samples: Block, how: AnalysisOptions) -> Run:
        """Return samples of the first sensor of a run that is being recorded, to be analysed."""
        info = self.info or SourceInfo("live", self.name, self.rate_hz, clock=self.clock)
        return live_run(samples, info, self.scene, self.provenance, how)

    def hello(self, *, controls: bool) -> dict[str, Any]:
        """Return the first message to a viewer."""
        names = ("session", "source", "name", "title", "rate_hz", "sensors", "quantity", "unit", "simulated", "clock")
        fields = {name: getattr(self, name) for name in (*names, "calibration")}
        return {"type": "hello", "version": PROTOCOL_VERSION, **fields, "controls": controls}

    def state(self) -> dict[str, Any]:
        """Return the state of the run according to its log."""
        return {
            "type": "state",
            "samples": [len(series) for series in self.series],
            "missing": sum(series.missing for series in self.series),
            "marks": [[t, text] for t, text in self.marks],
            "notes": list(self.notes),
            "ended": self.ended,
            "error": self.error,
        }


def json_of(content: Any) -> str:
    """Return JSON that browsers can read, with null for numbers that are not finite."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:  # rare; checking every number in advance would double the time
        return json.dumps(plain(content))
