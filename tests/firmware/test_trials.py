"""What the rangefinder must reach, whole: `SPRINGMASS_TRIALS=20 pytest -m trials tests/firmware`; bounded without."""

import os
from dataclasses import replace

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.track import UNUSABLE, Track

from .conftest import Emulate
from .test_firmware import demand_true_echoes, demand_unharmed, statuses

pytestmark = pytest.mark.trials

WHOLE = int(os.environ.get("SPRINGMASS_TRIALS", "1"))
RUNS = min(WHOLE, 20)
RANDOM_BYTES = 1_000_000 if WHOLE >= 20 else 50_000
PERIOD_S, DAMPING_PER_S, LEFT_OUT = 0.79, 0.01, np.uint8(UNUSABLE)


def test_two_minutes_at_100_hz(emulate: Emulate) -> None:
    """12,000 numbers without a gap, every echo within a tick, pings within a microsecond, T and damping within 3 u."""
    run = emulate(120.2)
    assert len(run.readings()) >= 12_000
    assert set(statuses(run)) == {"E"}
    demand_true_echoes(run)
    assert np.abs(np.diff(run.pings.up) - 160_000).max() <= 16
    assert 10 * 16 <= (run.pings.down - run.pings.up).min() <= (run.pings.down - run.pings.up).max() <= 50 * 16
    _, block = run.through_host(1)
    estimates = analyse(Track.from_arrays(block.t, block.distance)).estimates
    assert abs(estimates["period"].value - PERIOD_S) <= 3.0 * estimates["period"].u
    assert abs(estimates["damping_rate"].value - DAMPING_PER_S) <= 3.0 * estimates["damping_rate"].u


@pytest.mark.parametrize("ppm", [50.0, -50.0, 200.0, -200.0, 5000.0, -5000.0])
def test_an_error_of_the_clock_is_found(emulate: Emulate, ppm: float) -> None:
    """Within three stated uncertainties in every run of 30 s."""
    far = []
    for seed in range(RUNS):
        chain, _ = emulate(30.0, seed=seed + 1, clock_ppm=ppm).through_host(seed)
        clock = chain.report()["clock"]
        far.append((clock["rate_error_ppm"] - ppm) / clock["u_rate_error_ppm"])
        assert clock["u_rate_error_ppm"] < 20.0
    assert np.abs(far).max() <= 3.0, far


@pytest.mark.parametrize("noise", [80e-6, 300e-6])
def test_whole_wave_slips_are_found(emulate: Emulate, noise: float) -> None:
    """Of 1 % of the samples 99 in 100 are false echoes, and hardly any other.

    T is within 3 u, and within half of one of what the record gives whose slips somebody pointed out.
    """
    run = emulate(120.0, slip=0.01, noise=noise)
    _, block = run.through_host(1)
    track = Track.from_arrays(block.t, block.distance)
    found = analyse(track)
    flagged = (found.flags & LEFT_OUT) != 0
    kinds = [run.pings.kind[row[0]] for row in run.readings()]
    slipped = np.array([kind.endswith("-wave") for kind in kinds])
    assert slipped.sum() > 80
    assert (flagged & slipped).sum() >= 0.99 * slipped.sum()
    assert (flagged & ~slipped).sum() <= 0.01 * len(kinds)
    (echoes,) = (finding for finding in found.findings if finding.code == "false_echoes")
    assert echoes.values["samples"] == found.quality["false_echo"] >= 0.99 * slipped.sum()
    period = found.estimates["period"]
    assert abs(period.value - PERIOD_S) <= 3.0 * period.u
    pointed_out = replace(track, y=np.where(slipped, np.nan, track.y))
    assert abs(period.value - analyse(pointed_out).estimates["period"].value) <= 0.5 * period.u


def test_lost_late_and_ghost_echoes_are_all_coded_or_flagged(emulate: Emulate) -> None:
    """None of them is used; T stays within 3 u."""
    run = emulate(120.0, lost=0.01, late=0.01, ghost=0.01)
    demand_true_echoes(run)
    _, block = run.through_host(1)
    found = analyse(Track.from_arrays(block.t, block.distance))
    used = (found.flags & LEFT_OUT) == 0
    kinds = np.array([run.pings.kind[row[0]] for row in run.readings()])
    assert {"lost", "late", "ghost"} <= set(kinds)
    assert set(kinds[used]) == {"echo"}
    assert abs(found.estimates["period"].value - PERIOD_S) <= 3.0 * found.estimates["period"].u


def test_a_million_random_bytes_do_no_harm(emulate: Emulate) -> None:
    """The readings go on without a gap, and settings stay within their ranges."""
    seconds = 1.0 + RANDOM_BYTES * 1500 / 16e6
    demand_unharmed(emulate(seconds, random_bytes=f"0.5,{RANDOM_BYTES}"), seconds)
