"""Wire logs for tests: logs from bytes, records appended one by one, and a disk in memory that fails on request."""

import errno
import json
import math
import tempfile
import threading
from pathlib import Path
from typing import Any

from acquisition.block import Block
from acquisition.decoders.line_protocol import LineProtocolEncoder
from storage.wire_log.appending import LogFile, WireLogWriter
from storage.wire_log.records import Record, RecordKind
from storage.wire_log.scanning import LogContents

WAIT_S = 120.0


def parse_log(data: bytes) -> LogContents:
    """Return the log of some bytes."""
    file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - the log closes it
    file.write(data)
    return LogContents(Path("log"), file)


def append(log: WireLogWriter, kind: RecordKind, payload: bytes, *, mono_ns: int, channel: int = 0) -> None:
    """Append one record."""
    log.extend([(kind, channel, mono_ns, payload)])


def json_of(record: Record) -> dict[str, Any]:
    """Return the content of a record in JSON."""
    content: dict[str, Any] = json.loads(record.payload)
    return content


def bits(block: Block) -> tuple[Any, ...]:
    """Return the content of a block as what can be compared bit for bit."""
    columns = (block.t, block.distance, block.flags, block.host_ns, block.velocity)
    return block.first, *(None if c is None else (c.dtype.str, c.tobytes()) for c in columns)


def line(n: int, echo_us: float) -> bytes:
    """Return what a sensor of the line protocol sends as reading ``n`` at 100 Hz; NaN for no echo."""
    return LineProtocolEncoder().encode(
        sequence=n, device_us=10_000 * n, echo_us=echo_us, distance_m=0.25, temperature_c=math.nan
    )


class Disk:
    """A file in memory with ``room`` bytes whose writes and syncs a test can hold up or refuse."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.room = 1 << 30
        self.writes_pass, self.syncs_pass = threading.Event(), threading.Event()
        self.writes_pass.set()
        self.syncs_pass.set()
        self.held = threading.Event()
        self.sync_trouble: OSError | None = None
        self.threads: dict[str, set[str]] = {"write": set(), "sync": set()}

    def __call__(self, path: Path) -> LogFile:
        """Open."""
        return self

    def write(self, data: bytes | memoryview) -> int:
        """Take what there is room for."""
        self._pass("write", self.writes_pass)
        taken = min(len(data), self.room - len(self.data))
        if not taken:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.data += data[:taken]
        return taken

    def sync(self) -> None:
        """Fail if the test asked for it."""
        self._pass("sync", self.syncs_pass)
        if self.sync_trouble:
            raise self.sync_trouble

    def close(self) -> None:
        """Nothing is held."""

    def _pass(self, what: str, gate: threading.Event) -> None:
        self.threads[what].add(threading.current_thread().name)
        if not gate.is_set():
            self.held.set()
            assert gate.wait(WAIT_S)
