"""Lines without a clock of their own get times from their arrivals, and every one of them is used."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Block, Flag, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.recordings.recording import Recording
from pipeline.analyse import analyse
from springmass import load
from springmass.loading.loaded import Loaded
from storage.run_file.writing import run_writer
from tests.adapters import NOISE_M, PERIOD_S, U_CRYSTAL, Adapter, bob_m, delivered

UNUSED = np.uint8(Flag.DUPLICATE_TIME | Flag.NON_MONOTONIC_TIME)


def decoded(adapter: Adapter, seconds: float = 20.0, seed: int = 0) -> tuple[SensorChain, Block, np.ndarray]:
    """Return the chain, the settled samples and the true times of their lines."""
    reads, true_s = delivered(adapter, seconds, seed)
    chain = SensorChain(get_family("text-lines"), options={"unit": "cm"})
    block = chain.settle(concatenate([chain.feed(host_ns, data) for host_ns, data in reads]))
    return chain, block, true_s[-len(block) :]


@pytest.mark.parametrize(
    ("adapter", "rms_s"),
    [
        (Adapter(0.002), 1e-4),
        (Adapter(0.016), 1e-4),
        (Adapter(0.016, jitter_s=0.001), 1e-4),
        (Adapter(0.016, lost=0.05), 2e-3),
        (Adapter(0.24, step_s=0.02), 1e-4),
        (Adapter(0.2, step_s=0.07), 1e-4),
        (Adapter(1e-6, jitter_s=0.001, step_s=0.0991), 1e-4),
        (Adapter(0.002, waits=True), 3e-4),
        (Adapter(0.016, lost=0.01, waits=True), 1e-3),
    ],
)
def test_the_times_of_lines_follow_from_their_arrivals(adapter: Adapter, rms_s: float) -> None:
    """But for a constant delay and the rate within its u, each line has its time, however many came together."""
    chain, block, true_s = decoded(adapter)
    slope, start = np.polyfit(true_s, block.t, 1)
    assert np.std(block.t - slope * true_s - start) < rms_s
    info = chain.info("port")
    assert info.u_rate is not None
    assert abs(slope - 1.0) < 4.0 * np.hypot(info.u_rate, 2.0 * U_CRYSTAL)
    assert not (block.flags & UNUSED).any()
    assert np.all(np.diff(block.t) > 0.0)


def test_the_noise_behind_an_adapter_is_that_of_the_sensor() -> None:
    """With 5 % of the lines lost, noise is found within 10 %, the period within 4 u, and 99 % are used."""
    chain, block, _ = decoded(Adapter(0.016, lost=0.05), 30.0, 3)
    run = analyse(Loaded(Recording("wire", "", chain.info("port"), "", block), "wire").track)
    assert run.estimates["noise"].value == pytest.approx(NOISE_M, rel=0.1)
    assert abs(run.estimates["period"].value - PERIOD_S) < 4.0 * run.estimates["period"].u
    assert np.mean((run.flags & ~np.uint8(Flag.GAP_BEFORE)) == 0) > 0.99


@pytest.mark.parametrize(("adapter", "seed"), [(Adapter(0.24, 0.01, 0.003, True), 17), (Adapter(0.24, 0.01), 13)])
def test_a_part_between_wrong_places_of_lost_lines_has_a_larger_uncertainty(adapter: Adapter, seed: int) -> None:
    """The times run off by a step until the next lost line: the part that the analysis chooses is within 3 u."""
    chain, block, _ = decoded(adapter, 30.0, seed)
    run = analyse(Loaded(Recording("wire", "", chain.info("port"), "", block), "wire").track)
    period = run.estimates["period"]
    assert "phase_jump" in {finding.code for finding in run.findings}
    assert abs(period.value - PERIOD_S) < 3.0 * period.u


def test_lines_at_no_even_rate_are_spread_between_their_reads() -> None:
    """Where the rate wanders, no line is later than its arrival, all are used, and the rate has an uncertainty."""
    chain, block, _ = decoded(Adapter(0.24, wandering=0.3))
    assert block.host_ns is not None
    late_s = (block.host_ns - block.host_ns[0]) * 1e-9 - block.t
    assert np.all(np.diff(block.t) > 0.0)
    assert np.ptp(late_s) < 0.5
    assert (chain.info("port").u_rate or 0.0) > 1e-4
    assert chain.report()["clock"]["lines"]["steps"] == "reads"


def test_a_run_file_of_an_earlier_version_gets_the_better_times(tmp_path: Path) -> None:
    """Its samples that came in one read, which it flags as duplicates, are all used when it is loaded."""
    chain, settled, _ = decoded(Adapter(0.016))
    assert settled.host_ns is not None
    t = (settled.host_ns - settled.host_ns[0]) * 1e-9
    flags = np.where(np.diff(t, prepend=-1.0) == 0.0, np.uint8(Flag.DUPLICATE_TIME), np.uint8(0))
    with run_writer(tmp_path / "old.h5") as writer:
        writer.append(Block(0, t, settled.distance, flags, settled.host_ns))
        info = SensorChain(get_family("text-lines"), rate_hz=100.0).info("port")
        provenance = {"sensor": {"family": "text-lines"}, "decoding": {"clock": {"kind": "host"}}}
        writer.finish(info=info, title="", traps=(), malformed_rows=0, format="wire", scene=None, provenance=provenance)
    run = load(tmp_path / "old.h5")
    np.testing.assert_allclose(run.loaded.samples.t, settled.t, atol=1e-9)
    assert not run.loaded.samples.flags.any()
    assert run.loaded.info.u_rate == chain.info("port").u_rate


@pytest.mark.parametrize("seed", range(4))
def test_stamps_of_arrival_in_a_file_give_a_rate_with_its_uncertainty(tmp_path: Path, seed: int) -> None:
    """Bursts of twelve that come 20 ms late on average leave a rate that is known to about 100 ppm, and u says so."""
    rng = np.random.default_rng(seed)
    t = np.arange(1500) / 50.0
    last = np.minimum(np.arange(t.size) // 12 * 12 + 11, t.size - 1)
    late_s = rng.exponential(0.02, t.size // 12 + 1)[np.arange(t.size) // 12]
    stamps = np.maximum.accumulate(t[last] + late_s) + 1e-4 * (np.arange(t.size) % 12)
    rows = "".join(f"{stamp:.4f},{100 * x:.2f}\n" for stamp, x in zip(stamps, bob_m(t), strict=True))
    (tmp_path / "bursts.csv").write_text(f"Time (s),Distance (cm)\n{rows}")
    info = load(tmp_path / "bursts.csv").loaded.info
    assert info.u_rate is not None
    assert abs(info.rate_hz / 50.0 - 1.0) < 4.0 * info.u_rate
    assert info.u_rate < 3e-4
