"""The ports benchmark as a test: with timing off, every design still must receive every sample."""

from __future__ import annotations

import importlib.util
import sys
from functools import partial
from pathlib import Path
from types import ModuleType

import pytest

from storage.wire_log.appending import Kind, read_log

PORTS = Path(__file__).with_name("ports.py")


@pytest.fixture(scope="module")
def ports() -> ModuleType:
    """Return the benchmark as a module."""
    spec = importlib.util.spec_from_file_location("springmass_benchmark_ports", PORTS)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("design", ["one thread", "pyserial's ReaderThread", "lean threads"])
@pytest.mark.parametrize("decode", [True, False])
def test_every_sample_is_received(ports: ModuleType, design: str, decode: bool) -> None:
    """Four ports at 100 Hz for 0.3 s deliver what was sent."""
    figures = ports.measure(ports.DESIGNS[design], ports=4, rate_hz=100.0, seconds=0.3, decode=decode)
    assert figures.received == figures.expected == 120
    assert figures.line(design)


def test_one_kilohertz_on_one_port(ports: ModuleType) -> None:
    """A port at 1 kHz delivers what was sent."""
    figures = ports.measure(ports.OneThread, ports=1, rate_hz=1000.0, seconds=0.3, decode=True)
    assert figures.received == 300


@pytest.mark.parametrize("design", ["OneThread", "LeanThreads"])
def test_every_sample_is_recorded(ports: ModuleType, design: str, tmp_path: Path) -> None:
    """Disturbances a wire log the samples are the same, and the log holds every byte of them."""
    log = tmp_path / "run.wire"
    recorded = partial(getattr(ports, design), log=log)
    figures = ports.measure(recorded, ports=4, rate_hz=100.0, seconds=0.3, decode=True, look_s=0.3)
    assert figures.received == figures.expected == 120
    data = b"".join(record.payload for record in read_log(log) if record.kind is Kind.DATA)
    assert data.count(b"\n") == 120
