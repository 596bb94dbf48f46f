"""Describe the result of a recovery: the run files made from a log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from storage.recovery.losses import Losses
from storage.wire_log.records import SensorEntry
from storage.wire_log.scanning import Damage

__all__ = ["RecoverReport", "RecoveredRun"]


@dataclass(frozen=True, slots=True)
class RecoveredRun:
    """One sensor's run file.

    Parameters
    ----------
    sensor : SensorEntry
    path : Path
        The file, verified against the log.
    samples : int
    faults : mapping of str to int
        Number of faults of each kind, as counted by the decoder.
    decoding : mapping
        The chain's report: gaps, restarts, the clock's rate error.
    losses : Losses
        The losses of the run.
    existed : bool
        Whether the file already existed and contained the whole log.
    """

    sensor: SensorEntry
    path: Path
    samples: int
    faults: Mapping[str, int]
    decoding: Mapping[str, Any]
    losses: Losses
    existed: bool = False

    @property
    def gone(self) -> bool:
        """Whether the sensor was disconnected or silent at the end."""
        return self.losses.gone_s is not None

    def describe(self, log: Path) -> Iterator[str]:
        """Yield lines for the user."""
        faults = "".join(f", {count} {name.replace('_', ' ')}" for name, count in self.faults.items() if count)
        existed = "; it existed already and holds the whole log" if self.existed else ""
        yield f"{self.path}: {self.samples} samples from {log}{faults}{existed}"
        gaps, left_out = self.decoding.get("gaps", []), self.decoding.get("gaps_left_out", {})
        if gaps:
            longest = max(left_out.get("longest_s", 0.0), *(gap["length_s"] for gap in gaps), 0.0)
            lost = sum(gap["lost"] for gap in gaps) + left_out.get("lost", 0)
            count = len(gaps) + left_out.get("count", 0)
            gaps_are = "1 gap" if count == 1 else f"{count} gaps"
            readings_are = "1 lost reading" if lost == 1 else f"{lost} lost readings"
            yield f"{self.path}: {gaps_are} with {readings_are}, the longest {longest:.3g} s"
        for trap in self.losses.traps():
            yield f"{self.path}: {trap.code}: {trap.message}"
        clock = self.decoding.get("clock", {})
        if clock.get("kind") == "device" and clock.get("rate_error_ppm") is not None:
            rate = f"{clock['rate_error_ppm']:+.1f} +- {clock['u_rate_error_ppm']:.1f} ppm"
            jitter = f"{clock['host_jitter_s'] * 1e3:.2g} ms"
            yield f"{self.path}: sensor clock {rate} against this computer's, jitter {jitter}"


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """The result of the recovery of one log.

    Parameters
    ----------
    log : Path
    runs : tuple of RecoveredRun
        One for each sensor.
    damage : Damage
        Damage of the log.
    marks, events : int
        Numbers of marks and events in the log.
    log_removed : bool
    parts : int
        Number of files of the log.
    parts_of : mapping of int to int
        For each channel of a sensor that replaced another, the channel of the replaced sensor.
    leftovers : tuple of Path
        Temporary files of killed builds, which were removed from the folder.
    """

    log: Path
    runs: tuple[RecoveredRun, ...]
    damage: Damage
    marks: int
    events: int
    log_removed: bool
    parts: int = 1
    leftovers: tuple[Path, ...] = ()
    parts_of: Mapping[int, int] = field(default_factory=dict)

    @property
    def main(self) -> RecoveredRun:
        """The run to analyse: that of the first sensor, or the longest part if other sensors replaced it."""
        root = self.runs[0].sensor.channel
        return max((run for run in self.runs if self._root(run.sensor.channel) == root), key=lambda run: run.samples)

    def _root(self, channel: int) -> int:
        while channel in self.parts_of:
            channel = self.parts_of[channel]
        return channel

    def describe(self) -> Iterator[str]:
        """Yield lines for the user: about removed temporary files, about each run file, and one about the log."""
        for path in self.leftovers:
            yield f"{path}: removed, left by a killed build"
        for run in self.runs:
            yield from run.describe(self.log)
        if self.parts_of:
            yield f"{self.log}: another sensor came back on the port; the longest part is in {self.main.path}"
        files = f" in {self.parts} files" if self.parts > 1 else ""
        yield f"{self.log}: {self.damage.describe()}{files}"
