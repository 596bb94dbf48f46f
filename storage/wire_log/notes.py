"""Collect the marks, events and calibrations of a log in bounded memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from storage.schema import demand_calibration
from storage.wire_log.log_header import event_content
from storage.wire_log.records import HIGHEST_CHANNEL, Kind, Record

__all__ = ["Notes"]

MAX_NOTES = 10_000
MAX_BYTES = 4 << 20
ENDS = frozenset({"lost", "reopened", "replaced", "continues", "ended"})
"""Events whose last occurrence is always kept, because they show how a recording ended."""


class Notes:
    """Collects the marks and events of a log: the first ten thousand, or four megabytes; later ones are only counted.

    Attributes
    ----------
    counts : Counter
        Number of records by kind.
    calibrations : dict of int to mapping
        The last calibration of each channel.
    parts : dict of int to int
        For each channel of a sensor that replaced another, the channel of the replaced sensor.
    left_out : int
        Number of notes that were not kept. They remain in the log inside the run file.
    """

    def __init__(self) -> None:
        self.counts: Counter[Kind] = Counter()
        self.calibrations: dict[int, Mapping[str, Any]] = {}
        self.parts: dict[int, int] = {}
        self.left_out = 0
        self._notes: list[tuple[Record, dict[str, Any]]] = []
        self._bytes = 0
        self._last_ends: dict[tuple[int, str], tuple[int, dict[str, Any]]] = {}

    def take(self, record: Record) -> None:
        """Collect a record that is not a data record.

        Raises
        ------
        storage.schema.ValueRefused
            If the record is a calibration with a value out of range.
        """
        self.counts[record.kind] += 1
        if record.kind is Kind.EVENT:
            content = event_content(record.payload)
            if content["kind"] == "calibration":
                demand_calibration(content["facts"], "calibration event")
                self.calibrations[record.channel] = content["facts"]
            elif content["kind"] == "continues" and isinstance(of := content["facts"].get("of"), int):
                self.parts.setdefault(record.channel, of)
            elif content["kind"] == "replaced":
                # This event states the same link as "continues", in case the "continues" record is damaged.
                part = content["facts"].get("channel")
                if isinstance(part, int) and 0 <= part <= HIGHEST_CHANNEL and part != record.channel:
                    self.parts.setdefault(part, record.channel)
        elif record.kind is Kind.MARK:
            content = {"text": record.text()}
        else:
            return
        self._bytes += len(record.payload)
        if len(self._notes) < MAX_NOTES and self._bytes <= MAX_BYTES:
            self._notes.append((record._replace(payload=b""), content))
        else:
            self.left_out += 1
            if content.get("kind") in ENDS:
                self._last_ends[record.channel, content["kind"]] = record.mono_ns, content

    def events(self, channel: int | None = None) -> list[tuple[int, Mapping[str, Any]]]:
        """Return the events of one channel, or of all channels, in order: host time in ns, kind and facts."""
        events = [(each.channel, (each.mono_ns, content)) for each, content in self._notes if each.kind is Kind.EVENT]
        events += [
            (of_channel, event)
            for (of_channel, _), event in sorted(self._last_ends.items(), key=lambda item: item[1][0])
        ]
        return [event for of_channel, event in events if channel in (None, of_channel)]

    def provenance(self, origin_ns: int) -> dict[str, Any]:
        """Return marks and events as plain numbers and texts, with their times relative to ``origin_ns``."""
        by_kind: dict[Kind, list[dict[str, Any]]] = {Kind.MARK: [], Kind.EVENT: []}
        for record, content in self._notes:
            t_s = (record.mono_ns - origin_ns) * 1e-9
            by_kind[record.kind].append({"mono_ns": record.mono_ns, "t_s": t_s, "channel": record.channel, **content})
        provenance: dict[str, Any] = {"marks": by_kind[Kind.MARK], "events": by_kind[Kind.EVENT]}
        return provenance | ({"notes_left_out": self.left_out} if self.left_out else {})
