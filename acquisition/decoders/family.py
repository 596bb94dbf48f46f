"""The description of a family of rangefinders: its decoder, how it is polled, and its limits in numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Protocol

from acquisition.errors import SensorError
from acquisition.readings import Readings

__all__ = ["RESONATOR_PPM", "Decoder", "DeviceStatus", "Encoder", "Family", "Identity", "Poll", "Polled"]

RESONATOR_PPM = 10_000.0
"""Largest error of a ceramic resonator, ppm: 5000 when new, 3000 by temperature, 3000 by age (Murata P16E)."""


@dataclass(frozen=True, slots=True)
class Identity:
    """How a device identifies itself.

    Parameters
    ----------
    model, version : str
    name : str
        The name that its owner gave it; may be empty.
    settings : mapping of str to int
        Its settings, with units in the names.
    """

    model: str
    version: str
    name: str = ""
    settings: Mapping[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.model} {self.version}{f' named {self.name}' if self.name else ''}"


@dataclass(slots=True)
class DeviceStatus:
    """What a device sends besides readings; decoders of such devices have it as their attribute ``status``.

    Parameters
    ----------
    identity : Identity or None
        The last identity that it sent.
    conditions : dict of str to int
        Counts of readings that measured nothing, by the reason that it gave.
    complaint : str
        The fault that it reports now, and what to check; empty if there is none.
    """

    identity: Identity | None = None
    conditions: dict[str, int] = field(default_factory=dict)
    complaint: str = ""

    @staticmethod
    def of(decoder: Decoder) -> DeviceStatus:
        """Return the status of the device behind a decoder; empty if the device sends none."""
        status = getattr(decoder, "status", None)
        return status if isinstance(status, DeviceStatus) else DeviceStatus()


class Decoder(Protocol):
    """Turns bytes into readings. It resynchronises within two frames after any garbage and never raises on bytes."""

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of faults: "garbage_bytes", "bad_checksum", "bad_frame", ...

        "garbage_bytes" are bytes outside of frames. Their share shows whether a stream belongs to this family.
        """
        ...

    @property
    def pending(self) -> int:
        """Bytes of an incomplete frame; their number is limited for any input."""
        ...

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Decode the bytes of one read of the port, and return the readings of completed frames (perhaps none)."""
        ...

    def flush(self) -> None:
        """Discard an incomplete frame: the port was reopened, or a reply timed out."""
        ...


class Polled(Decoder, Protocol):
    """The decoder of a sensor that sends only on request.

    Only replies and flushes determine the next request, so replayed bytes decode as in the recording. If bytes are
    ``pending`` when a request is due, call ``flush`` first: a late or surplus byte would shift every reply.
    """

    @property
    def request(self) -> bytes:
        """The next request: usually ``Poll.request``, sometimes the request for a temperature."""
        ...


@dataclass(frozen=True, slots=True)
class Poll:
    """How to poll a sensor that sends only on request.

    Parameters
    ----------
    request : bytes
        Sent for each reading.
    interval_s : float
        Time between requests, s.
    timeout_s : float
        Longest wait for a reply, s. After it the decoder is flushed and the input discarded.
    """

    request: bytes
    interval_s: float
    timeout_s: float


class Encoder(Protocol):
    """Writes readings as bytes of a family, for the simulated sensor; it shares no code with the decoder."""

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one frame; a NaN distance means no target."""
        ...


@dataclass(frozen=True, slots=True)
class Family:
    """A family of rangefinders.

    Parameters
    ----------
    name : str
        Name of the family.
    title : str
        One line for the user, with the devices it covers.
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
        Makes a new decoder; its keyword arguments are those in ``options``.
    encoder : callable
        Makes the simulated sensor's encoder, with the same options.
    poll : Poll or None
        None for a sensor that sends by itself.
    options : mapping of str to str
        Options of the decoder by name, with one line each (column, unit, ...).
    has_device_time : bool
        Whether readings contain the device's clock or counter.
    clock_ppm : float
        Largest rate error of the device's clock, including temperature and age, ppm: 200 for a crystal, 10 000 for a
        ceramic resonator, as on common boards. A larger error found by comparison with the host is not believed.
    identify : bytes
        Request on which the device identifies itself; empty if it has none.
    self_framing : bool
        Whether a mark or checksum distinguishes a frame from noise. Without one, bytes cannot show the family.
    source : str
        Data sheet or specification.
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
        """Check that this family has these options.

        Raises
        ------
        SensorError
            With the unknown options and those of the family.
        """
        unknown = sorted(set(options) - set(self.options))
        if unknown:
            known = ", ".join(self.options) or "none"
            raise SensorError(f"sensor {self.name}: expected options among {known}, got {', '.join(unknown)}")

    def describe(self) -> dict[str, Any]:
        """Return the description as plain data, as in the JSON of the sensors."""
        shown = (item.name for item in fields(self) if item.name not in ("decoder", "encoder", "poll", "identify"))
        return {name: getattr(self, name) for name in shown} | {"polled": self.poll is not None}
