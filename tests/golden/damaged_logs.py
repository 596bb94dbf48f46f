"""Two hundred damaged copies of one wire log, and what `springmass recover` of 0.2.0 gets out of each.

Compared are the exit code, the number of samples, and the SHA-256 of times, distances and flags.
"""

from __future__ import annotations

import hashlib
import json
import random
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import h5py

from tests.golden.golden import HERE, run


def names() -> list[str]:
    """Return the names of the logs."""
    return list(_before())


def difference(name: str) -> str:
    """Return a line that says what changed about a log; empty if nothing did."""
    now, before = _outcome(int(name[3:6])), _before()[name]
    return "" if now == before else f"{name}: {before} -> {now}"


@cache
def _before() -> dict[str, list[Any]]:
    return dict(json.loads((HERE / "damaged_logs.json").read_text("utf-8")))


def _damaged(data: bytes, seed: int) -> bytes:
    """Flip bits, cut, zero, repeat or truncate, in up to four places."""
    draw, spoiled = random.Random(seed), bytearray(data)
    kind = seed % 5
    for _ in range(1 + seed // 5 % 4):
        at, count = draw.randrange(len(spoiled)), draw.choice((1, 7, 64, 700, 5000))
        if kind == 0:
            spoiled[at] ^= 1 << draw.randrange(8)
        elif kind == 1:
            del spoiled[at : at + count]
        elif kind == 2:
            spoiled[at : at + count] = bytes(min(count, len(spoiled) - at))
        elif kind == 3:
            spoiled[at:at] = spoiled[at : at + count]
        else:
            del spoiled[max(at, len(spoiled) // 8) :]
    return bytes(spoiled)


def _outcome(seed: int) -> list[Any]:
    with tempfile.TemporaryDirectory() as folder:
        log, out = Path(folder) / f"log{seed:03}.wire", Path(folder) / "out.h5"
        log.write_bytes(_damaged((HERE / "base.wire").read_bytes(), seed))
        code, _, _ = run(["recover", str(log), "-o", str(out)])
        if not out.exists():
            return [code, 0, ""]
        with h5py.File(out) as file:
            t, y, flags = (file[f"/entry/signal/{name}"][()] for name in ("time", "distance", "quality"))
    data = t.astype("<f8").tobytes() + y.astype("<f8").tobytes() + flags.astype("u1").tobytes()
    return [code, t.size, hashlib.sha256(data).hexdigest()]
