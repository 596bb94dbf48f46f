"""A port that comes back: the same sensor or another, with a counter that goes on, leaps or begins anew.

The sensors are written here and share no code with the decoders. Pseudo-terminals have no serial numbers, so these are
put in. ``SPRINGMASS_REPLUGS`` sets the number of trials; each kind comes in turn.
"""

from __future__ import annotations

import binascii
import contextlib
import os
import pty
import subprocess
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from storage.run_file.reading import open_run

REPLUGS = int(os.environ.get("SPRINGMASS_REPLUGS", "10"))
STEP_S = 0.01
FIRST_US, STEP_US = 1000.0, 0.25
SPEED_M_PER_S = 344.0
RIGHT_S = 0.01
SECOND = 6000
"""Bytes of a log of about a second."""
SECOND_PLUG = 20_000
"""Number of the first reading after the replug: each echo encodes the number of its reading, and so its time."""
SERIAL_NUMBERS = """
import os
from pathlib import Path
from acquisition.live import serial_port
folder = Path({folder!r})
def devices():
    number, port = folder / "serial", folder / "port"
    if not number.exists() or not port.exists():
        return {{}}
    return {{os.path.realpath(port): serial_port._Device(0x0403, 0x6001, number.read_text())}}
serial_port._devices = devices
"""


def checked(body: str) -> bytes:
    """Return a line of docs/reference/line-protocol.md."""
    return b"$%s*%04X\n" % (body.encode("ascii"), binascii.crc_hqx(body.encode("ascii"), 0xFFFF))


