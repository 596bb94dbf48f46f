"""Count the losses of a recording: a disconnected sensor, a target out of sight, readings dropped by a full queue.

All losses follow from the samples and the events of the log, so the end of a recording, ``recover`` and an analysis
report the same ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.block import Block, Flag
from acquisition.recordings.recording import Trap

__all__ = ["LossCount", "Losses", "end_of"]

SILENCE_S, SILENT_PERIODS = 1.5, 5.0
"""A sensor counts as gone if it was silent at the end for longer than this time, s, and this many sample periods."""
NO_TARGET_S = 1.0
"""Minimum duration of a reported loss of the target, s; shorter ones appear only as missing samples."""
UNCONFIRMED = ("restarted", "assumed")
"""Values of ``sensor`` in a "reopened" event that leave open whether it is the same sensor."""

Event = tuple[int, Mapping[str, Any]]
"""Time of an event on the host's monotonic clock, ns, and its ``{"kind", "facts"}`` as in the log."""


@dataclass(frozen=True, slots=True)
class Losses:
    """The losses of one sensor's run.

    Parameters
    ----------
    seconds : float
        Duration of the recording, s.
    gone_s : float or None
        Time from the sensor's last reading to the end, s; None if readings came until the end.
    why : str
        Reason for the loss of the port; empty if the port was present but silent.
    away : tuple of float
        Duration of each interruption after which the port came back, s.
    refused : int
        Number of times that another device was connected instead of the sensor and was not recorded.
    unconfirmed : int
        Number of times that a sensor came back which cannot be distinguished from another of the same model.
    continued_in : int or None
        Channel that continues this one, because another sensor came back on the port.
    continues : int or None
        Channel that this one continues, because this sensor came back in place of another.
    no_target_s, longest_no_target_s : float
        Total and longest time during which the sensor answered without a distance, s.
    dropped_reads, dropped_bytes : int
        Number of reads, and of their bytes, that were dropped because the recorder's queue was full.
    """

    seconds: float
    gone_s: float | None = None
    why: str = ""
    away: tuple[float, ...] = ()
    refused: int = 0
    no_target_s: float = 0.0
    longest_no_target_s: float = 0.0
    dropped_reads: int = 0
    dropped_bytes: int = 0
    unconfirmed: int = 0
    continued_in: int | None = None
    continues: int | None = None

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
        if self.unconfirmed:
            yield Trap(
                "sensor_unconfirmed",
                "After the connection broke, another sensor of the same model may have been plugged in: nothing "
                "identifies it.",
                self.unconfirmed,
            )
        if self.continued_in is not None:
            yield Trap(
                "sensor_replaced",
                "Another sensor, or one whose counter jumped, was plugged in; the recording continues in "
                f"channel {self.continued_in}.",
            )
        if self.continues is not None:
            yield Trap(
                "sensor_replaced",
                "This run begins where another sensor, or this one before its counter jumped, was lost; channel "
                f"{self.continues} holds the earlier part.",
            )
        if self.refused:
            yield Trap(
                "other_device",
                "Another device was connected in place of the lost sensor and did not answer like it; it was not "
                "recorded.",
                self.refused,
            )
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
    """Counts the losses in one sensor's samples as they are decoded.

    Parameters
    ----------
    rate_hz : float
        Nominal sampling rate, Hz.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._last_ns: int | None = None
        self._known_t: float | None = None
        self._last_t = 0.0
        self._missing_since = False
        self._total = self._longest = 0.0

    @property
    def last_ns(self) -> int | None:
        """Time of the last reading on the host's monotonic clock, ns; None before the first reading."""
        return self._last_ns

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
            self._add(np.diff(t)[between] - 1.0 / self._rate_hz)
            self._known_t = float(t[-1])
            self._missing_since = bool(missing[-1])
        else:
            self._known_t, self._missing_since = start, True

    def losses(self, events: Iterable[Event], start_ns: int, end_ns: int) -> Losses:
        """Return the losses between two times of the host's clock, determined from the samples and the events."""
        if self._missing_since and self._known_t is not None:
            self._add(np.array([self._last_t - self._known_t]))
            self._missing_since = False
        notes = [(content.get("kind"), content.get("facts", {})) for _, content in events]
        gone_s = (end_ns - (start_ns if self._last_ns is None else self._last_ns)) * 1e-9
        ports = [(kind, facts) for kind, facts in notes if kind in ("lost", "reopened")]
        lost = bool(ports) and ports[-1][0] == "lost"
        silent = gone_s > max(SILENCE_S, SILENT_PERIODS / self._rate_hz)
        overflows = [facts for kind, facts in notes if kind == "overflow"]
        return Losses(
            (end_ns - start_ns) * 1e-9,
            max(gone_s, 0.0) if lost or silent else None,
            str(ports[-1][1].get("why", "")) if lost else "",
            tuple(_number(facts, "gap_s") for kind, facts in ports if kind == "reopened"),
            sum(kind == "refused" for kind, _ in notes),
            self._total,
            self._longest,
            sum(int(_number(facts, "records")) for facts in overflows),
            sum(int(_number(facts, "bytes")) for facts in overflows),
            sum(kind == "reopened" and facts.get("sensor") in UNCONFIRMED for kind, facts in notes),
            next((int(_number(facts, "channel")) for kind, facts in notes if kind == "replaced"), None),
            next((int(_number(facts, "of")) for kind, facts in notes if kind == "continues"), None),
        )

    def _add(self, stretches: np.ndarray[Any, Any]) -> None:
        if stretches.size:
            self._total += float(stretches.clip(0.0).sum())
            self._longest = max(self._longest, float(stretches.max()))


def _number(facts: Mapping[str, Any], name: str) -> float:
    """Return a number from an event's facts; 0 if a damaged or foreign log has no number there."""
    value = facts.get(name)
    return float(value) if isinstance(value, int | float) else 0.0


def end_of(events: Sequence[Event], last_ns: Iterable[int | None], start_ns: int) -> int:
    """Return the host's time at the end of a recording, from the "ended" event or else from the last record, ns."""
    for mono_ns, content in events:
        if content.get("kind") == "ended":
            return mono_ns
    return max([start_ns, *(mono_ns for mono_ns, _ in events), *(ns for ns in last_ns if ns is not None)])
