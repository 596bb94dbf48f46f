"""`springmass record` reads the emulated rangefinder's port in real time, as it reads a real one."""

import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition.live.firmware import FIRMWARE_VERSION
from storage.run_file.reading import open_run
from storage.wire_log.records import RecordKind
from tests.wire import parse_log

from .conftest import ELF, read_log

pytestmark = pytest.mark.trials

SECONDS = 8.0
LIMIT_S = 120.0
SPEED_M_PER_S = 344.0
M_PER_US = SPEED_M_PER_S * 0.5e-6


@pytest.fixture
def running(built: Path, tmp_path: Path) -> Iterator[tuple[Path, subprocess.Popen[bytes]]]:
    """Give a pseudo-terminal behind which the firmware runs at the pace of the clock, one echo in fifty lost."""
    link = tmp_path / "rangefinder"
    words = [built / "bench", built / ELF, f"--pty={link}", f"--log={tmp_path / 'truth.log'}", "--lost=0.02"]
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
        (log,), samples, decoding = run.originals(), run.samples(), run.provenance["decoding"]
    sent = {}
    for row in read_log(tmp_path / "truth.log", 0.0, 0, 0, True).readings():
        sent[row[0]] = (row[1] * 1e-6, float(row[2]) * M_PER_US if row[2] else np.nan)
    wire = b"".join(record.payload for record in parse_log(log.data) if record.kind is RecordKind.DATA)
    numbers = [int(number) for number in re.findall(rb"\$R1,([0-9]+),[^*\n]*\*[0-9A-F]{4}\n", wire)]
    times_s, distances = np.array([sent[number] for number in numbers]).T
    np.testing.assert_allclose(samples.distance, distances, rtol=0, atol=1e-9)
    known = np.isfinite(distances)
    heard_s = times_s + distances / SPEED_M_PER_S  # a sample's time is that at which the sound met the bob
    np.testing.assert_allclose(np.diff(samples.t[known]), np.diff(heard_s[known]), rtol=0, atol=2e-6)
    lost = sum(gap["lost"] for gap in decoding["gaps"])
    assert numbers[-1] - numbers[0] + 1 == len(numbers) + lost, "readings are missing and it is not said"
    assert len(numbers) > 100
    assert np.isnan(samples.distance).any()
    assert set(decoding["conditions"]) <= {"no_echo", "busy"}
    if "identity" in decoding:  # said every five seconds of the emulator's time
        assert decoding["identity"]["version"] == FIRMWARE_VERSION
    assert "Traceback" not in done.stderr
