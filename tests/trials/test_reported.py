"""Mistakes planted in what is printed about simulated benches, and benches about which all is right.

One bench is always taken, and all twenty by ``pytest -m "trials or not trials" tests/trials/test_reported.py``.
"""

import math
from pathlib import Path

import numpy as np
import pytest

import springmass as sm
from springmass.result.table1 import results_csv
from tests.reported import FLOW, Recorded, Row, periodic_rows, record, write_table
from tests.synthetic import Truth

BENCHES = [seed if seed < 1 else pytest.param(seed, marks=pytest.mark.trials) for seed in range(20)]
PLANTED = {
    "reported_exchanged",
    "reported_power_of_ten",
    "reported_u_too_small",
    "reported_not_noise",
    "reported_false_echoes",
    "reported_not_exponential",
}


def bench(folder: Path, seed: int) -> tuple[Recorded, Recorded, list[sm.Run], float]:
    """Return both runs as recorded and as loaded, and the diameter of the disc."""
    rng = np.random.default_rng([64, seed])
    k, spring_kg, bare_kg = rng.uniform(8.0, 30.0), rng.uniform(0.004, 0.015), rng.uniform(0.12, 0.3)
    disc_kg, diameter_m = bare_kg * rng.uniform(1.06, 1.2), rng.uniform(0.08, 0.14)
    noise_m, weighed = rng.uniform(0.8e-4, 3e-4), seed % 2 == 0
    recorded, loaded = [], []
    for name, mass_kg, seconds, gamma, beta, echoes in (
        ("bare", bare_kg, rng.uniform(10, 20), rng.uniform(1e-3, 3e-3), 0.0, 0),
        ("disc", disc_kg, rng.uniform(60, 90), rng.uniform(4e-3, 1e-2), rng.uniform(0.15, 0.4), rng.integers(15, 60)),
    ):
        truth = Truth(
            amplitude=rng.uniform(0.035, 0.06),
            omega=math.sqrt(k / (mass_kg + spring_kg / 3)),
            phase=rng.uniform(-3, 3),
            gamma=gamma,
            beta=beta,
        )
        one = record(folder, name, truth, mass_kg, seconds, noise_m=noise_m, echoes=int(echoes), seed=seed)
        scene = {
            "bob": {"mass_kg": {"value": mass_kg, "u": 5e-5}},
            "spring": {"mass_kg": {"value": spring_kg, "u": 2e-4}} if weighed else {},
            "disc": {"diameter_m": {"value": diameter_m, "u": 5e-4}},
            "air": {"temperature_c": 20.0},
        }
        # Every other bench has the velocities of the file; from the others only the distances are at hand.
        recorded.append(one)
        loaded.append(sm.load(one.position, scene, velocity=one.velocity if seed % 3 else None).named(name))
    return recorded[0], recorded[1], loaded, diameter_m


def planted(bare: Recorded, disc: Recorded, diameter_m: float, seed: int) -> list[Row]:
    """Return what somebody prints who makes all six mistakes."""
    rng = np.random.default_rng([65, seed])
    seven = [7 * one.truth.period + rng.normal(0, 0.01) for one in (disc, bare)]  # of the wrong run
    power = int(rng.choice([-3, -2, -1, 1, 2, 3]))
    t = np.arange(0.0, 60.0, 1.0)
    rate = -np.polyfit(t, np.log(disc.truth.amplitude_at(t)), 1)[0]
    rms = math.sqrt(np.mean(disc.v_file**2))
    return [
        *periodic_rows("bare", seven[0], bare.mass_kg),
        *periodic_rows("disc", seven[1], disc.mass_kg, right_u=False),
        ("bare", "A", f"{100 * bare.truth.amplitude * 10.0**power:.4g}", f"{0.17 * 10.0**power:.2g}", "cm"),
        ("disc", "sensor_error", 0.00239, "", "m"),
        ("disc", "damping_rate", f"{rate:.5f}", 1e-5, "1/s"),
        ("disc", "Re", f"{FLOW * rms * diameter_m:.0f}", f"{0.02 * FLOW * rms * diameter_m:.0f}", ""),
    ]


def right(bare: Recorded, disc: Recorded, runs: list[sm.Run], diameter_m: float, seed: int) -> list[Row]:
    """Return what somebody prints who reads seven cycles off a graph and propagates every uncertainty."""
    rng = np.random.default_rng([66, seed])
    rms = math.sqrt(np.mean(disc.v_true**2))
    rate = runs[1]["damping_rate"]
    rows: list[Row] = []
    for name, one in (("bare", bare), ("disc", disc)):
        rows += periodic_rows(name, 7 * one.truth.period + rng.normal(0, 0.01), one.mass_kg)
        rows.append((name, "A", f"{100 * one.truth.amplitude + rng.normal(0, 0.1):.2f}", 0.17, "cm"))
        rows.append((name, "sensor_error", f"{1e3 * runs[0]['noise'].value * rng.uniform(0.7, 1.4):.2g}", "", "mm"))
    return [
        *rows,
        ("disc", "damping_rate", f"{rate.value:.5f}", f"{rate.u:.1g}", "1/s"),
        ("disc", "v_rms", f"{rms:.3f}", f"{0.01 * rms:.3f}", "m/s"),
        ("disc", "Re", f"{FLOW * rms * diameter_m:.0f}", f"{0.02 * FLOW * rms * diameter_m:.0f}", ""),
    ]


@pytest.mark.parametrize("seed", BENCHES)
def test_planted_mistakes_are_found_and_no_others(seed: int, tmp_path: Path) -> None:
    """Six of six in a table with all of them; none in one that is right, nor in the program's own results."""
    bare, disc, runs, diameter_m = bench(tmp_path, seed)
    found = sm.compare(runs, reported=write_table(tmp_path / "wrong.csv", planted(bare, disc, diameter_m, seed)))
    codes = {finding.code for finding in found.findings if finding.code.startswith("reported_")}
    assert codes == PLANTED
    own = tmp_path / "results.csv"
    own.write_text(results_csv([run.name for run in runs], [run.analysis for run in runs]), encoding="utf-8")
    clean = write_table(tmp_path / "right.csv", right(bare, disc, runs, diameter_m, seed))
    for table in (clean, own):
        said = [f.message for f in sm.compare(runs, reported=table).findings if f.code.startswith("reported_")]
        assert said == []
