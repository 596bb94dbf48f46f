"""What a decoder must offer, with defaults for most of it, and what an encoder must."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Protocol

from acquisition.readings import Readings


@dataclass(frozen=True, slots=True)
class Identity:
    """How a device identifies itself; names of settings include the units."""

    model: str
    version: str
    name: str = ""
    settings: Mapping[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.model} {self.version}{f' named {self.name}' if self.name else ''}"


class Guess(NamedTuple):
    """What bytes look like, in words, and which options would read them, as alternatives with the likeliest first.

    An alternative maps names of options of the family, or ``framing``, to their text; ``when`` says when it is right.
    """

    looks: str
    alternatives: tuple[Mapping[str, str], ...] = ()
    when: tuple[str, ...] = ()


@dataclass(slots=True)
class DeviceStatus:
    """Information that a device sends besides readings.

    ``conditions`` counts the readings without a measured value by the reason that the device gave. ``complaint`` is the
    fault that the device currently reports, with advice on what to check.
    """

    identity: Identity | None = None
    conditions: dict[str, int] = field(default_factory=dict)
    complaint: str = ""


class Decoder(ABC):
    """Turns bytes into readings; it never raises on any bytes and resynchronises within two frames after garbage.

    A decoder must have ``faults``, ``pending``, :meth:`feed` and :meth:`flush`. The others are for a sensor that sends
    more than distances, and for one whose lines may mean something else.
    """

    resolution_m: float | None = None
    """Resolution of the distances so far, m, if it is that of this device and not of its family; else None."""

    @property
    @abstractmethod
    def faults(self) -> Mapping[str, int]:
        """Counts of faults, by name: "garbage_bytes", "bad_checksum", "bad_frame", ...

        "garbage_bytes" counts the bytes outside of frames. Their fraction shows whether a stream is of this family.
        """

    @property
    @abstractmethod
    def pending(self) -> int:
        """Number of bytes of an incomplete frame; it is bounded for any input."""

    @abstractmethod
    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Decode the bytes of one read of the port, and return the readings of the completed frames, if any."""

    @abstractmethod
    def flush(self) -> None:
        """Discard an incomplete frame, after the port was reopened or a reply timed out."""

    @cached_property
    def status(self) -> DeviceStatus:
        """What the device sent besides its readings."""
        return DeviceStatus()

    @property
    def undecided(self) -> bool:
        """Whether the numbers so far may be no distances, so that a recording does not begin yet."""
        return False

    @property
    def refused(self) -> bool:
        """Whether what came is not to be recorded as it is: a counter, two sensors in turn, an unlikely unit."""
        return False

    @property
    def assumed_unit(self) -> str:
        """Unit that is neither printed nor stated, and with which the distances are read; else empty."""
        return ""

    def unread(self, data: bytes) -> Guess:
        """Return what bytes look like that gave no reading, and which options of the family would read them."""
        return Guess("looks like another sensor")


class Encoder(Protocol):
    """Encodes readings as bytes of a family for the simulated sensor; it shares no code with the decoder."""

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one frame; a NaN distance means no target."""
