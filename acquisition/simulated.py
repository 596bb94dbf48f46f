"""The simulated rangefinder: readings with the errors of a real sensor, also behind a port.

The real serial code reads the port like a sensor: a pseudo-terminal, or a network port on Windows, which has none. It
ignores the baud rate, so the clock determines when bytes are sent. Every run is reproducible.
"""

from __future__ import annotations

import itertools
import math
import os
import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.block import Block, Flag, SourceInfo
from acquisition.clock import Clock
from acquisition.decoders.sensor import Sensor
from acquisition.errors import SensorError
from acquisition.readings import Reading, carried

FALSE_ECHO_M = 5e-3
"""Mean distance of the false echoes beyond the bob, m."""
TEMPERATURE_C = 21.3
"""Temperature that the sensor sends, at which sound has the usual 344 m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualSensor:
    """The properties and errors of a simulated rangefinder."""

    rate_hz: float = 100.0
    """Readings per second by the sensor's own clock."""
    tick_s: float = 0.25e-6
    """Resolution of an echo time; 0.25 us corresponds to a distance of 43 um."""
    noise_m: float = 80e-6
    """Standard deviation of the noise of a distance."""
    false_echo_rate_hz: float = 0.1
    """Clusters of false echoes per second, if the bob has one turning point nearest to the sensor per second; each
    cluster follows such a turning point."""
    dead_time_s: float = 0.85e-3
    """Minimum time of flight; an earlier echo gives a reading without a target."""
    speed_of_sound_m_per_s: float = 344.0

    def __post_init__(self) -> None:
        for name in ("rate_hz", "tick_s", "speed_of_sound_m_per_s"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise SensorError(f"a simulated sensor's {name} must be positive and finite, got {getattr(self, name)}")
        for name in ("noise_m", "false_echo_rate_hz"):
            if not getattr(self, name) >= 0:
                raise SensorError(f"a simulated sensor's {name} must not be negative, got {getattr(self, name)}")


class VirtualRangefinder:
    """Takes readings of a bob whose distance in m is a function of the time in s; ``rng`` gives all random numbers."""

    def __init__(self, position: Callable[[float], float], sensor: VirtualSensor, rng: np.random.Generator) -> None:
        self.sensor = sensor
        self._position = position
        self._rng = rng
        self._cluster_remaining = 0
        self._cluster_m = 0.0

    def shot(self, sequence: int) -> Reading:
        """Take the reading with a given sequence number; the numbers of successive calls must not decrease.

        Its host time is that since the start; echo time and distance are NaN for no target.
        """
        sensor = self.sensor
        true_s = sequence / sensor.rate_hz
        # The sound is reflected by the bob half the time of flight later.
        met_s = true_s + self._position(true_s) / sensor.speed_of_sound_m_per_s
        distance_m = self._position(met_s) + self._false_echo(true_s) + self._rng.normal(0.0, sensor.noise_m)
        flight_s = 2.0 * distance_m / sensor.speed_of_sound_m_per_s
        # The device's clock wraps.
        silent = Reading(round(true_s * 1e9), sequence, round(true_s * 1e6) % (1 << 32), temperature_c=TEMPERATURE_C)
        if flight_s < sensor.dead_time_s:
            return silent
        echo_us = round(flight_s / sensor.tick_s) * sensor.tick_s * 1e6
        return silent._replace(echo_us=echo_us, distance_m=0.5e-6 * echo_us * sensor.speed_of_sound_m_per_s)

    def block(self, seconds: float) -> Block:
        """Return the readings of the first ``seconds``, for :class:`acquisition.replay.Replay`."""
        # The product is rounded, so that 0.07 s at 100 Hz give seven samples: it is 7.000000000000001.
        shots = [self.shot(sequence) for sequence in range(math.ceil(round(seconds * self.sensor.rate_hz, 6)))]
        distance = np.array([shot.distance_m for shot in shots], np.float64)
        flags = np.isnan(distance) * np.uint8(Flag.MISSING)
        host_ns = np.array([shot.host_ns for shot in shots], np.int64)
        # The time of a sample is that of the reflection; without an echo, the last travel time is used.
        ways_s = np.array([0.5e-6 * shot.echo_us for shot in shots], np.float64)
        t = np.arange(len(shots)) / self.sensor.rate_hz + carried(ways_s, np.isfinite(ways_s), 0.0)
        return Block(0, t, distance, flags, host_ns)

    def info(self, name: str) -> SourceInfo:
        """Return the description of this sensor as a source."""
        quantum_m = 0.5 * self.sensor.tick_s * self.sensor.speed_of_sound_m_per_s
        return SourceInfo("simulated", name, self.sensor.rate_hz, quantum_m=quantum_m, clock="device")

    def _false_echo(self, t: float) -> float:
        """Return the error of a reading by a false echo, m; a cluster begins after a turning point near the sensor."""
        if self._cluster_remaining > 0:
            self._cluster_remaining -= 1
            return self._cluster_m
        step = 1.0 / self.sensor.rate_hz
        before, now, after = (self._position(t + k * step) for k in (-1, 0, 1))
        # There is about one such turning point per second, so the rate is used as the probability at each.
        if now <= before and now < after and self._rng.random() < self.sensor.false_echo_rate_hz:
            self._cluster_remaining = int(self._rng.integers(3, 18))
            self._cluster_m = FALSE_ECHO_M * float(self._rng.uniform(0.5, 1.5))
        return 0.0


class _PseudoTerminal:
    """A pseudo-terminal; raises ImportError on Windows."""

    def __init__(self) -> None:
        import pty
        import tty

        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    def write(self, data: memoryview) -> int:
        return os.write(self._master, data)

    def close(self) -> None:
        os.close(self._slave)
        os.close(self._master)


class _NetworkPort:
    """A port of this computer's own network for one reader at a time."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.setblocking(False)
        self._reader: socket.socket | None = None
        self.path = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def write(self, data: memoryview) -> int:
        if self._reader is None:
            self._reader, _ = self._listener.accept()
            self._reader.setblocking(False)
            self._reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            return self._reader.send(data)
        except ConnectionError:
            self._reader.close()
            self._reader = None
            raise

    def close(self) -> None:
        if self._reader is not None:
            self._reader.close()
        self._listener.close()


def _line() -> _PseudoTerminal | _NetworkPort:
    """Return where bytes are written that a port reads; without a reader its ``write`` raises an OSError."""
    try:
        return _PseudoTerminal()
    except ImportError:
        return _NetworkPort()


class VirtualPort:
    """A simulated sensor that is available as a port, at ``path``, and sends for a number of seconds."""

    def __init__(
        self,
        family: Sensor,
        rangefinder: VirtualRangefinder,
        clock: Clock,
        *,
        seconds: float,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        if family.encoder is None or family.poll is not None:
            raise SensorError(f"sensor {family.name} cannot be simulated", "simulate line-protocol")
        self._encoder = family.encoder(**(options or {}))
        self._rangefinder = rangefinder
        self._clock = clock
        self._seconds = seconds
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="springmass-sensor", daemon=True)
        self._line = _line()
        self.path = self._line.path

    def __enter__(self) -> VirtualPort:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop sending and remove the port."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._line.close()

    def start(self) -> None:
        """Start measuring and sending."""
        self._thread.start()

    def _run(self) -> None:
        start_ns = self._clock.now_ns()
        for shot in map(self._rangefinder.shot, itertools.count()):
            content = shot._asdict()
            since_ns = content.pop("host_ns")
            if since_ns >= 1e9 * self._seconds or self._stop.is_set():
                return
            self._clock.sleep_until_ns(start_ns + since_ns)
            self._send(self._encoder.encode(**content))

    def _send(self, data: bytes) -> None:
        """Write all bytes; wait for a slow reader, with which a real sensor would lose bytes."""
        remaining = memoryview(data)
        while remaining and not self._stop.is_set():
            try:
                remaining = remaining[self._line.write(remaining) :]
            except (BlockingIOError, ConnectionError):  # nobody reads, or nobody yet
                self._clock.sleep_until_ns(self._clock.now_ns() + 1_000_000)
