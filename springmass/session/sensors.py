"""One sensor of a recording: its identity, the decoding of its bytes into samples, and its entry in the log."""

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
    """Which sensor is on a port that came back.

    The values are stored in wire logs and must never change.
    """

    IDENTIFIED = "identified"
    """The same sensor, according to its name or its adapter's serial number."""
    CONTINUED = "continued"
    """The same sensor, because its counter continues."""
    RESTARTED = "restarted"
    """Assumed to be the same sensor: its counter restarted, but another sensor's counter would look alike."""
    ASSUMED = "assumed"
    """Assumed to be the same sensor: nothing distinguishes it from another of its kind."""
    ANOTHER = "another"
    """Another sensor, or one whose counter jumped."""


PROOF_READINGS = 3
ANSWERED = 12
"""Number of readings within which a sensor answers a request for its identity."""
LATE_S, LATE_PERIODS = 0.25, 3.0
"""Maximum delay of a timestamp: more than any jitter in s, and three periods of a slow sensor."""
PROOF_BYTES = 4096
"""Number of bytes without proof after which the device counts as another one."""


class Proof:
    """Decides whether the device on a port that came back is, or may be, the sensor that was lost.

    A device that reports another name belongs to another bench and is refused, as is another wire form. If no name is
    known, the device's counter decides; see :meth:`Sensor.judged`.

    Parameters
    ----------
    decoder : Decoder
        A new decoder.
    readings : int
        Number of readings that prove the wire form, if at most half of the bytes since the first reading are garbage.
    identity : Identity or None
        Identity that the sensor reported before, if any; the device must then report the same model and name.
    may_say : int
        Number of readings within which a sensor without a known identity may report one.
    judged : callable
        Returns which sensor it is, from its last reading, if no name decides.
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
        """Which sensor it is, once this has been proven."""
        if self._named:
            return {"sensor": Back.IDENTIFIED}
        judged, identity = self._judged(self._last), DeviceStatus.of(self._decoder).identity
        # The adapter's serial number outweighs the reported identity, which all unnamed sensors of a family share.
        if judged is not Back.IDENTIFIED and self._identity is None and identity is not None and identity.name:
            return {"sensor": Back.ANOTHER, "why": "it says its name, and the one before had none"}
        return {"sensor": judged}

    def feed(self, host_ns: int, data: bytes) -> bool | None:
        """Take the bytes of one read; return whether it is the sensor, or None while this is undecided."""
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
            # A name belongs to one bench, whereas all unnamed sensors report the same identity.
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
        An open transport.
    rate_hz : float or None
        Readings per second set in the sensor; None: the family's rate.
    options : mapping
        Options of the decoder.
    calibration : Calibration
    baud : int
    clock_ppm : float or None
        Maximum rate error of its clock, ppm; None: the family's value.
    identity : Identity or None
        Identity that the sensor reported, if any.
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
        """Return a new chain."""
        return SensorChain(
            self.family,
            options=self.options,
            rate_hz=self.rate_hz,
            calibration=self.calibration,
            clock_ppm=self.clock_ppm,
        )

    def proof(self, last: Reading | None = None) -> Proof | None:
        """Return a proof of this sensor for a port that came back; None if bytes cannot distinguish it from others.

        Parameters
        ----------
        last : Reading or None
            The last reading before the port was lost.
        """
        if not self.family.self_framing:
            return None
        # A polled sensor is polled once only: its decoder chooses the next poll after it has seen the reply.
        wanted = PROOF_READINGS if self.family.poll is None else 1
        # Without an earlier reading, there is no sensor with which another could be confused.
        may_say = ANSWERED if self.family.identify and last is not None else 0
        return Proof(self.family.decoder(**self.options), wanted, self.identity, may_say, partial(self.judged, last))

    def judged(self, last: Reading | None, now: Reading | None) -> Back:
        """Return which sensor came back, judged by its port and by its counter before and after.

        Notes
        -----
        A counter that continues has advanced as much as the host's clock, within the possible delay of a timestamp and
        the difference in clock rates. Over a network, old readings may arrive first. A counter that restarted shows at
        most the time since the last reading.
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
        """Return the sensor's entry for the header of the log."""
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
        """Return a line that describes what was received instead of readings."""
        what = describe_bytes(heard) if heard else "not a byte came; is the sensor powered, its line on the right pin?"
        return (
            f"{self.transport.name}: a {self.family.name} sensor at {self.baud} baud was expected, {what}; "
            "see `springmass sensors` for --sensor and --baud"
        )
