"""The simulated rangefinder on a pseudo-terminal, which the real serial code reads like a sensor.

It works on POSIX only. A pseudo-terminal ignores the baud rate, so the clock determines when bytes are sent.
"""

from __future__ import annotations

import itertools
import os
import pty
import threading
import tty
from collections.abc import Mapping
from typing import Any

from acquisition.clock import Clock
from acquisition.decoders.family import Family
from acquisition.errors import SensorError
from acquisition.simulated.rangefinder import VirtualRangefinder

TEMPERATURE_C = 21.3
"""Temperature that the sensor sends, at which sound has the usual 344 m/s."""


class VirtualPort:
    """A simulated sensor that is available as a port, at ``path``, and sends for a number of seconds."""

    def __init__(
        self,
        family: Family,
        rangefinder: VirtualRangefinder,
        clock: Clock,
        *,
        seconds: float,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        if family.encoder is None or family.poll is not None:
            raise SensorError(f"sensor {family.name} cannot be simulated; simulate line-protocol")
        self._encoder = family.encoder(**(options or {}))
        self._rangefinder = rangefinder
        self._clock = clock
        self._seconds = seconds
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="springmass-sensor", daemon=True)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    def __enter__(self) -> VirtualPort:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop sending and remove the port."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def start(self) -> None:
        """Start measuring and sending."""
        self._thread.start()

    def _run(self) -> None:
        start_ns = self._clock.now_ns()
        for shot in map(self._rangefinder.shot, itertools.count()):
            if shot.true_s >= self._seconds or self._stop.is_set():
                return
            self._clock.sleep_until_ns(start_ns + round(shot.true_s * 1e9))
            frame = self._encoder.encode(
                sequence=shot.sequence,
                device_us=shot.device_us,
                echo_us=shot.echo_us,
                distance_m=shot.distance_m,
                temperature_c=TEMPERATURE_C,
            )
            self._send(frame)

    def _send(self, data: bytes) -> None:
        """Write all bytes; wait for a slow reader, with which a real sensor would lose bytes."""
        remaining = memoryview(data)
        while remaining and not self._stop.is_set():
            try:
                remaining = remaining[os.write(self._master, remaining) :]
            except BlockingIOError:
                self._clock.sleep_until_ns(self._clock.now_ns() + 1_000_000)
