"""One sensor of a recording: what it is, how its bytes become samples, and what the log says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from acquisition.decoders.family import Family
from acquisition.decoders.registry import describe_bytes
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from acquisition.live.reader import Transport
from storage.wire_log.records import SensorEntry

__all__ = ["Sensor"]


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
    """

    family: Family
    transport: Transport
    rate_hz: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    calibration: Calibration = field(default_factory=Calibration)
    baud: int = 0

    def chain(self) -> SensorChain:
        """Return a fresh chain."""
        return SensorChain(self.family, options=self.options, rate_hz=self.rate_hz, calibration=self.calibration)

    def entry(self, channel: int) -> SensorEntry:
        """Return what the log's header says of it."""
        calibration = self.calibration.to_mapping()
        return SensorEntry(
            channel, self.family.name, self.transport.name, self.baud, self.rate_hz, dict(self.options), calibration
        )

    def not_heard(self, heard: bytes) -> str:
        """Return one line on what came in place of readings."""
        what = describe_bytes(heard) if heard else "not a byte came; is the sensor powered, its line on the right pin?"
        return (
            f"{self.transport.name}: a {self.family.name} sensor at {self.baud} baud was expected, {what}; "
            "see `springmass sensors` for --sensor and --baud"
        )
