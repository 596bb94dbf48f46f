"""Events of a recording: what happened besides the readings, with one type for each kind.

A log, a run file and JSON store an event as its kind and its facts. :class:`StoredEvent` has them verbatim, even if the
kind or a fact is unknown to this version. The types of the known kinds have the facts that are written and read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct, ValidationError, convert, field


class _Typed(Struct, frozen=True, tag_field="kind"):
    """An event of a known kind; a fact is None if it is not stated."""

    @property
    def kind(self) -> str:
        """The kind, which is stored in logs and never changes."""
        return str(self.__struct_config__.tag)

    @property
    def facts(self) -> dict[str, Any]:
        """The facts that are stated."""
        return {name: x for name in self.__struct_fields__ if (x := getattr(self, name)) is not None}


class Lost(_Typed, frozen=True, tag="lost"):
    """A port is lost."""

    port: str | None = None
    why: str | None = None


class _CameBack(_Typed, frozen=True):
    """A lost port came back after ``gap_s``; ``sensor`` states what is known of the sensor on it, and ``why``."""

    port: str | None = None
    gap_s: float | None = None
    sensor: str | None = None
    why: str | None = None


class Reopened(_CameBack, frozen=True, tag="reopened"):
    """A port came back, and its further data are in the same channel."""

    @property
    def goes_on(self) -> bool:
        """Whether the part goes on: the port is on the network, and the counter of the device has continued."""
        return self.sensor == "continued" and "://" in (self.port or "")


class Replaced(_CameBack, frozen=True, tag="replaced"):
    """A port came back, and its further data are in the channel ``channel``."""

    channel: int | None = None


class Continued(_CameBack, frozen=True, tag="continues"):
    """A port came back: its further data are in this channel, the next part of the sensor in channel ``of``."""

    of: int | None = None


class Shared(_Typed, frozen=True, tag="shared"):
    """Another program reads a port, and takes a part of its bytes."""

    port: str | None = None


class TimedOut(_Typed, frozen=True, tag="timeout"):
    """A polled sensor did not answer in time."""

    after_s: float | None = None


class Dropped(_Typed, frozen=True, tag="overflow"):
    """Reads were dropped since ``first_ns`` because the disk was too slow."""

    records: int | None = None
    bytes: int | None = None
    first_ns: int | None = None


class Zeroed(_Typed, frozen=True, tag="still"):
    """The rest position and its noise were measured before the recording."""

    rest_m: float | None = None
    noise_m: float | None = None


class Triggered(_Typed, frozen=True, tag="trigger"):
    """The bob left its rest position."""

    threshold_m: float | None = None
    keep_s: float | None = None


class Noted(_Typed, frozen=True, tag="note"):
    """Somebody wrote a note on the page."""

    text: str | None = None


class RunEnded(_Typed, frozen=True, tag="ended"):
    """The recording ended, for the reason ``by``; ``failures`` counts those that did not end it."""

    by: str | None = None
    failures: Mapping[str, int] | None = None


class Calibrated(_Typed, frozen=True, tag="calibration"):
    """A calibration applies to the whole recording; all of its facts are those of a ``Calibration``."""


Event = (
    Lost
    | Reopened
    | Replaced
    | Continued
    | Shared
    | TimedOut
    | Dropped
    | Zeroed
    | Triggered
    | Noted
    | RunEnded
    | Calibrated
)


class _OfAnyKind(Struct, frozen=True):
    event: Event  # a field, because msgspec prepares a union anew for each conversion, which takes 0.2 ms


class StoredEvent(Struct, frozen=True, forbid_unknown_fields=True):
    """An event as it is stored: its kind and its facts, whatever they are."""

    kind: Annotated[str, Meta(max_length=100)]
    facts: dict[str, Any] = field(default_factory=dict)

    @property
    def typed(self) -> Event | None:
        """The event as the type of its kind, without facts of another type; None if the kind is unknown."""
        return _typed(self.kind, {name: x for name, x in self.facts.items() if _typed(self.kind, {name: x})})


def _typed(kind: str, facts: Mapping[str, Any]) -> Event | None:
    try:
        return convert({"event": {**facts, "kind": kind}}, _OfAnyKind).event
    except (ValidationError, UnicodeEncodeError):  # a name may have half a surrogate pair
        return None


def recorded_events(provenance: Mapping[str, Any]) -> list[tuple[float, StoredEvent]]:
    """Return the events of a recording with their times, s, as the provenance of its run file has them."""
    return [
        (entry.get("t_s", math.nan), StoredEvent(str(entry.get("kind", "")), entry.get("facts", {})))
        for entry in provenance.get("events", ())
    ]
