"""One sensor of a recording: what it is, how its bytes become samples, and what the log says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from acquisition.decoders.family import Decoder, Family, Identity, Told
from acquisition.decoders.registry import describe_bytes
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from acquisition.live.line import Transport
from storage.wire_log.records import SensorEntry

__all__ = ["Proof", "Sensor"]

PROOF_READINGS = 3
PROOF_BYTES = 4096
"""So many bytes without proof are another device's."""


class Proof:
    """Whether what speaks on a port that came back has the wire form of the sensor that was lost.

    Parameters
    ----------
    decoder : Decoder
        A fresh one.
    readings : int
        So many readings prove it, where they are at least half of the bytes since the first of them.
    identity : Identity or None
        What the sensor said that it is, where it did: then that and its name have to be said again.
    """

    def __init__(self, decoder: Decoder, readings: int, identity: Identity | None = None) -> None:
        self._decoder = decoder
        self._identity = identity
        self._wanted = readings
        self._readings = self._bytes = self._since_first = self._garbage_before = 0

    def feed(self, host_ns: int, data: bytes) -> bool | None:
        """Take the bytes of one read; return whether it is the sensor, None while that is open."""
        before = self._decoder.faults.get("garbage_bytes", 0)
        came = len(self._decoder.feed(host_ns, data))
        if not self._readings:
            self._garbage_before = before
        self._readings += came
        self._bytes += len(data)
        self._since_first += len(data) if self._readings else 0
        garbage = self._decoder.faults.get("garbage_bytes", 0) - self._garbage_before
        said = Told.by(self._decoder).identity
        if self._identity is not None and said is not None:
            return (said.model, said.name) == (self._identity.model, self._identity.name)
        if self._identity is None and self._readings >= self._wanted and 2 * garbage <= self._since_first:
            return True
        return False if self._bytes >= PROOF_BYTES else None


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor of a session.

    Parameters
    ----------
    family : Family
    transport : Transport
        Open.
    rate_hz : float or None
        Readings per second it is set to; None: the family's.
    options : mapping
        Of the decoder.
    calibration : Calibration
    baud : int
    clock_ppm : float or None
        What its clock may be off at most, ppm; None: the family's.
    identity : Identity or None
        What it said that it is, where it did.
    """

    family: Family
    transport: Transport
    rate_hz: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    calibration: Calibration = field(default_factory=Calibration)
    baud: int = 0
    clock_ppm: float | None = None
    identity: Identity | None = None

    def chain(self) -> SensorChain:
        """Return a fresh chain."""
        return SensorChain(
            self.family,
            options=self.options,
            rate_hz=self.rate_hz,
            calibration=self.calibration,
            clock_ppm=self.clock_ppm,
        )

    def proof(self) -> Proof | None:
        """Return what tells this sensor from another on a port that came back; None where bytes cannot tell."""
        if not self.family.self_framing:
            return None
        # One that is asked is asked once: its decoder sees the reply only afterwards, and says then what to ask next.
        wanted = PROOF_READINGS if self.family.poll is None else 1
        return Proof(self.family.decoder(**self.options), wanted, self.identity)

    def entry(self, channel: int) -> SensorEntry:
        """Return what the log's header says of it."""
        calibration = self.calibration.to_mapping()
        return SensorEntry(
            channel,
            self.family.name,
            self.transport.name,
            self.baud,
            self.rate_hz,
            dict(self.options),
            calibration,
            self.clock_ppm,
        )

    def not_heard(self, heard: bytes) -> str:
        """Return one line on what came in place of readings."""
        what = describe_bytes(heard) if heard else "not a byte came; is the sensor powered, its line on the right pin?"
        return (
            f"{self.transport.name}: a {self.family.name} sensor at {self.baud} baud was expected, {what}; "
            "see `springmass sensors` for --sensor and --baud"
        )