class Sensor:
    """A hundred readings a second on a pseudo-terminal, until it is unplugged.

    Parameters
    ----------
    folder : Path
        Where the port's name stands.
    first : int
        Number of its first reading.
    clock_s : float
        What its own clock shows then, s.
    name : str or None
        What it says that it is called, where it is asked; None: it does not answer.
    stranger : bool
        Whether it speaks another wire form.
    """

    def __init__(
        self, folder: Path, first: int, clock_s: float, name: str | None = None, *, stranger: bool = False
    ) -> None:
        self._port, self._first, self._name, self._stranger = folder / "port", first, name, stranger
        self._clock_us = round(clock_s * 1e6)
        self._stop = threading.Event()
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.start_s = time.monotonic()
        self._port.symlink_to(os.ttyname(self._slave))
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def clock_s(self) -> float:
        """Return what its clock shows now."""
        return time.monotonic() - self.start_s + self._clock_us * 1e-6

    def taken_s(self, numbers: np.ndarray) -> np.ndarray:
        """Return the host's clock when its sound of these readings met the bob."""
        echo_s = (FIRST_US + STEP_US * numbers) * 1e-6
        return np.asarray(self.start_s + (numbers - self._first) * STEP_S + 0.5 * echo_s)

    def unplug(self) -> None:
        """Take the port away."""
        self._stop.set()
        self._thread.join()
        self._port.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)

    def _run(self) -> None:
        sent = 0
        while not self._stop.wait(max(0.0, self.start_s + sent * STEP_S - time.monotonic())):
            number = self._first + sent
            us = (self._clock_us + 10_000 * sent) % 2**32
            counter = (self._clock_us // 10_000 + sent) % 2**32
            line = checked(f"R1,{counter},{us},{FIRST_US + STEP_US * number:.2f},2000,E")
            with contextlib.suppress(BlockingIOError):
                if self._name is not None and b"?" in os.read(self._master, 100):
                    output = f"I1,springmass-rangefinder,2.0.0,{self._name},100,100,25000,0,0"
                    os.write(self._master, checked(output))
            with contextlib.suppress(BlockingIOError):  # nobody reads: a sensor's bytes are lost then
                os.write(self._master, b"R0431\r" * 4 if self._stranger else line)
            sent += 1


@dataclass(frozen=True)
class Replug:
    """What comes back, and what has to become of it.

    Parameters
    ----------
    leap_s : float or None
        By how much its clock is off the one before; None: it shows ``clock_s``.
    clock_s : float
    names : tuple
        What the two are called.
    serials : tuple
        Serial numbers of the two adapters.
    where : int or None
        Channel that its readings have to be in; None: nowhere.
    warned : str or None
        Finding of the run that holds them, or of the run that lacks them.
    """

    leap_s: float | None
    clock_s: float = 0.0
    names: tuple[str | None, str | None] = (None, None)
    serials: tuple[str | None, str | None] = (None, None)
    stranger: bool = False
    where: int | None = 0
    warned: str | None = None


KINDS = {
    "goes on": Replug(0.0),
    "leaps by 2990 s": Replug(2990.0, where=1, warned="sensor_replaced"),
    "leaps by 30 s": Replug(30.0, where=1, warned="sensor_replaced"),
    "leaps by 1 s": Replug(1.0, where=1, warned="sensor_replaced"),
    "leaps by -3 s": Replug(-3.0, where=1, warned="sensor_replaced"),
    "leaps by 0.1 s": Replug(0.1),
    "restarts": Replug(None, 0.05, warned="sensor_unconfirmed"),
    "another bench, on for hours": Replug(None, 2987.65, where=1, warned="sensor_replaced"),
    "a stranger": Replug(None, stranger=True, where=None, warned="other_device"),
    "another adapter": Replug(None, 0.0, serials=("A1", "B2"), where=None, warned="sensor_lost"),
    "an adapter where none was": Replug(None, 0.0, serials=(None, "B2"), where=None, warned="sensor_lost"),
    "the same adapter, restarted": Replug(None, 0.0, serials=("A1", "A1")),
    "the same adapter, leapt": Replug(30.0, serials=("A1", "A1")),
    "another name": Replug(None, 0.0, names=("bench-1", "bench-2"), where=None, warned="other_device"),
    "the same name, leapt": Replug(30.0, names=("bench-1", "bench-1")),
    "a name where none was": Replug(None, 0.0, names=(None, "bench-2"), where=1, warned="sensor_replaced"),
    "no name where one was": Replug(None, 0.0, names=("bench-1", None), where=None, warned="other_device"),
    "nobody named them": Replug(2990.0, names=("", ""), where=1, warned="sensor_replaced"),
}


@pytest.mark.trials
@pytest.mark.parametrize("seed", range(REPLUGS))
def test_what_comes_back_is_timed_rightly_and_never_taken_for_another_without_a_word(
    bench: Any, tmp_path: Path, seed: int
) -> None:
    """Every time is right to 10 ms; a foreign reading is in the run only with a warning that it may be one."""
    rng = np.random.default_rng([seed, 3737])
    kind = list(KINDS)[seed % len(KINDS)]
    case, out = KINDS[kind], tmp_path / "run.h5"
    set_serial(tmp_path, case.serials[0])
    first = Sensor(tmp_path, 0, float(rng.uniform(5.0, 3000.0)), case.names[0])
    recording = bench.record(
        tmp_path / "port",
        out,
        "--seconds",
        "6",
        before=SERIAL_NUMBERS.format(folder=str(tmp_path)),
        stderr=subprocess.PIPE,
    )
    recording.until_bytes(int(rng.integers(SECOND, 2 * SECOND)))
    first.unplug()
    threading.Event().wait(float(rng.uniform(0.1, 1.0)))
    set_serial(tmp_path, case.serials[1])
    clock_s = case.clock_s if case.leap_s is None else first.clock_s() + case.leap_s
    second = Sensor(tmp_path, SECOND_PLUG, clock_s, case.names[1], stranger=case.stranger)
    try:
        code = recording.ended()
        stderr = recording.process.stderr.read().decode()
    finally:
        second.unplug()
    assert code == (0 if case.where == 0 else 4), (kind, stderr)
    runs = {0: out} if case.where != 1 else {0: out, 1: tmp_path / "run.1.h5"}
    assert sorted(tmp_path.glob("*.h5")) == sorted(runs.values()), (kind, stderr)
    worst_s = 0.0
    for channel, path in runs.items():
        numbers = np.array(bench.numbers(path))
        foreign = numbers >= SECOND_PLUG
        assert foreign.any() == (channel == case.where), kind
        assert (~foreign).any() == (channel == 0), kind
        with open_run(path) as run:
            t = run.samples().t
            codes = {trap.code for trap in run.traps}
            lost = sum(gap["lost"] for gap in run.provenance["decoding"]["gaps"])
        assert ("sensor_unconfirmed" in codes) == (case.warned == "sensor_unconfirmed"), kind
        assert ("sensor_replaced" in codes) == (case.where == 1), kind
        assert case.warned is None or case.warned in codes, kind
        assert lost < 200, "losses are counted across a change of counter"
        true_s = np.where(foreign, second.taken_s(numbers), first.taken_s(numbers))
        # The run's own zero is its first reading.
        off_s = (t - t[0]) - (true_s - true_s[0])
        worst_s = max(worst_s, float(np.abs(off_s).max()))
    print(f"{kind}: no time is off by more than {worst_s * 1e3:.2f} ms")
    assert worst_s <= RIGHT_S, kind


def set_serial(folder: Path, number: str | None) -> None:
    """Have the adapter on the port have this serial number."""
    path = folder / "serial"
    path.unlink(missing_ok=True)
    if number is not None:
        path.write_text(number)
