"""Sensors on pseudo-terminals and sockets, recorded by the command line: what was sent is what the run file holds.

The wire forms are written here, from the pages of the sensors, and share no code with the decoders.
"""

import errno
import grp
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial

from springmass.cli import main
from storage.run_file.reading import open_run
from tests.faults.conftest import (
    RATE_HZ,
    Send,
    frame_of,
    line_of,
    numbers_of,
    on_a_socket,
    on_a_terminal,
    whole_numbers_of,
)
from tests.sampling import sampled

FIRST_MM, DIFFERENT = 300, 1000
"""Binary readings count up from here in millimetres, and begin again after so many."""


def ffhls(number: int) -> bytes:
    """A reading of an A02YYUW."""
    return frame_of(FIRST_MM + number % DIFFERENT)


def us100(number: int) -> bytes:
    """The reply of a US-100: millimetres, without a header or a checksum."""
    return bytes(divmod(FIRST_MM + number % DIFFERENT, 256))


def recorded(port: str, family: str, out: Path, seconds: float = 0.8) -> Any:
    """Record a port and return the samples, which verify."""
    options = ["--sensor", family, "--rate-hz", f"{RATE_HZ:g}", "--seconds", f"{seconds:g}"]
    assert main(["record", "--port", port, *options, "-o", str(out)]) == 0
    with open_run(out) as run:
        run.verify()
        return run.samples()


@pytest.mark.parametrize(("family", "send"), [("ffhls", ffhls), ("us100", us100)])
def test_every_binary_reading_is_a_sample(family: str, send: Send, tmp_path: Path) -> None:
    """A sensor that sends and one that is asked: no reading is missing, doubled or changed."""
    with on_a_terminal(send, polled=family == "us100") as port:
        samples = recorded(port, family, tmp_path / "run.h5")
    known = samples.distance[np.isfinite(samples.distance)]
    assert known.size >= 4  # a hundred and more where the machine has time
    assert set(np.rint(np.diff(1e3 * known)).tolist()) <= {1.0, 1.0 - DIFFERENT}
    np.testing.assert_allclose(1e3 * known, np.rint(1e3 * known), atol=1e-6)


@pytest.mark.parametrize("place", [on_a_terminal, on_a_socket])
def test_every_line_is_a_sample_at_the_devices_time(tmp_path: Path, place: Callable[[Send], Any]) -> None:
    """On a cable and over the network: all readings, and their times to the microsecond, whatever the delays."""
    with place(line_of) as port:
        samples = recorded(port, "line-protocol", tmp_path / "run.h5")
    assert len(whole_numbers_of(tmp_path / "run.h5")) >= 20
    assert not samples.flags.any()
    # Ten milliseconds by the sensor's clock, and half of what the echo came later.
    np.testing.assert_allclose(np.diff(samples.t), 0.01 + 0.125e-6, atol=1e-9)


def spoiled(line: Callable[[int], bytes], kind: str) -> Send:
    """Return what a bad cable makes of lines: bytes between them, lost or flipped ones, or a flood."""
    rng = np.random.default_rng(4)

    def send(number: int) -> bytes:
        data = bytearray(line(number))
        at = int(rng.integers(len(data)))
        if kind == "flood":
            return bytes(data) + (rng.bytes(3000) if number % 25 == 0 else b"")
        if rng.random() < 0.2:
            if kind == "noise":
                data[at:at] = rng.bytes(int(rng.integers(1, 8)))
            elif kind == "lost bytes":
                del data[at]
            else:
                data[at] ^= 1 << int(rng.integers(8))
        return bytes(data)

    return send


@pytest.mark.parametrize("kind", sampled(["flipped bits", "lost bytes", "noise", "flood"]))
def test_a_bad_cable_gives_no_wrong_value(tmp_path: Path, kind: str) -> None:
    """Spoiled lines are lost and counted; every sample is a reading that was sent, in its order."""
    with on_a_terminal(spoiled(line_of, kind)) as port:
        recorded(port, "line-protocol", tmp_path / "run.h5")
    numbers = np.array(numbers_of(tmp_path / "run.h5"))
    assert np.all(np.diff(numbers) > 0)
    span = numbers[-1] - numbers[0] + 1
    assert 0.55 * span < len(numbers) < span
    with open_run(tmp_path / "run.h5") as run:
        decoding = run.provenance["decoding"]
    assert sum(gap["lost"] for gap in decoding["gaps"]) == span - len(numbers)


def test_a_polled_sensor_is_asked_on_after_a_silence(tmp_path: Path) -> None:
    """Requests without a reply are events of the run, and the distances go on."""
    with on_a_terminal(lambda number: b"" if 15 <= number < 18 else us100(number), polled=True) as port:
        samples = recorded(port, "us100", tmp_path / "run.h5", 2.5)
    counted = np.rint(1e3 * samples.distance[np.isfinite(samples.distance)]) - FIRST_MM
    # On a busy machine the first replies come before the recording begins, so the silence is later than these.
    assert {14.0, 18.0} <= set(counted.tolist())
    with open_run(tmp_path / "run.h5") as run:
        assert "timeout" in {event["kind"] for event in run.provenance["events"]}


@pytest.mark.parametrize("address", ["nonsense://x", "socket://127.0.0.1:1", "rfc2217://127.0.0.1:1", "."])
def test_an_address_that_leads_nowhere_is_one_line(
    address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong scheme, a closed network port and a folder: exit code 4, the address, no file."""
    assert main(["record", "--port", address, "--sensor", "ffhls", "-o", str(tmp_path / "run.h5")]) == 4
    (line,) = capsys.readouterr().err.splitlines()
    assert address in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM])
def test_without_permission_the_group_is_named(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names the group that owns the port and how to join it, and never says to join root."""

    def refuse(address: str, **_: Any) -> None:
        raise serial.SerialException(code, f"could not open port {address}: {os.strerror(code)}")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    place = tmp_path / "ttyUSB0"
    place.touch()
    place.chmod(0o660)
    group = grp.getgrgid(place.stat().st_gid).gr_name
    assert main(["record", "--port", str(place), "--sensor", "ffhls", "-o", str(tmp_path / "run.h5")]) == 4
    (line,) = capsys.readouterr().err.splitlines()
    assert group in line
    assert ("usermod" in line) == (group != "root")
