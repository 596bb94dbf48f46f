"""A sensor that is unplugged, falls silent, or is replaced by another. The loss is reported, and the exit code is 4."""

import contextlib
import json
import re
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from serial.tools import list_ports

from acquisition.errors import PortError
from acquisition.live.serial_port import SerialPort
from springmass.cli import main
from storage.run_file.reading import open_run
from tests.faults.conftest import line_of, on_a_socket, on_a_terminal, whole_numbers_of
from tests.sampling import sampled

RUN_S = 3.0
ANSWER_S = RUN_S + 90.0
"""Within ten seconds of its end a recording has answered, on a machine that is not nine times as busy."""
HALF_SECOND = 4000
"""Bytes of a log."""


def findings_of(run: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, dict[str, str]]:
    """Return an analysis's findings by their code."""
    capsys.readouterr()
    main(["analyse", str(run), "--json"])
    return {finding["code"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}


@pytest.mark.parametrize("how", sampled(["unplugged", "silent"], 1))
def test_a_sensor_that_is_gone_at_the_end_is_said_and_ends_with_4(
    bench: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    """The seconds go on to their end; the end, the run and the findings say since when."""
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, "--seconds", "3", stderr=subprocess.PIPE)
        recording.until_bytes(HALF_SECOND)
        (feeder.unplug if how.startswith("unplugged") else feeder.mute)()
        assert recording.ended(ANSWER_S) == 4
        assert "sensor_lost: " in recording.said()
    whole_numbers_of(out)
    result = findings_of(out, capsys)["sensor_lost"]
    assert result["severity"] == "warning"
    assert ("disconnected" in result["message"]) == how.startswith("unplugged")


@contextlib.contextmanager
def foreign(port: Path) -> Iterator[None]:
    """Put another bench's sensor under a port's name: distances in millimetres, by another form."""
    with on_a_terminal(lambda _: b"R0431\r" * 8) as name:
        port.symlink_to(name)
        yield


@pytest.mark.trials
@pytest.mark.parametrize("who", ["the sensor", "another one"])
def test_what_comes_back_on_the_port_changes_no_reading_before(bench: Any, tmp_path: Path, who: str) -> None:
    """The run file has the readings up to the loss, without a gap; what came afterwards is another part of the log."""
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, "--seconds", "4")
        recording.until_bytes(HALF_SECOND)
        feeder.unplug()
        with bench.feeder() if who == "the sensor" else foreign(feeder.port):
            code = recording.ended(ANSWER_S)
    numbers = whole_numbers_of(out)
    assert len(numbers) > 30
    with open_run(out) as run:
        (log,) = run.originals()
    if who == "the sensor":
        assert code == 0
        recorded = np.array([int(number) for number in re.findall(rb"\$R1,([0-9]+),[^*\n]*\*[0-9A-F]{4}\n", log.data)])
        assert (np.diff(recorded) < 0).sum() == 1
        assert len(recorded) > len(numbers) + 30
    else:
        assert code == 4
        assert b"R0431\r" in log.data


@pytest.mark.trials
def test_a_connection_that_says_nothing_any_more_is_a_sensor_gone(bench: Any, tmp_path: Path) -> None:
    """Over TCP: open to the end, silent for its last half; the connection is probed by the system meanwhile."""
    out, mute = tmp_path / "run.h5", threading.Event()
    with on_a_socket(lambda number: b"" if mute.is_set() else line_of(number)) as address:
        recording = bench.record(address, out, "--seconds", "4")
        recording.until_bytes(HALF_SECOND // 2)
        mute.set()
        code = recording.ended(ANSWER_S)
    assert code == 4
    whole_numbers_of(out)


def test_an_adapter_is_known_by_its_serial_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is found under whatever name it came back; another on its name is opened only where it stays."""
    plugged: list[SimpleNamespace] = []

    def plug(name: str, number: str) -> None:
        plugged[:] = [SimpleNamespace(device=name, description="", vid=0x0403, pid=0x6001, serial_number=number)]

    monkeypatch.setattr(list_ports, "comports", lambda: list(plugged))
    stack = contextlib.ExitStack()
    first = stack.enter_context(on_a_terminal(lambda _: b""))
    second = stack.enter_context(on_a_terminal(lambda _: b"at its new name\n"))
    plug(first, "A1")
    port = SerialPort(first, 9600)
    plug(first, "B2")
    with pytest.raises(PortError, match="serial number A1"):
        port.reopen()
    plug(second, "A1")
    assert port.reopen() == "identified"
    assert b"at its new name\n" in port.read(5.0)
    plug(first, "B2")
    for _ in range(9):
        with pytest.raises(PortError):
            port.reopen()
    assert port.reopen() == "another"
    assert port.reopen() == "identified"  # it is expected from now on
    plug(first, "")
    with pytest.raises(PortError):
        port.reopen()
    plugged.clear()
    with pytest.raises(PortError):
        port.reopen()
    port.close()
    stack.close()
