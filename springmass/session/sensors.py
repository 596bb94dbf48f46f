"""One sensor of a recording: what it is, how its bytes become samples, and what the log says of it."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from acquisition.decoders.family import Decoder, DeviceStatus, Family, Identity
from acquisition.decoders.registry import describe_bytes
from acquisition.live.calibration import Calibration
from acquisition.live.clock_fit import COUNTER_PPM
from acquisition.live.decoding import SensorChain
from acquisition.live.line import Transport
from acquisition.live.timebase import WRAP_US
from acquisition.readings import Reading
from storage.wire_log.records import SensorEntry

__all__ = ["ANSWERED", "Back", "Proof", "Sensor"]


class Back(enum.StrEnum):
    """Which sensor speaks on a port that came back.

    The values stand in wire logs and never change.
    """

    IDENTIFIED = "identified"
    """The same, by its name or its adapter's serial number."""
    CONTINUED = "continued"
    """The same, for its counter goes on."""
    RESTARTED = "restarted"
    """Taken for the same: its counter began anew, as another's would."""
    ASSUMED = "assumed"
    """Taken for the same: nothing tells it from another of its kind."""
    ANOTHER = "another"
    """Another, or one whose counter leapt."""


PROOF_READINGS = 3
ANSWERED = 12
"""Within so many readings a sensor that is asked says what it is."""
LATE_S, LATE_PERIODS = 0.25, 3.0
"""So late a stamp may be: what no jitter exceeds, and three periods of a slow sensor."""
PROOF_BYTES = 4096
"""So many bytes without proof are another device's."""


class Proof:
    """Whether the device on a port that came back is, or may be, the sensor that was lost.

    A device with another known name belongs to another bench: it is refused, as is another wire form. If no name is
    known, the device's counter decides: see :class:`Counters`.

    Parameters
    ----------
    decoder : Decoder
        A fresh one.
    readings : int
        So many readings prove the wire form, where they are at least half of the bytes since the first of them.
    identity : Identity or None
        What the sensor said that it is, where it did: then model and name have to be said again.
    may_say : int
        Within so many readings a sensor that never said what it is may say it.
    judged : callable
        Returns which sensor it is by its last reading, where no name says it.
    """

    def __init__(
        self,
        decoder: Decoder,
        readings: int,
        identity: Identity | None = None,
        may_say: int = 0,
        judged: Callable[[Reading | None], Back] = lambda _: Back.ASSUMED,
    ) -> None:
        self._decoder = decoder
        self._identity = identity
        self._wanted = max(readings, may_say)
        self._judged = judged
        self._readings = self._bytes = self._since_first = self._garbage_before = 0
        self._last: Reading | None = None
        self._named = False

    @property
    def facts(self) -> Mapping[str, str]:
        """Which sensor it is, once that is proven."""
        if self._named:
            return {"sensor": Back.IDENTIFIED}
        judged, identity = self._judged(self._last), DeviceStatus.of(self._decoder).identity
        # The serial number of its adapter outweighs what it says; without a name all of a family say the same.
        if judged is not Back.IDENTIFIED and self._identity is None and identity is not None and identity.name:
            return {"sensor": Back.ANOTHER, "why": "it says its name, and the one before had none"}
        return {"sensor": judged}

    def feed(self, host_ns: int, data: bytes) -> bool | None:
        """Take the bytes of one read; return whether it is the sensor, None while that is open."""
        before = self._decoder.faults.get("garbage_bytes", 0)
        found = self._decoder.feed(host_ns, data)
        came = len(found)
        if came:
            self._last = found[-1]
        if not self._readings:
            self._garbage_before = before
        self._readings += came
        self._bytes += len(data)
        self._since_first += len(data) if self._readings else 0
        garbage = self._decoder.faults.get("garbage_bytes", 0) - self._garbage_before
        identity = DeviceStatus.of(self._decoder).identity
        if self._identity is not None and identity is not None:
            self._named = bool(identity.name)
            if (identity.model, identity.name) != (self._identity.model, self._identity.name):
                return False
            # A name is one bench's; all that nobody named say the same.
            return True if self._named or self._last is not None else None
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

    def proof(self, last: Reading | None = None) -> Proof | None:
        """Return what tells this sensor from another on a port that came back; None where bytes cannot tell.

        Parameters
        ----------
        last : Reading or None
            The one that came last before the port was lost.
        """
        if not self.family.self_framing:
            return None
        # One that is asked is asked once: its decoder sees the reply only afterwards, and says then what to ask next.
        wanted = PROOF_READINGS if self.family.poll is None else 1
        # Without a reading before there is nothing that another's could be taken for.
        may_say = ANSWERED if self.family.identify and last is not None else 0
        return Proof(self.family.decoder(**self.options), wanted, self.identity, may_say, partial(self.judged, last))

    def judged(self, last: Reading | None, now: Reading | None) -> Back:
        """Return which sensor came back, by its port and by its counter before and after.

        Notes
        -----
        A counter that goes on has advanced by as much as the host's clock, but for the time that a stamp may be late
        and the difference of the clocks' rates; through a network old readings may come first. One that began anew
        shows no more than the time since the last reading.
        """
        if self.transport.identified:
            return Back.IDENTIFIED
        if last is None or now is None:
            return Back.ASSUMED
        rate_hz = self.rate_hz or self.family.rate_hz
        if min(last.device_us, now.device_us) >= 0:
            unit_s, before, after, wrap, limit_ppm = 1e-6, last.device_us, now.device_us, WRAP_US, self.family.clock_ppm
        elif min(last.sequence, now.sequence) >= 0:
            unit_s, before, after, wrap, limit_ppm = 1.0 / rate_hz, last.sequence, now.sequence, 0, COUNTER_PPM
        else:
            return Back.ASSUMED
        elapsed_s = (now.host_ns - last.host_ns) * 1e-9
        limit_ppm = limit_ppm if self.clock_ppm is None else self.clock_ppm
        error_s = max(LATE_S, LATE_PERIODS / rate_hz) + limit_ppm * 1e-6 * elapsed_s
        least_s = 0.0 if "://" in self.transport.name else elapsed_s - error_s
        steps_s = [(after - before + more) * unit_s for more in {0, wrap}]
        if any(least_s <= step_s <= elapsed_s + error_s for step_s in steps_s):
            return Back.CONTINUED
        return Back.RESTARTED if after * unit_s <= elapsed_s + error_s else Back.ANOTHER

    def entry(self, channel: int) -> SensorEntry:
        """Return what the log's header says of it."""
        return SensorEntry(
            channel,
            self.family.name,
            self.transport.name,
            self.baud,
            self.rate_hz,
            dict(self.options),
            self.clock_ppm,
            calibration=dict(self.calibration.to_mapping()),
        )

    def not_heard(self, heard: bytes) -> str:
        """Return one line on what came in place of readings."""
        what = describe_bytes(heard) if heard else "not a byte came; is the sensor powered, its line on the right pin?"
        return (
            f"{self.transport.name}: a {self.family.name} sensor at {self.baud} baud was expected, {what}; "
            "see `springmass sensors` for --sensor and --baud"
        )
