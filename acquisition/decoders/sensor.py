"""The description of a kind of rangefinder: its decoder, its polling and its numerical limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from acquisition.decoders.decoder import Decoder, Encoder
from acquisition.errors import SensorError

RESONATOR_PPM = 10_000.0
"""Limit for the error of a ceramic resonator, ppm: about the sum of 5000 when new, 3000 by temperature and 3000 by
aging (Murata P16E)."""


@dataclass(frozen=True, slots=True)
class Poll:
    """How to poll a sensor that sends only on request.

    Parameters
    ----------
    request : bytes
        Bytes that request one reading.
    interval_s : float
        Time between requests, s.
    timeout_s : float
        Maximum wait for a reply, s. After it, the decoder is flushed and the input discarded.
    reply_bytes : int
        Size of a reply. If a part of one has come when the next request is due, that counts as a time-out: without a
        header, a late or surplus byte would shift every later reply.
    """

    request: bytes
    interval_s: float
    timeout_s: float
    reply_bytes: int = 1


@dataclass(frozen=True, slots=True)
class Sensor:
    """A family of rangefinders.

    Parameters
    ----------
    name, title : str
        Name in the registry, and one line for the user that lists the devices of the family.
    baud : int
        Default speed of the port (8 data bits, no parity, one stop bit).
    rate_hz : float
        Readings per second that the sensors of the family can deliver.
    resolution_m : float
        Resolution of a distance, m.
    range_m : tuple of float
        Minimum and maximum distance, m.
    limits : str
        One sentence on the limitations that a user must know before relying on the sensor.
    decoder : callable
        Returns a new decoder; its keyword arguments are the names in ``options``.
    encoder : callable, optional
        Returns a new encoder, with which ``record --simulate`` can simulate the sensor; it takes the same options.
    poll : Poll or None
        How to poll the sensor; None for a sensor that sends without requests.
    options : mapping of str to str
        Options of the decoder (column, unit, ...): their names, each with a description of one line.
    past_options : tuple of str
        Options that only logs of earlier versions have; the decoder still takes them.
    past_defaults : mapping
        Values of options that logs of earlier versions do not state; logs of this version state theirs.
    has_device_time : bool
        Whether readings contain a clock time or a counter of the device.
    clock_ppm : float
        Maximum rate error of the device's clock, including temperature and aging, ppm: 200 for a crystal, 10 000 for a
        ceramic resonator, as on common boards. A larger error found by comparison with the host's clock is rejected.
    identify : bytes
        Request that makes the device identify itself; empty if there is none.
    self_framing : bool
        Whether a marker or checksum distinguishes a frame from noise. Without one, bytes cannot identify the family.
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
    encoder: Callable[..., Encoder] | None = None
    poll: Poll | None = None
    options: Mapping[str, str] = field(default_factory=dict)
    past_options: tuple[str, ...] = ()
    past_defaults: Mapping[str, Any] = field(default_factory=dict)
    has_device_time: bool = False
    clock_ppm: float = RESONATOR_PPM
    identify: bytes = b""
    self_framing: bool = True
    source: str = ""

    def demand_options(self, options: Mapping[str, Any], *, past: bool = False) -> None:
        """Check that the family has all the given options, or had them in an earlier version."""
        unknown = sorted(set(options) - set(self.options) - set(self.past_options if past else ()))
        if unknown:
            allowed = ", ".join(self.options) or "none"
            raise SensorError(f"sensor {self.name}: expected options among {allowed}, got {', '.join(unknown)}")

    def describe(self) -> dict[str, Any]:
        """Return the description as plain data, for the JSON list of the sensors."""
        hidden = ("decoder", "encoder", "poll", "identify", "past_options", "past_defaults")
        shown = (item.name for item in fields(self) if item.name not in hidden)
        return {name: getattr(self, name) for name in shown} | {"polled": self.poll is not None}
