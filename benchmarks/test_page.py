"""The benchmark of the page runs."""

from __future__ import annotations

import importlib.util
from pathlib import Path


def test_the_page_is_measured() -> None:
    """Two viewers for two seconds: samples arrive, and the page's process is found."""
    spec = importlib.util.spec_from_file_location("page_benchmark", Path(__file__).with_name("page.py"))
    assert spec is not None
    assert spec.loader is not None
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    found = page.measure(2.0, 2)
    assert 0.0 <= found["cpu"] < 1.5
    assert 0.0 <= found["p50_s"] <= found["p95_s"]
