"""What a log says besides bytes: marks, events and the calibrations among them, in bounded memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from storage.schema import demand_calibration
from storage.wire_log.log_header import event_content
from storage.wire_log.records import HIGHEST_CHANNEL, Kind, Record

__all__ = ["Notes"]

KEPT = 10_000
KEPT_BYTES = 4 << 20
ENDS = frozenset({"lost", "reopened", "replaced", "continues", "ended"})
"""Events of which the last is kept, however many came before: they say how a recording ended."""


class Notes:
    """Collects the notes of a log: the first ten thousand, or four megabytes of them; the rest are counted.

    Attributes
    ----------
    counts : Counter
        By kind of record.
    calibrations : dict of int to mapping
        The last calibration of each channel.
    parts : dict of int to int
        By channel of a sensor that came back as another, the channel of the one before.
    left_out : int
        Notes that were not kept. The log inside the run file has them.
    """

    def __init__(self) -> None:
        self.counts: Counter[Kind] = Counter()
        self.calibrations: dict[int, Mapping[str, Any]] = {}
        self.parts: dict[int, int] = {}
        self.left_out = 0
        self._kept: list[tuple[Record, dict[str, Any]]] = []
        self._bytes = 0
        self._late: dict[tuple[int, str], tuple[int, dict[str, Any]]] = {}

    def take(self, record: Record) -> None:
        """Take a record that holds no data.

        Raises
        ------
        storage.schema.ValueRefused
            If it is a calibration that none can be.
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
                # The same link as "continues" states, where that record is damaged.
                part = content["facts"].get("channel")
                if isinstance(part, int) and 0 <= part <= HIGHEST_CHANNEL and part != record.channel:
                    self.parts.setdefault(part, record.channel)
        elif record.kind is Kind.MARK:
            content = {"text": record.text()}
        else:
            return
        self._bytes += len(record.payload)
        if len(self._kept) < KEPT and self._bytes <= KEPT_BYTES:
            self._kept.append((record._replace(payload=b""), content))
        else:
            self.left_out += 1
            if content.get("kind") in ENDS:
                self._late[record.channel, content["kind"]] = record.mono_ns, content

    def events(self, channel: int | None = None) -> list[tuple[int, Mapping[str, Any]]]:
        """Return the events of a channel, or of all, in order: host's stamp in ns, kind and facts."""
        found = [(each.channel, (each.mono_ns, content)) for each, content in self._kept if each.kind is Kind.EVENT]
        found += [(of, event) for (of, _), event in sorted(self._late.items(), key=lambda item: item[1][0])]
        return [event for of, event in found if channel in (None, of)]

    def provenance(self, origin_ns: int) -> dict[str, Any]:
        """Return marks and events as plain numbers and texts, with their times since ``origin_ns``."""
        found: dict[Kind, list[dict[str, Any]]] = {Kind.MARK: [], Kind.EVENT: []}
        for record, content in self._kept:
            t_s = (record.mono_ns - origin_ns) * 1e-9
            found[record.kind].append({"mono_ns": record.mono_ns, "t_s": t_s, "channel": record.channel, **content})
        told: dict[str, Any] = {"marks": found[Kind.MARK], "events": found[Kind.EVENT]}
        return told | ({"notes_left_out": self.left_out} if self.left_out else {})
