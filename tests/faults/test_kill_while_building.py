"""kill -9 while a run file is built: the old file or the new one stands there, never anything between.

The child counts the calls that building makes and stops at one of them; there the parent kills it. So the moments
spread over the whole of the work, the last syscalls included. ``SPRINGMASS_KILLS`` raises the number of trials.
"""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from storage.recovery.recover import recover
from storage.run_file.reading import open_run
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from tests.wire import append

TRIALS = max(10, int(os.environ.get("SPRINGMASS_KILLS", "12")) // 2)
HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="simulated")


def log_of(path: Path, reads: int) -> None:
    """Write a log."""
    log = WireLogWriter(path, HEADER)
    for number in range(reads):
        append(log, RecordKind.DATA, b"R%04d\r" % (1000 + number) * 5, mono_ns=number)
    append(log, RecordKind.END, b"{}", mono_ns=reads)
    log.close()


def build(log: str, out: str, stop_at: int) -> None:
    """Build a run file; at a call of the given number say so and wait for the end. Print how many calls there were."""
    calls = 0

    def count(*_: Any) -> None:
        nonlocal calls
        calls += 1
        if calls == stop_at:
            os.write(1, b"here\n")
            threading.Event().wait()

    sys.setprofile(count)
    recover(log, out, overwrite=True, remove_log=True)
    sys.setprofile(None)
    print(calls)


def command(log: Path, out: Path, stop_at: int) -> list[str]:
    """Return the child's command line."""
    return [sys.executable, "-B", __file__, str(log), str(out), str(stop_at)]


def samples_in(out: Path) -> int:
    """Return the number of samples of a run file that holds what was written."""
    with open_run(out) as run:
        run.verify()
        return len(run)


@pytest.mark.trials
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no kill -9")
def test_killed_while_the_run_file_is_built_old_or_new_stands(tmp_path: Path) -> None:
    """Whenever it dies, the run file is the old one or the new one, or none where none was; and no byte is lost."""
    old, new = tmp_path / "old.wire", tmp_path / "new.wire"
    log_of(old, 100)
    log_of(new, 160)
    recover(old, tmp_path / "old.h5")
    before, bytes_of_log = (tmp_path / "old.h5").read_bytes(), new.read_bytes()
    out, log = tmp_path / "run.h5", tmp_path / "run.wire"
    log.write_bytes(bytes_of_log)
    first = subprocess.run(command(log, out, 0), capture_output=True, text=True, check=True)
    calls = int(first.stdout)
    assert (samples_in(out), log.exists()) == (800, False)
    rng = np.random.default_rng(TRIALS)
    states = []
    for trial in range(TRIALS):
        # Stratified over the whole work. The last trial dies behind the rename, which few of the calls follow.
        stop_at = 1 + int(calls * (trial + rng.random()) / TRIALS) if trial < TRIALS - 1 else calls - 2
        log.write_bytes(bytes_of_log)
        out.unlink(missing_ok=True)
        if trial % 2:
            out.write_bytes(before)
        with subprocess.Popen(command(log, out, stop_at), stdout=subprocess.PIPE) as child:
            assert child.stdout is not None
            child.stdout.readline()
            child.kill()
        result = samples_in(out) if out.exists() else 0
        assert result in ((500, 800) if trial % 2 else (0, 800)), f"killed at call {stop_at} of {calls}"
        assert result == 800 or log.read_bytes() == bytes_of_log
        if log.exists():
            assert recover(log, out, overwrite=True).runs[0].samples == 800
        states.append(result == 800)
    assert {False, True} <= set(states), "the kills hit only one side"


if __name__ == "__main__":
    build(sys.argv[1], sys.argv[2], int(sys.argv[3]))
