"""kill -9 while recording: what was acknowledged is in the log, and at most the read in flight is not.

The child reads a pipe as if it were a port and records it; the parent feeds the pipe, kills the child at a seeded
random moment and finds out from what is left in the pipe how much the child had read. ``SPRINGMASS_KILLS`` sets the
number of trials.
"""

import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition.clock import SystemClock
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from storage.wire_log.scanning import read_log

KILLS = int(os.environ.get("SPRINGMASS_KILLS", "12"))
PACKET = 64
HEADER = LogHeader(sensors=(SensorEntry(0, "line"),), mono_ns=0, unix_ns=0)


def record(port: int, log: str, mode: str) -> None:
    """Record a port until the process is killed; say after each read how far the log has come."""
    clock = SystemClock()
    recorder = Recorder(log, HEADER, clock, sync_every_s=0.003)
    os.write(1, struct.pack("<II", 0, 0))
    while data := os.read(port, PACKET):
        recorder.reads([(0, clock.now_ns(), data)])
        status = recorder.drain() if mode != "flood" else recorder.status
        os.write(1, struct.pack("<II", status.records, status.synced_records))


def packet(number: int) -> bytes:
    """Return a packet that contains its number."""
    return struct.pack("<Q", number) + bytes([number % 256]) * (PACKET - 8)


def trial(log: Path, mode: str, rng: np.random.Generator) -> tuple[int, int, int]:
    """Feed a recording child, kill it at a random moment, and return what it had read, written and synced."""
    port, feed = os.pipe()
    command = [sys.executable, "-B", __file__, str(port), str(log), mode]
    with subprocess.Popen(command, stdout=subprocess.PIPE, pass_fds=[port]) as child:
        assert child.stdout is not None
        output = child.stdout.read(8)
        last, sent = int(rng.integers(1, 120)), 0
        for sent in range(1, last + 1):
            os.write(feed, packet(sent - 1))
            # Only at the pace of a bench is a read over before the next one comes.
            if mode != "flood" and sent < last:
                output = child.stdout.read(8)
        if mode == "flood":
            output = child.stdout.read(8 * int(rng.integers(1, last + 1)))
        for _ in range(int(10 ** rng.uniform(0, 5))):  # somewhere between the packet's arrival and its record
            pass
        os.kill(child.pid, signal.SIGKILL)
        # What the child said before it died counts, heard or not.
        output += child.stdout.read()
    os.close(feed)
    remaining = b"".join(iter(lambda: os.read(port, 1 << 16), b""))
    os.close(port)
    written, synced = struct.unpack("<II", output[: len(output) // 8 * 8][-8:])
    return sent - len(remaining) // PACKET, written, synced


@pytest.mark.trials
@pytest.mark.parametrize(("mode", "kills"), [("paced", KILLS), ("flood", -(-KILLS // 3))])
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no kill -9")
def test_a_killed_recording_keeps_every_committed_record(mode: str, kills: int, tmp_path: Path) -> None:
    """Every log opens with the reads from the first on, at the bench's pace all but the one in flight."""
    rng = np.random.default_rng(kills)
    lost = []
    for number in range(kills):
        log = tmp_path / f"{number}.wire"
        taken, written, synced = trial(log, mode, rng)
        contents = read_log(log)
        reads = [record.payload for record in contents if record.kind is RecordKind.DATA]
        assert reads == [packet(n) for n in range(len(reads))], "a wrong record"
        assert contents.header == HEADER
        assert contents.damage.lost == contents.damage.skipped_bytes == 0
        assert contents.damage.records >= written >= synced
        lost.append(taken - len(reads))
    assert mode == "flood" or max(lost) <= 1, lost
    assert min(lost) >= 0


if __name__ == "__main__":
    record(int(sys.argv[1]), *sys.argv[2:])
