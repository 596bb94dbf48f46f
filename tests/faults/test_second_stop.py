"""A disk that hangs, and a user who does not wait for it: what the second Ctrl-C gives up is counted.

``SPRINGMASS_SECOND_STOPS`` sets the number of trials.
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springmass.cli import main
from storage.run_file.reading import open_run
from storage.wire_log.records import Kind
from storage.wire_log.scanning import read_log

STOPS = int(os.environ.get("SPRINGMASS_SECOND_STOPS", "3"))
HUNG = """
import time
from pathlib import Path
from storage import recorder
from storage.wire_log import log_file
folder = Path({folder!r})
write, sync, offer = log_file._NewFile.write, log_file._NewFile.sync, recorder.Recorder._offer
close = recorder.Recorder.close
put = 0
def hang():
    while (folder / "hangs").exists():
        (folder / "hung").touch()
        time.sleep(0.01)
def hanging_write(self, data):
    hang()
    return write(self, data)
def hanging_sync(self):
    hang()
    sync(self)
def counting(self, kind, records):
    global put
    if not self._closing and kind is recorder.Kind.DATA:
        put += len(records)
        (folder / "put").write_text(f"{{put}};")
    offer(self, kind, records)
def closing(self):
    (folder / "closing").touch()
    close(self)
recorder.GIVE_UP_S = 60.0
recorder.Recorder.close = closing
log_file._NewFile.write = hanging_write
log_file._NewFile.sync = hanging_sync
recorder.Recorder._offer = counting
"""


def reads_put(folder: Path) -> int:
    """Return how many reads the recorder was given so far."""
    whole, end, _ = (folder / "put").read_text().partition(";")
    return int(whole) if end else 0


@pytest.mark.trials
@pytest.mark.parametrize("seed", range(STOPS))
def test_a_second_stop_counts_what_the_hanging_disk_did_not_take(bench: Any, tmp_path: Path, seed: int) -> None:
    """Every read that was put is in the log, in the run's count of dropped reads or in the write that hung."""
    rng = np.random.default_rng([seed, 37])
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, before=HUNG.format(folder=str(tmp_path)), stderr=subprocess.PIPE)
        recording.until_bytes(int(rng.integers(1000, 9000)))
        (tmp_path / "hangs").touch()
        recording.until((tmp_path / "hung").exists)
        wanted = reads_put(tmp_path) + int(rng.integers(20, 300))
        recording.until(lambda: reads_put(tmp_path) >= wanted)
        recording.process.send_signal(signal.SIGINT)
        recording.until((tmp_path / "closing").exists)
        threading.Event().wait(float(rng.uniform(0.0, 0.5)))
        assert recording.process.poll() is None, "it waits for the disk"
        recording.process.send_signal(signal.SIGINT)
        assert recording.ended() == 130
        assert recording.process.stderr is not None
        stderr = recording.process.stderr.read().decode()
    assert "Traceback" not in stderr
    put = reads_put(tmp_path)
    log = read_log(recording.log)
    recorded = sum(record.kind is Kind.DATA for record in log)
    assert main(["recover", str(recording.log)]) == 0
    bench.demand_whole(bench.numbers(out))
    with open_run(out) as run:
        dropped = run.provenance["losses"]["dropped_reads"]
        assert "readings_dropped" in {trap.code for trap in run.traps}
    assert f"did not take {dropped} reads" in stderr
    # The write that hung holds the rest, perhaps with a copy of the header.
    assert dropped > 0
    assert 0 <= (hung := put - recorded - dropped) <= log.damage.lost <= hung + 1
