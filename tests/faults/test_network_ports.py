"""A sensor behind an RFC 2217 server: pyserial's own server before the simulated sensor's port."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import serial
from serial.rfc2217 import PortManager

from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.simulated.pseudo_terminal import VirtualPort
from acquisition.simulated.rangefinder import VirtualRangefinder, VirtualSensor
from springmass.cli import main
from storage.run_file.reading import open_run

# pyserial 3.5 starts its reading thread in the old way.
pytestmark = pytest.mark.filterwarnings(r"ignore:set(Daemon|Name)\(\) is deprecated:DeprecationWarning")

OMEGA = 16.7
CLOCK = SystemClock()


@contextmanager
def swinging() -> Iterator[str]:
    """Yield the port of a simulated sensor of a bob that swings."""
    finder = VirtualRangefinder(lambda t: 0.4 + 0.05 * np.cos(OMEGA * t), VirtualSensor(), np.random.default_rng(5))
    with VirtualPort(get_family("line-protocol"), finder, CLOCK, seconds=60.0) as port:
        port.start()
        yield port.path


class Pty(serial.Serial):
    """A pseudo-terminal as a serial port: one without the modem lines that a server asks for."""

    cts = dsr = ri = cd = False
    rts = dtr = True

    def _update_rts_state(self) -> None:
        """Have none."""

    _update_dtr_state = _update_rts_state


class Bridge:
    """Serves one serial port by RFC 2217 to one client after the other, as pyserial's example server does."""

    def __init__(self, path: str) -> None:
        self._serial = Pty(path, timeout=0)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0.1)
        self._stop = threading.Event()
        self.hang_up = threading.Event()
        self.served = 0
        self.address = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        """Hang up and close."""
        self._stop.set()
        self._thread.join()
        self._listener.close()
        self._serial.close()

    @property
    def baud(self) -> int:
        """What the client set the port to."""
        return int(self._serial.baudrate)

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            self.served += 1
            with connection:
                self._serve(connection)

    def _serve(self, connection: socket.socket) -> None:
        manager = PortManager(self._serial, Writer(connection))
        while not self._stop.is_set():
            if self.hang_up.is_set():
                self.hang_up.clear()
                return
            ready, _, _ = select.select([self._serial, connection], [], [], 0.05)
            try:
                if self._serial in ready:
                    connection.sendall(b"".join(manager.escape(self._serial.read(self._serial.in_waiting))))
                request = connection.recv(1024) if connection in ready else None
            except OSError:
                return
            if request == b"":
                return
            self._serial.write(b"".join(manager.filter(request or b"")))


class Writer:
    """What the manager answers through."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection

    def write(self, data: bytes) -> None:
        """Send to the client."""
        self._connection.sendall(data)


@contextmanager
def bridged(path: str) -> Iterator[Bridge]:
    """Put a port behind a server."""
    bridge = Bridge(path)
    try:
        yield bridge
    finally:
        bridge.close()


def hang_up_while_it_records(bridge: Bridge, log: Path) -> None:
    """Break the connection once something is recorded."""
    until = time.monotonic() + 60.0
    while not (log.exists() and log.stat().st_size > 4000) and time.monotonic() < until:
        threading.Event().wait(0.02)
    bridge.hang_up.set()


def test_a_server_that_hangs_up_is_a_gap_and_the_run_goes_on(tmp_path: Path) -> None:
    """After the connection breaks the reader connects again, and the gap stands in the run with its length."""
    out = tmp_path / "run.h5"
    with swinging() as port, bridged(port) as bridge:
        breaker = threading.Thread(target=hang_up_while_it_records, args=(bridge, out.with_suffix(".wire")))
        breaker.start()
        options = ["--port", bridge.address, "--sensor", "line-protocol", "--seconds", "5"]
        assert main(["record", *options, "-o", str(out)]) == 0
        breaker.join()
        assert bridge.served == 2
        assert bridge.baud == get_family("line-protocol").baud
    with open_run(out) as run:
        events = run.provenance["events"]
        gaps = run.provenance["decoding"]["gaps"]
        samples = run.samples()
    assert [event["kind"] for event in events if event["kind"] in ("lost", "reopened")] == ["lost", "reopened"]
    assert len(samples) > 100
    np.testing.assert_allclose(samples.distance, 0.4, atol=0.06)
    assert sum(gap["lost"] for gap in gaps) == round((samples.t[-1] - samples.t[0]) * 100) + 1 - len(samples)
