"""Count the losses of a run, and describe the run files that a recovery made.

All losses follow from the samples and the events of the log, so the end of a recording, ``recover`` and an analysis
report the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block, Flag
from acquisition.events import Continued, Dropped, Event, Lost, Reopened, Shared
from acquisition.recordings.recording import FormatIssue
from storage.wire_log.records import SensorEntry
from storage.wire_log.scanning import Damage

SILENCE_S, SILENT_PERIODS = 1.5, 5.0
"""A sensor counts as gone if it was silent at the end for longer than this time, s, and this many sample periods."""
NO_TARGET_S = 1.0
"""Minimum duration of a reported loss of the target, s; shorter ones appear only as missing samples."""


@dataclass(frozen=True, slots=True)
class Losses:
    """The losses of one run.

    ``gone_s`` is the time from the last reading to the end, s; None if readings came until the end, or if a later part
    follows. ``why`` is the reason for the loss of the port, empty if the port was present but silent. ``away`` has the
    duration of each interruption of a network port within the run, s. ``another`` says why the run is of another
    sensor than the part before it. ``no_target_s`` and ``longest_no_target_s`` are the total and the longest time
    during which the sensor answered without a distance, s. ``shared`` says that another program read the port too.
    """

    seconds: float
    gone_s: float | None = None
    why: str = ""
    away: tuple[float, ...] = ()
    another: str = ""
    no_target_s: float = 0.0
    longest_no_target_s: float = 0.0
    dropped_reads: int = 0
    dropped_bytes: int = 0
    shared: bool = False

    def traps(self) -> Iterator[FormatIssue]:
        """Yield a trap for each kind of loss."""
        if self.gone_s is not None:
            why = f" ({self.why})" if self.why else ", though its port was there"
            yield FormatIssue(
                "sensor_lost",
                f"The sensor sent no reading in the last {self.gone_s:.3g} s of the {self.seconds:.4g} s "
                f"recorded{why}.",
            )
        if self.away:
            often = "once" if len(self.away) == 1 else f"{len(self.away)} times"
            yield FormatIssue(
                "sensor_away",
                f"The sensor's port was lost {often} and came back, after at most {max(self.away):.3g} s; "
                f"{sum(self.away):.3g} s in total were not recorded.",
                len(self.away),
            )
        if self.shared:
            yield FormatIssue("port_shared", "Another program read the sensor's port too, so bytes are missing.")
        if self.another:
            yield FormatIssue("sensor_replaced", f"Another sensor was plugged in before this part ({self.another}).")
        if self.longest_no_target_s >= NO_TARGET_S:
            yield FormatIssue(
                "no_target",
                f"The sensor heard no echo for {self.no_target_s:.3g} s in total, at most "
                f"{self.longest_no_target_s:.3g} s at a time.",
            )
        if self.dropped_reads:
            yield FormatIssue(
                "readings_dropped",
                f"{self.dropped_reads} reads of the port ({self.dropped_bytes} bytes) were dropped because the disk "
                "was too slow and the queue was full; the samples have gaps there.",
                self.dropped_reads,
            )


class LossCount:
    """Counts the losses in a run's samples as they are decoded."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._last_ns: int | None = None
        self._known_t: float | None = None
        self._last_t = 0.0
        self._missing_since = False
        self._total = self._longest = 0.0

    def push(self, samples: Block) -> None:
        """Count the next samples."""
        if not len(samples):
            return
        if samples.host_ns is not None:
            self._last_ns = int(samples.host_ns[-1])
        missing = (samples.flags & np.uint8(Flag.MISSING)) != 0
        measured = np.flatnonzero(~missing)
        start = float(samples.t[0]) if self._known_t is None else self._known_t
        self._last_t = float(samples.t[-1])
        if measured.size:
            # The time between consecutive distances, if there are readings without a distance between them.
            t = np.concatenate(([start], samples.t[measured]))
            between = np.diff(measured, prepend=-1) > 1
            between[0] |= self._missing_since
            self._add(np.diff(t)[between] - self._period_s)
            self._known_t = float(t[-1])
            self._missing_since = bool(missing[-1])
        else:
            self._known_t, self._missing_since = start, True

    def losses(self, events: Sequence[tuple[int, Event]], start_ns: int, end_ns: int, *, last: bool) -> Losses:
        """Return the losses of a part between two times of the host's clock; ``last`` if no later part follows."""
        if self._missing_since and self._known_t is not None:
            self._add(np.array([self._last_t - self._known_t]))
            self._missing_since = False
        last_ns = start_ns if self._last_ns is None else self._last_ns
        gone_s = (end_ns - last_ns) * 1e-9
        # A port that was lost before the first reading of a run may return without an event.
        why = [event.why or "" for ns, event in events if isinstance(event, Lost) and ns >= last_ns]
        gone = bool(why) or gone_s > max(SILENCE_S, SILENT_PERIODS * self._period_s)
        returns = [event for _, event in events if isinstance(event, Reopened | Continued)]
        another = [event.why or "by its serial number" for event in returns if event.sensor == "another"]
        overflows = [event for _, event in events if isinstance(event, Dropped)]
        return Losses(
            seconds=(end_ns - start_ns) * 1e-9,
            gone_s=max(gone_s, 0.0) if last and gone else None,
            why=why[-1] if last and why else "",
            away=tuple(event.gap_s or 0.0 for _, event in events if isinstance(event, Reopened) and event.goes_on),
            another=another[0] if another else "",
            no_target_s=self._total,
            longest_no_target_s=self._longest,
            shared=any(isinstance(event, Shared) for _, event in events),
            dropped_reads=sum(event.records or 0 for event in overflows),
            dropped_bytes=sum(event.bytes or 0 for event in overflows),
        )

    def _add(self, stretches: np.ndarray[Any, Any]) -> None:
        if stretches.size:
            self._total += float(stretches.clip(0.0).sum())
            self._longest = max(self._longest, float(stretches.max()))


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
