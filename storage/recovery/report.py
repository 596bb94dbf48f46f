"""Describe the result of a recovery: the run files made from a log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from storage.recovery.losses import Losses
from storage.wire_log.records import SensorEntry
from storage.wire_log.scanning import Damage


@dataclass(frozen=True, slots=True)
class RecoveredRun:
    """The run file of one part of a sensor's data, verified against the log.

    ``decoding`` is the chain's report: faults, gaps, restarts, the clock's rate error. ``existed`` states whether the
    file already existed and contained the whole log.
    """

    sensor: SensorEntry
    part: int
    path: Path
    samples: int
    decoding: Mapping[str, Any]
    losses: Losses
    existed: bool = False

    def describe(self, log: Path) -> Iterator[str]:
        """Yield lines for the user."""
        counts = self.decoding["faults"].items()
        faults = "".join(f", {count} {name.replace('_', ' ')}" for name, count in counts if count)
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

    ``runs`` has the parts of every sensor in order. ``short_parts`` has the duration of the parts that are too short
    for a run file of their own, s.
    """

    log: Path
    runs: tuple[RecoveredRun, ...]
    damage: Damage
    log_removed: bool
    short_parts: tuple[float, ...] = ()

    @property
    def main(self) -> RecoveredRun:
        """The run to analyse: the longest part of the first sensor."""
        return max(self.parts_of(self.runs[0].sensor.channel), key=lambda run: run.samples)

    def parts_of(self, channel: int) -> list[RecoveredRun]:
        """Return the runs of one sensor."""
        return [run for run in self.runs if run.sensor.channel == channel]

    def describe(self) -> Iterator[str]:
        """Yield lines for the user: about each run file and the parts of each sensor, and one about the log."""
        for run in self.runs:
            yield from run.describe(self.log)
        for channel in dict.fromkeys(run.sensor.channel for run in self.runs):
            if len(parts := self.parts_of(channel)) > 1:
                longest = max(parts, key=lambda run: run.samples)
                yield f"{self.log}: the sensor came back, so it has {len(parts)} parts; the longest is {longest.path}"
        if count := len(self.short_parts):
            are = "1 short part" if count == 1 else f"{count} short parts"
            yield f"{self.log}: {are} ({sum(self.short_parts):.1f} s), after the sensor came back, without a run file"
        yield f"{self.log}: {self.damage.describe()}"
