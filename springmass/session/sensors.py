"""One sensor of a recording: its identity, the decoding of its bytes into samples, and its entry in the log."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from acquisition.decoders.decoder import Identity
from acquisition.decoders.registry import describe_bytes
from acquisition.decoders.sensor import Sensor
from acquisition.live.calibration import Calibration
from acquisition.live.clock_fit import COUNTER_PPM
from acquisition.live.decoding import SensorChain
from acquisition.live.firmware import FIRMWARE_VERSION, MODEL
from acquisition.live.serial_port import SerialPort
from acquisition.live.timebase import WRAP_US
from acquisition.readings import Reading
from springmass.errors import SENSOR, ProgramError
from springmass.session.detect import described
from storage.wire_log.records import SensorEntry

ANSWERED = 12
"""Number of readings within which a sensor answers a request for its identity."""
LATE_S, LATE_PERIODS = 0.25, 3.0
"""Maximum delay of a timestamp: more than any jitter in s, and three periods of a slow sensor."""


@dataclass(frozen=True, slots=True)
class OpenSensor:
    """One sensor of a session on an open port; ``rate_hz`` and ``clock_ppm`` are by default those of its family."""

    family: Sensor
    port: SerialPort
    rate_hz: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    calibration: Calibration = field(default_factory=Calibration)
    baud: int = 0
    clock_ppm: float | None = None

    def chain(self) -> SensorChain:
        """Return a new chain."""
        return SensorChain(
            self.family,
            options=self.options,
            rate_hz=self.rate_hz,
            calibration=self.calibration,
            clock_ppm=self.clock_ppm,
        )

    def runs_on(self, before: Reading, now: Reading) -> bool:
        """Return whether a reading continues the device's clock or counter behind a loss of a network port.

        It may have advanced by at most as much as the host's clock, within the possible delay of a timestamp and the
        difference in clock rates; over a network, old readings may arrive first.
        """
        rate_hz = self.rate_hz or self.family.rate_hz
        if min(before.device_us, now.device_us) >= 0:
            ticks, unit_s, wrap, limit_ppm = now.device_us - before.device_us, 1e-6, WRAP_US, self.family.clock_ppm
        elif min(before.sequence, now.sequence) >= 0:
            ticks, unit_s, wrap, limit_ppm = now.sequence - before.sequence, 1.0 / rate_hz, 0, COUNTER_PPM
        else:
            return False
        elapsed_s = (now.host_ns - before.host_ns) * 1e-9
        limit_ppm = limit_ppm if self.clock_ppm is None else self.clock_ppm
        most_s = elapsed_s + max(LATE_S, LATE_PERIODS / rate_hz) + limit_ppm * 1e-6 * elapsed_s
        return any(0.0 <= step * unit_s <= most_s for step in (ticks, ticks + wrap))

    def entry(self, channel: int) -> SensorEntry:
        """Return the sensor's entry for the header of the log."""
        return SensorEntry(
            channel,
            self.family.name,
            self.port.name,
            self.baud,
            self.rate_hz,
            {**dict.fromkeys(self.family.past_defaults, "auto"), **self.options},
            self.clock_ppm,
            calibration=asdict(self.calibration),
        )

    def not_heard(self, heard: bytes) -> ProgramError:
        """Return an error that describes what was received instead of readings."""
        what = "not a byte came; is the sensor powered, its line on the right pin, or does it wait for --send TEXT?"
        if heard:
            what = described(describe_bytes(heard, self.options if self.family.name == "text-lines" else None))
        wrong = f"{self.port.name}: a {self.family.name} sensor at {self.baud} baud was expected, {what}"
        return ProgramError(wrong, "see `springmass ports` for --sensor and --baud", SENSOR)


def meeting(sensor: OpenSensor, identity: Identity) -> Iterator[str]:
    """Yield lines about a sensor that reported its identity."""
    port, rate_hz = sensor.port.name, identity.settings.get("rate_hz")
    yield f"{port}: {identity}{settings_of(identity)}"
    if outdated(identity):
        yield (
            f"{port}: its firmware {identity.version} is older than {FIRMWARE_VERSION}, which comes with this program; "
            f"`springmass firmware --port {port}` shows how to update it"
        )
    if sensor.rate_hz is not None and rate_hz is not None and sensor.rate_hz != rate_hz:
        yield (
            f"{port}: it is set to {rate_hz} Hz, and --rate-hz says {sensor.rate_hz:g}; leave --rate-hz out, "
            f"or set it with `springmass firmware --port {port} --rate {sensor.rate_hz:g}`"
        )


def outdated(identity: Identity) -> bool:
    """Return whether a sensor runs an older version of the firmware that comes with this program."""
    return identity.model == MODEL and _numbers(identity.version) < _numbers(FIRMWARE_VERSION)


def settings_of(identity: Identity) -> str:
    """Return a sensor's settings in words; empty if it does not report them."""
    if not (settings := identity.settings):
        return ""
    spread = f", pings spread over {settings['spread_us']} us" if settings["spread_us"] else ""
    thermometer = "with a thermometer" if settings["thermometer"] else "no thermometer"
    return (
        f": {settings['rate_hz']} Hz, echoes of {settings['near_us']} to {settings['far_us']} us{spread}, {thermometer}"
    )


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))
