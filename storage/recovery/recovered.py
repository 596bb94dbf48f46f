"""What became of a log: the run files that it was made into, and what is said of them."""

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
        What the decoder counted.
    decoding : mapping
        What the chain reports besides: gaps, restarts, the clock's rate error.
    losses : Losses
        What the run lacks.
    stood : bool
        Whether it stood there already and holds the whole of the log.
    """

    sensor: SensorEntry
    path: Path
    samples: int
    faults: Mapping[str, int]
    decoding: Mapping[str, Any]
    losses: Losses
    stood: bool = False

    @property
    def gone(self) -> bool:
        """Whether the sensor was gone at the end."""
        return self.losses.gone_s is not None

    def describe(self, log: Path) -> Iterator[str]:
        """Yield lines for people."""
        faults = "".join(f", {count} {name.replace('_', ' ')}" for name, count in self.faults.items() if count)
        stood = "; it stood there already and holds all of the log" if self.stood else ""
        yield f"{self.path}: {self.samples} samples from {log}{faults}{stood}"
        gaps, left = self.decoding.get("gaps", []), self.decoding.get("gaps_left_out", {})
        if gaps:
            longest = max(left.get("longest_s", 0.0), *(gap["length_s"] for gap in gaps), 0.0)
            lost = sum(gap["lost"] for gap in gaps) + left.get("lost", 0)
            count = len(gaps) + left.get("count", 0)
            yield f"{self.path}: {count} gaps, {lost} readings lost in them, the longest {longest:.3g} s"
        for trap in self.losses.traps():
            yield f"{self.path}: {trap.code}: {trap.message}"
        clock = self.decoding.get("clock", {})
        if clock.get("kind") == "device" and clock.get("rate_error_ppm") is not None:
            rate = f"{clock['rate_error_ppm']:+.1f} +- {clock['u_rate_error_ppm']:.1f} ppm"
            jitter = f"{clock['host_jitter_s'] * 1e3:.2g} ms"
            yield f"{self.path}: sensor clock {rate} against this host's, jitter {jitter}"


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """What became of a log.

    Parameters
    ----------
    log : Path
    runs : tuple of RecoveredRun
        One for each sensor.
    damage : Damage
        Of the log.
    marks, events : int
        Kept in the provenance of every run file.
    log_removed : bool
    parts : int
        Files that the log lay in.
    parts_of : mapping of int to int
        By channel of a sensor that came back as another, the channel of the one before.
    leftovers : tuple of Path
        Files of builds that were killed, found in the folder and removed.
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
        """The run that is to be analysed: the first sensor's, the longest part where others came back in its place."""
        root = self.runs[0].sensor.channel
        return max((run for run in self.runs if self._root(run.sensor.channel) == root), key=lambda run: run.samples)

    def _root(self, channel: int) -> int:
        while channel in self.parts_of:
            channel = self.parts_of[channel]
        return channel

    def describe(self) -> Iterator[str]:
        """Yield lines for people: of each run file, and one about the log."""
        for path in self.leftovers:
            yield f"{path}: left by a build that was killed, removed"
        for run in self.runs:
            yield from run.describe(self.log)
        if self.parts_of:
            yield f"{self.log}: another sensor came back on the port; the longest part is {self.main.path}"
        files = f" in {self.parts} files" if self.parts > 1 else ""
        yield f"{self.log}: {self.damage.describe()}{files}"
