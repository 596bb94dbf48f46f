"""What a family of rangefinders must offer: its decoder, how it is polled, and its limits in numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Protocol

from acquisition.errors import SensorError
from acquisition.readings import Readings

__all__ = ["RESONATOR_PPM", "Decoder", "Encoder", "Family", "Identity", "Poll", "Polled", "Told"]

RESONATOR_PPM = 10_000.0
"""What a ceramic resonator may be off, ppm: 5000 when new, 3000 with temperature, 3000 with age (Murata P16E)."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What a device says that it is.

    Parameters
    ----------
    model, version : str
    name : str
        What its owner calls it; empty where nobody named it.
    settings : mapping of str to int
        What it is set to, with units in the names.
    """

    model: str
    version: str
    name: str = ""
    settings: Mapping[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.model} {self.version}{f' named {self.name}' if self.name else ''}"


@dataclass(slots=True)
class Told:
    """What a device says besides readings; a decoder whose device does so keeps it as its attribute ``told``.

    Parameters
    ----------
    identity : Identity or None
        What it last said that it is.
    conditions : dict of str to int
        Counts of readings that measured nothing, by the reason that it gave.
    complaint : str
        What it says is wrong with it now, and what to check; empty where nothing is.
    """

    identity: Identity | None = None
    conditions: dict[str, int] = field(default_factory=dict)
    complaint: str = ""

    @staticmethod
    def by(decoder: Decoder) -> Told:
        """Return what the device behind a decoder told so far; nothing where it cannot tell."""
        told = getattr(decoder, "told", None)
        return told if isinstance(told, Told) else Told()


class Decoder(Protocol):
    """Turns bytes into readings, back in step within two frames after any garbage; never raises on bytes."""

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what was no reading: "garbage_bytes", "bad_checksum", "bad_frame", ...

        "garbage_bytes" are those that were part of no frame: what tells whether a stream is of this family at all.
        """
        ...

    @property
    def pending(self) -> int:
        """Bytes held until the frame they began is whole; bounded, whatever comes."""
        ...

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Take the bytes of one read of the port, return the frames they completed (perhaps none)."""
        ...

    def flush(self) -> None:
        """Forget a half-received frame: the port was reopened, or a reply timed out."""
        ...


class Polled(Decoder, Protocol):
    """The decoder of a sensor that speaks only when asked.

    Replies and flushes alone decide what comes next, so replayed bytes decode as they did live. Before a request is
    sent with ``pending`` bytes left over, ``flush`` is due: a late or a surplus byte would shift every reply.
    """

    @property
    def request(self) -> bytes:
        """What to send next: mostly ``Poll.request``, at times the request for a temperature."""
        ...


@dataclass(frozen=True, slots=True)
class Poll:
    """How a sensor that speaks only when asked is asked.

    Parameters
    ----------
    request : bytes
        Sent for each reading.
    interval_s : float
        Between requests, s.
    timeout_s : float
        A reply later than this is lost: the decoder is flushed and the input discarded.
    """

    request: bytes
    interval_s: float
    timeout_s: float


class Encoder(Protocol):
    """Writes readings in a family's wire form, for the simulated sensor; the decoder's counterpart in no line."""

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one frame; NaN distance means no target."""
        ...


@dataclass(frozen=True, slots=True)
class Family:
    """A family of rangefinders.

    Parameters
    ----------
    name : str
        As ``--sensor`` takes it.
    title : str
        One line for people, with the devices it covers.
    baud : int
        Default speed of the port (8 data bits, no parity, one stop bit).
    rate_hz : float
        Readings per second it can give.
    resolution_m : float
        Smallest step of a distance, m.
    range_m : tuple of float
        Nearest and farthest distance, m.
    limits : str
        What a user must know before relying on it, one sentence.
    decoder : callable
        Makes a fresh decoder; keyword options as ``options`` names them.
    encoder : callable
        Makes the simulated sensor's encoder, with the same options.
    poll : Poll or None
        None for a sensor that sends by itself.
    options : mapping of str to str
        Options of the decoder by name, with one line each (column, unit, ...).
    has_device_time : bool
        Whether readings carry the device's clock or counter.
    clock_ppm : float
        What the device's clock may be off at most, with temperature and age, ppm: 200 with a crystal, 10 000 with a
        ceramic resonator, as common boards have it. A comparison with the host that says more is not believed.
    identify : bytes
        Makes the device say what it is; empty where it does not know such a request.
    self_framing : bool
        Whether a mark or checksum tells a frame from noise; without one, bytes alone never show the family.
    source : str
        Datasheet or specification.
    """

    name: str
    title: str
    baud: int
    rate_hz: float
    resolution_m: float
    range_m: tuple[float, float]
    limits: str
    decoder: Callable[..., Decoder]
    encoder: Callable[..., Encoder]
    poll: Poll | None = None
    options: Mapping[str, str] = field(default_factory=dict)
    has_device_time: bool = False
    clock_ppm: float = RESONATOR_PPM
    identify: bytes = b""
    self_framing: bool = True
    source: str = ""

    def demand_options(self, options: Mapping[str, Any]) -> None:
        """Refuse options that this family does not take.

        Raises
        ------
        SensorError
            Naming them and those it takes.
        """
        unknown = sorted(set(options) - set(self.options))
        if unknown:
            known = ", ".join(self.options) or "none"
            raise SensorError(f"sensor {self.name} takes these options: {known}; got {', '.join(unknown)}")

    def describe(self) -> dict[str, Any]:
        """Return what ``springmass sensors --json`` prints."""
        shown = (item.name for item in fields(self) if item.name not in ("decoder", "encoder", "poll", "identify"))
        return {name: getattr(self, name) for name in shown} | {"polled": self.poll is not None}
