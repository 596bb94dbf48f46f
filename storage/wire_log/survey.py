"""Survey a log before it is decoded: marks, events, calibrations, and its parts.

A sensor whose port comes back begins a new part.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from storage.errors import NotALog
from storage.schema import ValueRefused
from storage.wire_log.records import HIGHEST_CHANNEL, LogHeader, Record, RecordKind, demand_calibration, event_content
from storage.wire_log.scanning import FOREIGN, LogContents

FIRST_NOTES, LAST_NOTES = 10_000, 100
"""Number of marks and events that are kept; those between the first and the last ones are only counted."""


class Part(NamedTuple):
    """A part of a sensor's data: the sensor's channel in the header, and the number of the part, counted from 1."""

    sensor: int
    number: int


class Parts:
    """The part to which each channel's records belong at present; ``now`` has it by channel.

    An event "continues" opens a channel that the header does not have, as the next part of the sensor in channel "of";
    "replaced" in that sensor's channel says the same, in case the other record is damaged. Versions before 0.3 also let
    a sensor go on in its own channel, after an event "reopened". It then begins a part there, unless the port is on
    the network and the counter of the device has continued: such a part has a gap.
    """

    def __init__(self, channels: Iterable[int]) -> None:
        self.now = {channel: Part(channel, 1) for channel in channels}
        self._count = Counter(self.now.keys())

    def event(self, channel: int, content: Mapping[str, Any]) -> Part | None:
        """Take an event of the log; return the part that it begins, if any."""
        kind, facts = content["kind"], content["facts"]
        if kind == "reopened" and channel in self.now and not goes_on(facts):
            return self._begin(channel, self.now[channel].sensor)
        if kind == "continues":
            return self._open(channel, facts.get("of"))
        return self._open(facts.get("channel"), channel) if kind == "replaced" else None

    def unknown(self, channel: int) -> Part | None:
        """Take data of a channel that no intact event has opened: they are of the log's sensor, if it has only one."""
        return self._begin(channel, *self._count) if len(self._count) == 1 else None

    def _open(self, channel: object, of: object) -> Part | None:
        if not (isinstance(channel, int) and 0 <= channel <= HIGHEST_CHANNEL and isinstance(of, int)):
            return None
        before = self.now.get(of)
        return None if before is None or channel in self.now else self._begin(channel, before.sensor)

    def _begin(self, channel: int, sensor: int) -> Part:
        self._count[sensor] += 1
        self.now[channel] = Part(sensor, self._count[sensor])
        return self.now[channel]


def goes_on(facts: Mapping[str, Any]) -> bool:
    """Return whether the part goes on after an event "reopened"."""
    return facts.get("sensor") == "continued" and "://" in str(facts.get("port", ""))


class LogNote(NamedTuple):
    """A mark or an event, and the part to which its channel belongs after it."""

    kind: RecordKind
    mono_ns: int
    channel: int
    part: Part | None
    content: dict[str, Any]


@dataclass(slots=True)
class PartSpan:
    """The time of a part: of its begin and its last read, ns, and the time between its first and last read, s."""

    begin_ns: int
    last_ns: int
    seconds: float = 0.0


class LogSurvey:
    """What a log contains besides its data, and the extent of each part.

    A calibration at the end of a log applies to all samples, so it is read before any of them is decoded.

    Raises NotALog if a calibration has a value that is not allowed.
    """

    def __init__(self, log: LogContents, header: LogHeader) -> None:
        self.header, self.end_ns = header, header.mono_ns
        self.calibrations: dict[int, Mapping[str, Any]] = {}
        self._parts = Parts(sensor.channel for sensor in header.sensors)
        self.spans = {part: PartSpan(header.mono_ns, 0) for part in self._parts.now.values()}
        first: list[LogNote] = []
        last: deque[LogNote] = deque(maxlen=LAST_NOTES)
        count, now, first_ns = 0, self._parts.now, dict[Part, int]()
        for record in log:
            _, _, mono_ns, kind, channel, _, _ = record
            if kind is RecordKind.DATA:
                part = now.get(channel) or self._begin(self._parts.unknown(channel), mono_ns)
                if part is not None:
                    first_ns.setdefault(part, mono_ns)
                    self.spans[part].last_ns = mono_ns
            elif kind is RecordKind.MARK or kind is RecordKind.EVENT:
                content = {"text": record.text()} if kind is RecordKind.MARK else self._event(log, record)
                (first if count < FIRST_NOTES else last).append(
                    LogNote(kind, mono_ns, channel, now.get(channel), content)
                )
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
            self.spans[part] = PartSpan(mono_ns, 0)
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
        events = [note for note in self._notes if note.kind is RecordKind.EVENT and note.part == part]
        return [(note.mono_ns, note.content["kind"], note.content["facts"]) for note in events]

    def parts_of(self, sensor: int) -> list[Part]:
        """Return the parts of a sensor in order."""
        return sorted(part for part in self.spans if part.sensor == sensor)

    def provenance(self, origin_ns: int) -> dict[str, Any]:
        """Return marks and events as plain numbers and texts, with their times relative to ``origin_ns``."""
        by_kind: dict[RecordKind, list[dict[str, Any]]] = {RecordKind.MARK: [], RecordKind.EVENT: []}
        for kind, mono_ns, channel, _, content in self._notes:
            t_s = (mono_ns - origin_ns) * 1e-9
            by_kind[kind].append({"mono_ns": mono_ns, "t_s": t_s, "channel": channel, **content})
        provenance: dict[str, Any] = {"marks": by_kind[RecordKind.MARK], "events": by_kind[RecordKind.EVENT]}
        return provenance | ({"notes_left_out": self._left_out} if self._left_out else {})
