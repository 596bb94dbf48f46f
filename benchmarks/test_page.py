"""The benchmark of the page runs."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest


@pytest.mark.trials
def test_the_page_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two viewers for two seconds: samples arrive, a suspended one gets them later, and the page's process is found."""
    spec = importlib.util.spec_from_file_location("page_benchmark", Path(__file__).with_name("page.py"))
    assert spec is not None
    assert spec.loader is not None
    page = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, page)  # its dataclasses look for their module
    spec.loader.exec_module(page)
    found = page.measure(2.0, 2, 1.0)
    assert 0.0 <= found["cpu"] < 1.5
    assert 0.0 <= found["p50_s"] <= found["p95_s"]
    assert 0.0 <= found["serving"] < 1.5
    assert found["current_s"] > 0.0
    assert 0.0 <= page.floor(1.0) < 1.5
