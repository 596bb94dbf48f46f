"""`springmass record` reads the emulated rangefinder's port in real time, as it reads a real one."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition.live.firmware import VERSION
from storage.run_file.reading import open_run

from .conftest import Built, read_log

pytestmark = pytest.mark.trials

SECONDS = 8.0
LIMIT_S = 120.0
SPEED_M_PER_S = 344.0
M_PER_US = SPEED_M_PER_S * 0.5e-6


@pytest.fixture
def running(built: Built, tmp_path: Path) -> Iterator[tuple[Path, subprocess.Popen[bytes]]]:
    """Give a pseudo-terminal behind which the firmware runs at the pace of the clock, one echo in fifty lost."""
    link = tmp_path / "rangefinder"
    words: list[str | Path] = [
        built.bench,
        built.elf,
        f"--pty={link}",
        f"--log={tmp_path / 'truth.log'}",
        "--lost=0.02",
    ]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as bench:
        for _ in range(int(LIMIT_S / 0.02)):
            if link.is_symlink():
                break
            threading.Event().wait(0.02)
        yield link, bench
        bench.terminate()


def test_record_reads_the_firmware_in_real_time(running: tuple[Path, subprocess.Popen[bytes]], tmp_path: Path) -> None:
    """What is recorded was sent, in its order and with the firmware's own times; what is not is a gap in the run.

    Nothing here depends on how fast the machine is: a slow one gets fewer readings, none of them wrong.
    """
    (port, bench), out = running, tmp_path / "run.h5"
    words = ["record", "--port", port, "--sensor", "line-protocol", "--seconds", str(SECONDS), "-o", out]
    done = subprocess.run(
        [sys.executable, "-m", "springmass", *words], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    bench.terminate()
    assert bench.wait(LIMIT_S) == 0  # its log is whole then
    assert done.returncode == 0, done.stderr
    with open_run(out) as run:
        run.verify()
        samples, decoding = run.samples(), run.provenance["decoding"]
    sent = {}
    for row in read_log(tmp_path / "truth.log", 0.0, 0, 0, True).readings():
        sent[row[0]] = (row[1] * 1e-6, float(row[2]) * M_PER_US if row[2] else np.nan)
    # Sensor times count from the first reading; which number that was, the times themselves tell.
    at = {round(time_s * 1e6): number for number, (time_s, _) in sent.items()}
    # A sample's time is that at which the sound met the bob; without an echo, as long behind its ping as the last.
    ways_s = samples.distance / SPEED_M_PER_S
    heard = np.maximum.accumulate(np.where(np.isfinite(ways_s), np.arange(ways_s.size), -1))
    pings_s = samples.t - np.where(heard >= 0, ways_s[heard], 0.0)
    first = _first(pings_s, samples.distance, sent)
    start_s = sent[first][0]
    numbers = [at.get(round((t + start_s) * 1e6)) for t in pings_s]
    assert None not in numbers, "a time that was not sent"
    np.testing.assert_allclose(samples.distance, [sent[number][1] for number in numbers], rtol=0, atol=1e-9)
    lost = sum(gap["lost"] for gap in decoding["gaps"])
    assert numbers[-1] - numbers[0] + 1 == len(numbers) + lost, "readings are missing and it is not said"
    assert len(numbers) > 100
    assert np.isnan(samples.distance).any()
    assert set(decoding["conditions"]) <= {"no_echo", "busy"}
    if "identity" in decoding:  # said every five seconds of the emulator's time
        assert decoding["identity"]["version"] == VERSION
    assert "Traceback" not in done.stderr


def _first(t: np.ndarray, distance: np.ndarray, sent: dict[int, tuple[float, float]]) -> int:
    """Return the number of the reading at which the run begins: the one from which the first distances go on."""
    known = np.flatnonzero(np.isfinite(distance))[:50]
    for number, (start_s, _) in sent.items():
        steps = np.rint(t[known] / 0.01).astype(int)
        there = [sent.get(number + step, (start_s, np.nan))[1] for step in steps]
        if np.allclose(there, distance[known], rtol=0, atol=1e-9):
            return number
    raise AssertionError("no such distances were sent")
