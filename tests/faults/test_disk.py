"""A disk that fills up, a file-size limit, short writes: one clear line, and nothing committed is lost."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.clock import SystemClock, VirtualClock
from storage.errors import WriteFailed
from storage.recorder import Recorder
from storage.recovery.recover import recover
from storage.run_file.reading import open_run
from storage.wire_log.appending import LogFile, open_log_file
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from storage.wire_log.scanning import read_log
from tests.faults.conftest import files_up_to

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0)
LIMIT = 400_000


class Faulty:
    """A real file whose writes are cut short or refused, as a seeded plan says."""

    def __init__(self, path: Path, rng: np.random.Generator, room: int) -> None:
        self._file: LogFile = open_log_file(path)
        self._rng, self._room = rng, room

    def write(self, data: bytes | memoryview) -> int:
        """Take a part, or none."""
        taken = int(self._rng.integers(1, len(data) + 1)) if self._rng.random() < 0.3 else len(data)
        taken = min(taken, self._room)
        self._room -= taken
        if not taken:
            raise OSError(errno.ENOSPC, "No space left on device")
        return self._file.write(data[:taken])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def reads_of(log: Path) -> list[bytes]:
    """Return the data records' payloads."""
    return [record.payload for record in read_log(log) if record.kind is RecordKind.DATA]


def test_a_log_at_the_file_size_limit_becomes_its_run_file(tmp_path: Path) -> None:
    """The run file packs the log, so it finds room under the same limit and holds what was recorded."""
    log, number = tmp_path / "run.wire", 0
    with files_up_to(LIMIT):
        recorder = Recorder(log, HEADER, SystemClock(), sync_every_s=0.003)
        while not recorder.status.error:
            recorder.reads([(0, number * 100_000_000, b"R%04d\r" % (number % 5000))])
            number += 1
            recorder.drain()
        with pytest.raises(WriteFailed) as caught:
            recorder.close()
        recover(recorder.contents())
    line = str(caught.value)
    assert line.startswith(f"{log}: the wire log could not be continued (File too large); check the disk")
    assert f"{read_log(log).damage.records} records" in line
    assert "\n" not in line
    assert log.stat().st_size == LIMIT
    with open_run(tmp_path / "run.h5") as run:
        run.verify()
        assert run.originals()[0].data == log.read_bytes()
        assert len(run) == len(reads_of(log))


@pytest.mark.parametrize("seed", range(6))
def test_short_writes_and_a_full_disk_keep_what_was_committed(seed: int, tmp_path: Path) -> None:
    """Writes cut at random, then none: every record counted as written reads back, and the error is one line."""
    rng = np.random.default_rng(seed)
    log = tmp_path / "run.wire"
    room = int(rng.integers(1000, 12_000))
    recorder = Recorder(log, HEADER, VirtualClock(), open_file=lambda path: Faulty(path, rng, room), sync_every_s=0.001)
    for number in range(500):
        recorder.reads([(0, number, b"R%04d\r" % number)])
    status = recorder.drain()
    with pytest.raises(WriteFailed) as caught:
        recorder.close()
    assert status.error == str(caught.value)
    assert "\n" not in status.error
    assert "(No space left on device)" in status.error
    reads = reads_of(log)
    assert reads == [b"R%04d\r" % number for number in range(len(reads))]
    final = recorder.status
    assert read_log(log).damage.records == final.records == final.synced_records
    assert len(reads) + final.dropped_records == 500


def test_a_disk_full_from_the_start_leaves_nothing_behind(tmp_path: Path) -> None:
    """The run does not begin, and the name is free for another attempt."""
    log = tmp_path / "run.wire"
    rng = np.random.default_rng(0)
    with pytest.raises(WriteFailed, match="No space left on device"):
        Recorder(log, HEADER, VirtualClock(), open_file=lambda path: Faulty(path, rng, 50))
    assert not log.exists()
