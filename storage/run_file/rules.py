"""What the header of a run file may say: each key with its type and range."""

from __future__ import annotations

from acquisition.block import UNITS
from storage.calibration import CALIBRATION_RULE
from storage.checked import Choice, Json, Number, Optional, Rows, Table, Text

__all__ = ["HEADER_RULE", "LONGEST_HEADER", "MOST_UNWRITTEN"]

LONGEST_HEADER = 1 << 26
"""Bytes of the header's text: a day of events is a thousandth of it."""

MOST_UNWRITTEN = 10_000_000
"""Samples, or bytes of original files, that a file may hold packed without as many bytes of its own: a day at 100 Hz.

Beyond it, a file that states more than it has bytes is a bomb: it would fill the memory with what was never measured.
"""

_SHA256 = Text(64, r"[0-9a-f]{64}", "a SHA-256 in 64 hexadecimal digits")
_COUNT = Number(0, 2**53, whole=True)
_SAMPLES = Number(0, 2**32, whole=True)
_LENGTH = Optional(Number(0.0, 1e30))

_INFO = Table(
    keys={
        "kind": Choice(("live", "replay", "simulated")),
        "name": Text(),
        "rate_hz": Number(1e-9, 1e12),
    },
    may={
        "sigma_m": _LENGTH,
        "quantum_m": _LENGTH,
        "stated_error_m": Optional(Number(-1e30, 1e30)),  # as an old recording prints it, whatever it means
        "clock": Choice(("nominal", "device", "host")),
    },
)
_COLUMNS = Table(
    keys={"time": _SHA256, "distance": _SHA256, "quality": _SHA256},
    may={"distance_errors": _SHA256, "velocity": _SHA256, "sequence": _SHA256, "host_mono_ns": _SHA256},
)
_SENSOR = Table(
    may={"calibration": CALIBRATION_RULE, "family": Text(), "options": Table(other=Json())},
    other=Json(),
)
_CLOCK = Table(
    may={
        "rate_error_ppm": Optional(Number(-1e300, 1e300)),
        "u_rate_error_ppm": Optional(Number(0.0, 1e300)),
        "limit_ppm": Number(0.0, 1e300),
        "span_s": Number(0.0, 1e300),
        "held_readings": _COUNT,
        "longest_stall_s": Number(0.0, 1e300),
        "moment": Choice(("reflection", "reading")),
    },
    other=Json(),
)
_PROVENANCE = Table(
    may={
        "sensor": _SENSOR,
        "start_time": Optional(Text(200)),
        "decoding": Table(may={"clock": _CLOCK}, other=Json()),
    },
    other=Json(),
)

HEADER_RULE = Table(
    keys={
        "info": _INFO,
        "first": _SAMPLES,
        "samples": _SAMPLES,
        "columns": _COLUMNS,
        "provenance": _PROVENANCE,
    },
    may={
        "originals": Rows(Table({"name": Text(), "size": Number(0, 2**48, whole=True), "sha256": _SHA256})),
        "title": Text(),
        "channel": Text(),
        "format": Text(),
        "scene": Optional(Table(other=Json())),
        "traps": Rows(
            Table({"code": Text(200), "message": Text()}, {"count": _COUNT, "line": Optional(_COUNT)}), 1_000_000
        ),
        "malformed_rows": _COUNT,
        "quantity": Choice(("", *UNITS)),
        "unit": Choice(("", *UNITS.values())),
        "implied": Json(),
    },
)
"""The header's text, its schema number aside."""
