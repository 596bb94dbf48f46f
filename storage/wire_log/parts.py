"""Divide what a sensor sends into parts: a sensor whose port comes back begins a new part."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from storage.wire_log.records import HIGHEST_CHANNEL


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
