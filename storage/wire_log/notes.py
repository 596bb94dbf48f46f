"""Survey a log before it is decoded: its marks, events and calibrations, and the extent of its parts."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from storage.errors import NotALog
from storage.schema import ValueRefused
from storage.wire_log.parts import Part, Parts
from storage.wire_log.records import Kind, LogHeader, Record, demand_calibration, event_content
from storage.wire_log.scanning import FOREIGN, LogContents

FIRST_NOTES, LAST_NOTES = 10_000, 100
"""Number of marks and events that are kept; those between the first and the last ones are only counted."""


class Note(NamedTuple):
    """A mark or an event, and the part to which its channel belongs after it."""

    kind: Kind
    mono_ns: int
    channel: int
    part: Part | None
    content: dict[str, Any]


@dataclass(slots=True)
class Span:
    """The time of a part: of its begin and its last read, ns, and the time between its first and last read, s."""

    begin_ns: int
    last_ns: int
    seconds: float = 0.0


class Survey:
    """What a log contains besides its data, and the extent of each part.

    A calibration at the end of a log applies to all samples, so it is read before any of them is decoded.

    Raises NotALog if a calibration has a value that is not allowed.
    """

    def __init__(self, log: LogContents, header: LogHeader) -> None:
        self.header, self.end_ns = header, header.mono_ns
        self.calibrations: dict[int, Mapping[str, Any]] = {}
        self._parts = Parts(sensor.channel for sensor in header.sensors)
        self.spans = {part: Span(header.mono_ns, 0) for part in self._parts.now.values()}
        first: list[Note] = []
        last: deque[Note] = deque(maxlen=LAST_NOTES)
        count, now, first_ns = 0, self._parts.now, dict[Part, int]()
        for record in log:
            _, _, mono_ns, kind, channel, _, _ = record
            if kind is Kind.DATA:
                part = now.get(channel) or self._begin(self._parts.unknown(channel), mono_ns)
                if part is not None:
                    first_ns.setdefault(part, mono_ns)
                    self.spans[part].last_ns = mono_ns
            elif kind is Kind.MARK or kind is Kind.EVENT:
                content = {"text": record.text()} if kind is Kind.MARK else self._event(log, record)
                (first if count < FIRST_NOTES else last).append(Note(kind, mono_ns, channel, now.get(channel), content))
                count += 1
            self.end_ns = max(self.end_ns, mono_ns)
        for part, ns in first_ns.items():
            self.spans[part].seconds = (self.spans[part].last_ns - ns) * 1e-9
        self._notes = [*first, *last]
        self._left_out = count - len(self._notes)
        # The event "ended" states the end; after a crash, it is the last record.
        self.end_ns = next((note.mono_ns for note in self._notes if note.content.get("kind") == "ended"), self.end_ns)

    def _begin(self, part: Part | None, mono_ns: int) -> Part | None:
        if part is not None:
            self.spans[part] = Span(mono_ns, 0)
        return part

    def _event(self, log: LogContents, record: Record) -> dict[str, Any]:
        content = event_content(record.payload)
        self._begin(self._parts.event(record.channel, content), record.mono_ns)
        if content["kind"] == "calibration":
            try:
                demand_calibration(content["facts"], "calibration event")
            except ValueRefused as error:
                raise NotALog(log.path, str(error), FOREIGN) from error
            self.calibrations[record.channel] = content["facts"]
        return content

    def events_of(self, part: Part) -> list[tuple[int, str, Mapping[str, Any]]]:
        """Return time, kind and facts of a part's events."""
        events = [note for note in self._notes if note.kind is Kind.EVENT and note.part == part]
        return [(note.mono_ns, note.content["kind"], note.content["facts"]) for note in events]

    def parts_of(self, sensor: int) -> list[Part]:
        """Return the parts of a sensor in order."""
        return sorted(part for part in self.spans if part.sensor == sensor)

    def provenance(self, origin_ns: int) -> dict[str, Any]:
        """Return marks and events as plain numbers and texts, with their times relative to ``origin_ns``."""
        by_kind: dict[Kind, list[dict[str, Any]]] = {Kind.MARK: [], Kind.EVENT: []}
        for kind, mono_ns, channel, _, content in self._notes:
            t_s = (mono_ns - origin_ns) * 1e-9
            by_kind[kind].append({"mono_ns": mono_ns, "t_s": t_s, "channel": channel, **content})
        provenance: dict[str, Any] = {"marks": by_kind[Kind.MARK], "events": by_kind[Kind.EVENT]}
        return provenance | ({"notes_left_out": self._left_out} if self._left_out else {})
