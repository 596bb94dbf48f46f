"""Wire logs of tests: logs from bytes, and records appended one by one."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import Kind, Record
from storage.wire_log.scanning import LogContents


def parse_log(data: bytes) -> LogContents:
    """Return the log of some bytes."""
    file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - the log closes it
    file.write(data)
    return LogContents(Path("log"), file)


def append(log: WireLogWriter, kind: Kind, payload: bytes, *, mono_ns: int, channel: int = 0) -> None:
    """Append one record."""
    log.extend([(kind, channel, mono_ns, payload)])


def json_of(record: Record) -> dict[str, Any]:
    """Return the content of a record in JSON."""
    content: dict[str, Any] = json.loads(record.payload)
    return content
