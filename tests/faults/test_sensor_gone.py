"""A sensor that is unplugged, falls silent, or is replaced by another. The loss is reported, and the exit code is 4.

``SPRINGMASS_UNPLUGS`` sets the number of trials.
"""

from __future__ import annotations

import contextlib
import json
import os
import pty
import socket
import subprocess
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.errors import PortError
from acquisition.live import serial_port
from acquisition.live.serial_port import SerialPort
from acquisition.recordings.recording import Trap
from springmass import load, sample_data
from springmass.cli import main
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run

UNPLUGS = int(os.environ.get("SPRINGMASS_UNPLUGS", "3"))
RUN_S = 6.0  # no recording here is longer
ANSWER_S = RUN_S + 90.0
"""Within ten seconds of its end a recording has answered, on a machine that is not nine times as busy."""
SECOND = 8000


def findings_of(run: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, dict[str, str]]:
    """Return an analysis's findings by their code."""
    capsys.readouterr()
    main(["analyse", str(run), "--json"])
    return {finding["code"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}


def events_of(run_file: Path) -> list[str]:
    """Return the kinds of the events in a run."""
    with open_run(run_file) as run:
        return [event["kind"] for event in run.provenance["events"]]


@pytest.mark.trials
@pytest.mark.parametrize("how", ["unplugged", "silent"])
def test_a_sensor_that_is_gone_at_the_end_is_said_and_ends_with_4(
    bench: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    """The seconds go on to their end; the end, the run and the findings say since when."""
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, "--seconds", "5", stderr=subprocess.PIPE)
        recording.until_bytes(SECOND // 2)
        (feeder.unplug if how.startswith("unplugged") else feeder.mute)()
        assert recording.ended(ANSWER_S) == 4
        assert recording.process.stderr is not None
        output = recording.process.stderr.read().decode()
    assert "Traceback" not in output
    assert "sensor_lost: " in output
    numbers = bench.numbers(out)
    bench.demand_whole(numbers)
    result = findings_of(out, capsys)["sensor_lost"]
    assert result["severity"] == "warning"
    assert ("disconnected" in result["message"]) == how.startswith("unplugged")


def test_strict_rejects_a_run_whose_sensor_was_lost(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run that is sound but for that: exit code 0, and 5 under --strict."""
    recording = load(sample_data() / "undamped_simulated_position.txt")
    out = tmp_path / "run.h5"
    lost = Trap("sensor_lost", "The sensor was gone at the end.")
    write_run(out, [recording.samples], recording.info, traps=[lost])
    assert main(["analyse", str(out), "--json"]) == 0
    assert main(["analyse", str(out), "--json", "--strict"]) == 5
    assert "rejected under --strict: sensor_lost" in capsys.readouterr().err
    scene = tmp_path / "scene.toml"
    scene.write_text("[bob]\nmass_kg = 0.2007\n")
    both = [str(out), str(sample_data() / "undamped_simulated_position.txt"), "--scene", str(scene), "--json"]
    assert main(["compare", *both]) == 0
    assert main(["compare", *both, "--strict"]) == 5
    assert "rejected under --strict: sensor_lost" in capsys.readouterr().err


@pytest.mark.trials
def test_another_sensor_on_the_name_of_a_lost_one_is_not_recorded(bench: Any, tmp_path: Path) -> None:
    """What takes the port's name and speaks otherwise is refused and named; no byte of it is in the run."""
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder, contextlib.ExitStack() as stack:
        recording = bench.record(feeder.port, out, "--seconds", "6")
        recording.until_bytes(SECOND // 2)
        feeder.unplug()
        stack.enter_context(foreign(feeder.port))
        assert recording.ended(ANSWER_S) == 4
    numbers = bench.numbers(out)
    bench.demand_whole(numbers)
    kinds = events_of(out)
    assert kinds.count("lost") == 1
    assert "refused" in kinds
    assert "reopened" not in kinds


@pytest.mark.trials
def test_the_sensor_itself_is_recorded_again(bench: Any, tmp_path: Path) -> None:
    """The one that was unplugged proves itself by its wire form, and not a reading since it did is missing."""
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, "--seconds", "5")
        recording.until_bytes(SECOND // 2)
        feeder.unplug()
        with bench.feeder():
            assert recording.ended(ANSWER_S) == 0
    numbers = np.array(bench.numbers(out))
    (back,) = np.flatnonzero(np.diff(numbers) < 0) + 1
    bench.demand_whole(list(numbers[:back]))
    bench.demand_whole(list(numbers[back:]))
    assert len(numbers) - back > 100
    kinds = [kind for kind in events_of(out) if kind in ("lost", "reopened", "refused")]
    assert kinds == ["lost", "reopened"]


@contextlib.contextmanager
def foreign(port: Path) -> Iterator[None]:
    """Put another bench's sensor under a port's name: distances in millimetres, by another form."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    port.symlink_to(os.ttyname(slave))
    stop = threading.Event()

    def speak() -> None:
        while not stop.wait(0.002):
            with contextlib.suppress(BlockingIOError):
                os.write(master, b"R0431\r" * 8)

    thread = threading.Thread(target=speak)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        os.close(slave)
        os.close(master)


@pytest.mark.trials
def test_a_connection_that_says_nothing_any_more_is_a_sensor_gone(bench: Any, tmp_path: Path) -> None:
    """Over TCP: open to the end, silent for its last half; the connection is probed by the system meanwhile."""
    out = tmp_path / "run.h5"
    with socket.create_server(("127.0.0.1", 0)) as listener:
        mute, over = threading.Event(), threading.Event()

        def serve() -> None:
            connection, _ = listener.accept()
            number = 0
            with connection, contextlib.suppress(OSError):
                while not over.wait(0.01):
                    if not mute.is_set():
                        connection.sendall(bench.line(number))
                        number += 1

        thread = threading.Thread(target=serve)
        thread.start()
        recording = bench.record(f"socket://127.0.0.1:{listener.getsockname()[1]}", out, "--seconds", "4")
        recording.until_bytes(SECOND // 4)
        mute.set()
        code = recording.ended(ANSWER_S)
        over.set()
        thread.join()
    assert code == 4
    bench.demand_whole(bench.numbers(out))


def test_a_network_port_is_kept_alive() -> None:
    """The system probes an idle connection after five seconds and gives it up after three probes."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = SerialPort(f"socket://127.0.0.1:{listener.getsockname()[1]}", 115200)
        connection = socket.socket(fileno=os.dup(port.fileno()))
        with connection:
            assert connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 5
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT) == 3
        port.close()


class Usb:
    """Plugs adapters in and out, as far as the list of ports and its links tell."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.devices: dict[str, serial_port._Device] = {}
        monkeypatch.setattr(serial_port, "_devices", lambda: dict(self.devices))

    def plug(self, name: str, number: str) -> None:
        """Have an adapter of one make and this serial number stand under a name."""
        self.devices[os.path.realpath(name)] = serial_port._Device(0x0403, 0x6001, number)


@pytest.fixture
def terminals() -> Iterator[Callable[[], str]]:
    """Return a function that makes a port."""
    open_: list[int] = []

    def make() -> str:
        master, slave = pty.openpty()
        open_.extend((master, slave))
        return os.ttyname(slave)

    yield make
    for descriptor in open_:
        os.close(descriptor)


def test_an_adapter_is_known_by_its_serial_number(
    monkeypatch: pytest.MonkeyPatch, terminals: Callable[[], str]
) -> None:
    """Another on its name is refused; itself is found under whatever name it came back."""
    usb, first, second = Usb(monkeypatch), terminals(), terminals()
    usb.plug(first, "A1")
    port = SerialPort(first, 9600)
    usb.devices.clear()
    usb.plug(first, "B2")
    with pytest.raises(PortError, match="0403:6001 with serial number A1 is not connected"):
        port.reopen()
    assert port.fileno() == -1
    usb.plug(second, "A1")
    port.reopen()
    assert os.ttyname(port.fileno()) == second
    port.close()


@pytest.mark.trials
def test_sensors_unplugged_for_good(bench: Any, tmp_path: Path) -> None:
    """At any moment: exit code 4 in time, every reading before it kept, and the loss said in the run."""
    rng = np.random.default_rng(UNPLUGS)
    for number in range(UNPLUGS):
        out = tmp_path / f"{number}.h5"
        with bench.feeder() as feeder:
            recording = bench.record(feeder.port, out, "--seconds", "4", stderr=subprocess.PIPE)
            recording.until_bytes(int(rng.integers(300, SECOND)))
            feeder.unplug()
            assert recording.ended(ANSWER_S) == 4
            assert b"Traceback" not in recording.process.stderr.read()
        bench.demand_whole(bench.numbers(out))
        with open_run(out) as run:
            assert "sensor_lost" in [trap.code for trap in run.traps]
    print(f"{UNPLUGS} sensors unplugged: all losses reported, every earlier reading kept")


def test_an_adapter_with_a_number_is_not_taken_for_a_port_that_had_none(
    monkeypatch: pytest.MonkeyPatch, terminals: Callable[[], str]
) -> None:
    """Where either is known by its number, it is another; a port of either kind says whether it is known."""
    usb, first, second = Usb(monkeypatch), terminals(), terminals()
    port = SerialPort(first, 9600)
    assert not port.identified
    usb.plug(first, "B2")
    with pytest.raises(PortError, match="serial number B2"):
        port.reopen()
    usb.devices.clear()
    port.reopen()
    port.close()
    usb.plug(second, "A1")
    known = SerialPort(second, 9600)
    assert known.identified
    usb.plug(second, "")
    with pytest.raises(PortError):
        known.reopen()
    known.close()
