"""Count the losses of a run: a disconnected sensor, a target out of sight, readings dropped by a full queue.

All losses follow from the samples and the events of the log, so the end of a recording, ``recover`` and an analysis
report the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.block import Block, Flag
from acquisition.recordings.recording import Trap
from storage.wire_log.parts import goes_on

SILENCE_S, SILENT_PERIODS = 1.5, 5.0
"""A sensor counts as gone if it was silent at the end for longer than this time, s, and this many sample periods."""
NO_TARGET_S = 1.0
"""Minimum duration of a reported loss of the target, s; shorter ones appear only as missing samples."""

Event = tuple[int, str, Mapping[str, Any]]
"""Time of an event on the host's monotonic clock, ns, its kind and its facts."""


@dataclass(frozen=True, slots=True)
class Losses:
    """The losses of one run.

    ``gone_s`` is the time from the last reading to the end, s; None if readings came until the end, or if a later part
    follows. ``why`` is the reason for the loss of the port, empty if the port was present but silent. ``away`` has the
    duration of each interruption of a network port within the run, s. ``another`` says why the run is of another
    sensor than the part before it. ``no_target_s`` and ``longest_no_target_s`` are the total and the longest time
    during which the sensor answered without a distance, s.
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

    def traps(self) -> Iterator[Trap]:
        """Yield a trap for each kind of loss."""
        if self.gone_s is not None:
            why = f" ({self.why})" if self.why else ", though its port was there"
            yield Trap(
                "sensor_lost",
                f"The sensor sent no reading in the last {self.gone_s:.3g} s of the {self.seconds:.4g} s "
                f"recorded{why}.",
            )
        if self.away:
            often = "once" if len(self.away) == 1 else f"{len(self.away)} times"
            yield Trap(
                "sensor_away",
                f"The sensor's port was lost {often} and came back, after at most {max(self.away):.3g} s; "
                f"{sum(self.away):.3g} s in total were not recorded.",
                len(self.away),
            )
        if self.another:
            yield Trap("sensor_replaced", f"Another sensor was plugged in before this part ({self.another}).")
        if self.longest_no_target_s >= NO_TARGET_S:
            yield Trap(
                "no_target",
                f"The sensor heard no echo for {self.no_target_s:.3g} s in total, at most "
                f"{self.longest_no_target_s:.3g} s at a time.",
            )
        if self.dropped_reads:
            yield Trap(
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
        known = np.flatnonzero(~missing)
        start = float(samples.t[0]) if self._known_t is None else self._known_t
        self._last_t = float(samples.t[-1])
        if known.size:
            # The time between consecutive distances, if there are readings without a distance between them.
            t = np.concatenate(([start], samples.t[known]))
            between = np.diff(known, prepend=-1) > 1
            between[0] |= self._missing_since
            self._add(np.diff(t)[between] - self._period_s)
            self._known_t = float(t[-1])
            self._missing_since = bool(missing[-1])
        else:
            self._known_t, self._missing_since = start, True

    def losses(self, events: Sequence[Event], start_ns: int, end_ns: int, *, last: bool) -> Losses:
        """Return the losses of a part between two times of the host's clock; ``last`` if no later part follows."""
        if self._missing_since and self._known_t is not None:
            self._add(np.array([self._last_t - self._known_t]))
            self._missing_since = False
        last_ns = start_ns if self._last_ns is None else self._last_ns
        gone_s = (end_ns - last_ns) * 1e-9
        # A port that was lost before the first reading of a run may return without an event.
        why = [str(facts.get("why", "")) for mono_ns, kind, facts in events if kind == "lost" and mono_ns >= last_ns]
        gone = bool(why) or gone_s > max(SILENCE_S, SILENT_PERIODS * self._period_s)
        begins = [facts for _, kind, facts in events if kind in ("continues", "reopened")]
        another = [facts for facts in begins if facts.get("sensor") == "another"]
        overflows = [facts for _, kind, facts in events if kind == "overflow"]
        return Losses(
            (end_ns - start_ns) * 1e-9,
            max(gone_s, 0.0) if last and gone else None,
            why[-1] if last and why else "",
            tuple(_number(facts, "gap_s") for _, kind, facts in events if kind == "reopened" and goes_on(facts)),
            str(another[0].get("why") or "by its serial number") if another else "",
            self._total,
            self._longest,
            sum(int(_number(facts, "records")) for facts in overflows),
            sum(int(_number(facts, "bytes")) for facts in overflows),
        )

    def _add(self, stretches: np.ndarray[Any, Any]) -> None:
        if stretches.size:
            self._total += float(stretches.clip(0.0).sum())
            self._longest = max(self._longest, float(stretches.max()))


def _number(facts: Mapping[str, Any], name: str) -> float:
    """Return a number from an event's facts; 0 if a damaged or foreign log has no number there."""
    value = facts.get(name)
    return float(value) if isinstance(value, int | float) else 0.0
