"""The page makes the report of what it shows, and serves it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.pages.bench import LIMIT_S, Client

T = np.arange(1000) / 100
LEFT, RIGHT = 20 + 5 * np.cos(8.0 * T), 30 + 4 * np.cos(9.0 * T)


def test_the_report_of_a_text_is_made_as_the_page_reads_it(start: Callable[..., Any], tmp_path: Path) -> None:
    """A file that leaves its unit and its channel open is reported with the answers that the page was given."""
    path = tmp_path / "bob.csv"
    rows = "".join(f"{t:.2f},{left:.4f},{right:.4f}\n" for t, left, right in zip(T, LEFT, RIGHT, strict=True))
    path.write_text(f"time (s),left,right\n{rows}")
    client = Client(start("page", "--play", str(path), "--read", "channel=right", "--read", "unit=cm").address)
    with client.socket() as run:
        run.send('{"type": "report"}')
        while (bench := bench_of(run.recv(timeout=LIMIT_S))).get("report") != "ready":
            assert not bench.get("failed")
    assert client.get("/v2/report").status == 200
    (written,) = tmp_path.glob("*.results/results.json")
    assert json.loads(written.read_text())["input"]["channel"] == "right"


def bench_of(message: str | bytes) -> dict[str, Any]:
    """Return the state of the run's actions in a message; empty if it has none."""
    found = json.loads(message) if isinstance(message, str) else {}
    return dict(found.get("bench", {}))
