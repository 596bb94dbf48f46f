"""Survey a log before it is decoded: marks, events, calibrations, and its parts.

A sensor whose port comes back begins a new part.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from acquisition.events import Calibrated, Continued, Event, Reopened, Replaced, RunEnded
from storage.errors import NotALog
from storage.schema import ValueRefused, plain
from storage.wire_log.records import HIGHEST_CHANNEL, LogHeader, Record, RecordKind, demand_calibration, event_of
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

    def event(self, channel: int, event: Event | None) -> Part | None:
        """Take an event of the log; return the part that it begins, if any."""
        if isinstance(event, Reopened) and channel in self.now and not event.goes_on:
            return self._begin(channel, self.now[channel].sensor)
        if isinstance(event, Continued):
            return self._open(channel, event.of)
        return self._open(event.channel, channel) if isinstance(event, Replaced) else None

    def unknown(self, channel: int) -> Part | None:
        """Take data of a channel that no intact event has opened: they are of the log's sensor, if it has only one."""
        return self._begin(channel, *self._count) if len(self._count) == 1 else None

    def _open(self, channel: int | None, of: int | None) -> Part | None:
        if channel is None or channel in self.now or not 0 <= channel <= HIGHEST_CHANNEL or of not in self.now:
            return None
        return self._begin(channel, self.now[of].sensor)

    def _begin(self, channel: int, sensor: int) -> Part:
        self._count[sensor] += 1
        self.now[channel] = Part(sensor, self._count[sensor])
        return self.now[channel]


class LogNote(NamedTuple):
    """A mark or an event, and the part to which its channel belongs after it; ``event`` is one of a known kind."""

    kind: RecordKind
    mono_ns: int
    channel: int
    part: Part | None
    content: dict[str, Any]
    event: Event | None


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
                content, event = (
                    self._event(log, record) if kind is RecordKind.EVENT else ({"text": record.text()}, None)
                )
                note = LogNote(kind, mono_ns, channel, now.get(channel), content, event)
                (first if count < FIRST_NOTES else last).append(note)
                count += 1
            self.end_ns = max(self.end_ns, mono_ns)
        for part, ns in first_ns.items():
            self.spans[part].seconds = (self.spans[part].last_ns - ns) * 1e-9
        self._notes = [*first, *last]
        self._left_out = count - len(self._notes)
        # An event states the end; after a crash, it is the last record.
        self.end_ns = next((note.mono_ns for note in self._notes if isinstance(note.event, RunEnded)), self.end_ns)

    def _begin(self, part: Part | None, mono_ns: int) -> Part | None:
        if part is not None:
            self.spans[part] = PartSpan(mono_ns, 0)
        return part

    def _event(self, log: LogContents, record: Record) -> tuple[dict[str, Any], Event | None]:
        stored = event_of(record.payload)
        event = stored.typed
        self._begin(self._parts.event(record.channel, event), record.mono_ns)
        if isinstance(event, Calibrated):
            try:
                demand_calibration(stored.facts, "calibration event")
            except ValueRefused as error:
                raise NotALog(log.path, str(error), FOREIGN) from error
            self.calibrations[record.channel] = stored.facts
        return plain(stored), event

    def events_of(self, part: Part) -> list[tuple[int, Event]]:
        """Return times and events of the known kinds in a part."""
        return [(note.mono_ns, note.event) for note in self._notes if note.event is not None and note.part == part]

    def parts_of(self, sensor: int) -> list[Part]:
        """Return the parts of a sensor in order."""
        return sorted(part for part in self.spans if part.sensor == sensor)

    def provenance(self, origin_ns: int) -> dict[str, Any]:
        """Return marks and events as plain numbers and texts, with their times relative to ``origin_ns``."""
        provenance: dict[str, Any] = {"marks": [], "events": []}
        for kind, mono_ns, channel, _, content, _ in self._notes:
            of_kind = provenance["marks" if kind is RecordKind.MARK else "events"]
            t_s = (mono_ns - origin_ns) * 1e-9
            of_kind.append({"mono_ns": mono_ns, "t_s": t_s, "channel": channel, **content})
        return provenance | ({"notes_left_out": self._left_out} if self._left_out else {})
