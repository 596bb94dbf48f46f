"""Where the page's samples come from: a log that grows, or a run that is all there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from acquisition.block import Block
from acquisition.live.calibration import Calibration
from springmass.page.view import View
from springmass.runs.loading import Loaded
from storage.errors import StorageError
from storage.wire_log.following import LogFollower
from storage.wire_log.log_header import event_content
from storage.wire_log.records import Kind, Record
from storage.wire_log.wire_samples import LogDecoder, chains_of

__all__ = ["LogFeed", "view_of"]

MOST_NOTES = 1000
UNTOLD = frozenset({"calibration", "ended"})
"""Events that are no trouble."""


class LogFeed:
    """Fills a view from a log that is being written.

    Parameters
    ----------
    path : Path

    Raises
    ------
    NotALog
        If it is none.
    """

    def __init__(self, path: Path) -> None:
        self._log = LogFollower(path)
        header = self._log.header
        self._decoder = LogDecoder(header.sensors, chains_of(header.sensors), self._note)
        chains = self._decoder.chains
        self.view = View(
            "LIVE",
            path.with_suffix(".h5").name,
            header.title,
            chains[0].timebase.rate_hz,
            [f"{sensor.channel}: {sensor.family}" for sensor in header.sensors],
            simulated=header.kind == "simulated",
            calibration=_calibration(header.sensors[0].calibration),
        )
        self.scene = header.scene
        self._late: list[Record] = []

    def poll(self) -> None:
        """Take what has come since the last call; what keeps it from reading on stands in the view."""
        if self.view.error or self.view.ended:
            return
        try:
            for number, block in self._decoder.blocks(self._log.records(), growing=True):
                self.view.series[number].push(block)
        except (StorageError, OSError) as error:
            self.view.error = str(error)
        # A mark may come before the first sample that its time is told by.
        for record in self._late:
            self._mark(record)
        self._late.clear()
        self.view.ended = self._log.ended

    def close(self) -> None:
        """Close the log."""
        self._log.close()

    def _note(self, record: Record) -> None:
        if record.kind is Kind.MARK:
            self._late.append(record)
        elif record.kind is Kind.EVENT and len(self.view.notes) < MOST_NOTES:
            content = event_content(record.payload)
            if content["kind"] not in UNTOLD:
                facts = ", ".join(
                    f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
                    for name, value in content["facts"].items()
                )
                self.view.notes.append(f"{content['kind']}: {facts}" if facts else str(content["kind"]))

    def _mark(self, record: Record) -> None:
        t = self.view.series[0].time_of(record.mono_ns)
        self.view.marks.append((0.0 if math.isnan(t) else t, record.text()))


def _calibration(numbers: Mapping[str, Any] | None) -> str:
    """Return in words how the first sensor's distances are calibrated."""
    found = Calibration.from_mapping(numbers or {})
    if not (found.u_scale or found.u_offset_m):
        return "not calibrated"
    offset = f"offset {found.offset_m * 1e3:.1f} mm"
    return f"by ruler: {offset}, scale {found.scale:.4f}" if found.u_scale else f"by ruler: {offset}"


def view_of(loaded: Loaded) -> View:
    """Return a view of a run that was recorded before."""
    block: Block = loaded.samples
    view = View(
        "REPLAY",
        loaded.path.name,
        loaded.title,
        loaded.info.rate_hz,
        [loaded.channel or loaded.format],
        block.quantity,
        block.unit,
        loaded.info.clock,
        simulated=loaded.info.kind == "simulated",
    )
    view.series[0].push(block)
    view.marks += [(float(mark["t_s"]), str(mark["text"])) for mark in loaded.provenance.get("marks", ())]
    view.notes += [trap.message for trap in loaded.traps]
    view.ended = True
    return view
