"""A sensor behind an RFC 2217 server: pyserial's own server before the simulated sensor's port."""

import contextlib
import select
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import serial
from serial.rfc2217 import PortManager

from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.simulated import VirtualPort, VirtualRangefinder, VirtualSensor
from springmass.cli import main
from storage.run_file.reading import open_run

# pyserial 3.5 starts its reading thread in the old way.
pytestmark = pytest.mark.filterwarnings(r"ignore:set(Daemon|Name)\(\) is deprecated:DeprecationWarning")

LINE = get_family("line-protocol")


class Pty(serial.Serial):
    """A pseudo-terminal as a serial port: one without the modem lines that a server asks for."""

    cts = dsr = ri = cd = False
    rts = dtr = True

    def _update_rts_state(self) -> None:
        """Have none."""

    _update_dtr_state = _update_rts_state


def serve(port: serial.Serial, listener: socket.socket, breaks: list[Callable[[], bool]]) -> None:
    """Serve a port to one client after the other, as pyserial's example server does; each until its break is due."""
    for is_due in breaks:
        connection, _ = listener.accept()
        manager = PortManager(port, SimpleNamespace(write=connection.sendall))
        with connection, contextlib.suppress(OSError):
            while not is_due():
                ready, _, _ = select.select([port, connection], [], [], 0.05)
                if port in ready:
                    connection.sendall(b"".join(manager.escape(port.read(port.in_waiting))))
                if connection in ready:
                    if not (request := connection.recv(1024)):
                        break
                    port.write(b"".join(manager.filter(request)))


def test_a_server_that_hangs_up_is_a_gap_and_the_run_goes_on(tmp_path: Path) -> None:
    """After the connection breaks the reader connects again, and the gap stands in the run with its length."""
    out, until = tmp_path / "run.h5", time.monotonic() + 60.0

    def recorded() -> bool:
        log = out.with_suffix(".wire")
        return (log.exists() and log.stat().st_size > 4000) or time.monotonic() > until

    finder = VirtualRangefinder(lambda t: 0.4 + 0.05 * np.cos(16.7 * t), VirtualSensor(), np.random.default_rng(5))
    with (
        VirtualPort(LINE, finder, SystemClock(), seconds=60.0) as sensor,
        Pty(sensor.path, timeout=0) as port,
        socket.create_server(("127.0.0.1", 0)) as listener,
    ):
        sensor.start()
        listener.settimeout(60.0)
        server = threading.Thread(target=serve, args=(port, listener, [recorded, lambda: False]))
        server.start()
        address = f"rfc2217://127.0.0.1:{listener.getsockname()[1]}"
        assert main(["record", "--port", address, "--sensor", LINE.name, "--seconds", "5", "-o", str(out)]) == 0
        server.join(60.0)
        assert not server.is_alive()
        assert port.baudrate == LINE.baud
    with open_run(out) as run:
        events = run.provenance["events"]
        gaps = run.provenance["decoding"]["gaps"]
        samples = run.samples()
    assert [event["kind"] for event in events if event["kind"] in ("lost", "reopened")] == ["lost", "reopened"]
    assert len(samples) > 100
    np.testing.assert_allclose(samples.distance, 0.4, atol=0.06)
    assert sum(gap["lost"] for gap in gaps) == round((samples.t[-1] - samples.t[0]) * 100) + 1 - len(samples)
