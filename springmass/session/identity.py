"""Describe in words the identity that a sensor reports: its settings, and whether it needs an update."""

from __future__ import annotations

from collections.abc import Iterator

from acquisition.decoders.family import Identity
from acquisition.live.firmware import MODEL, VERSION
from springmass.session.sensors import Sensor

__all__ = ["meeting", "outdated", "settings_of"]


def meeting(sensor: Sensor, identity: Identity) -> Iterator[str]:
    """Yield lines about a sensor that reported its identity."""
    port, rate_hz = sensor.port.name, identity.settings.get("rate_hz")
    yield f"{port}: {identity}{settings_of(identity)}"
    if outdated(identity):
        yield (
            f"{port}: its firmware {identity.version} is older than {VERSION}, which comes with this program; "
            f"`springmass firmware --port {port} --flash` updates it"
        )
    if sensor.rate_hz is not None and rate_hz is not None and sensor.rate_hz != rate_hz:
        yield (
            f"{port}: it is set to {rate_hz} Hz, and --rate-hz says {sensor.rate_hz:g}; leave --rate-hz out, "
            f"or set it with `springmass firmware --port {port} --rate {sensor.rate_hz:g}`"
        )


def outdated(identity: Identity) -> bool:
    """Return whether a sensor runs an older version of the firmware that comes with this program."""
    return identity.model == MODEL and _numbers(identity.version) < _numbers(VERSION)


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
