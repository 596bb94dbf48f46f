"""A course's results compared: one spring, one drag coefficient for each disc."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from springmass.cli import main
from tests.courses import write_recording

K, SPRING_KG, DIAMETER_M, RHO = 14.0, 0.010, 0.102, 1.199  # N/m, kg, m, kg/m3
DRAG = {"thin": 5.0, "thick": 3.0}
BOBS_KG = (0.180, 0.195, 0.210, 0.225)


def simulate(bob_kg: float, drag: float, seed: int) -> np.ndarray:
    """Return distances of a bob with quadratic drag alone, A0/(1 + beta A0 t), in closed form."""
    rng, t = np.random.default_rng(seed), np.arange(4000) / 100.0
    mass = bob_kg + SPRING_KG / 3.0 + RHO * DIAMETER_M**3 / 3.0
    omega = math.sqrt(K / mass)
    beta = drag * 2.0 * omega * RHO * math.pi * DIAMETER_M**2 / 4.0 / (3.0 * math.pi * mass)
    return 0.25 + 0.05 / (1.0 + beta * 0.05 * t) * np.cos(omega * t + seed) + 1e-4 * rng.standard_normal(t.size)


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of eight runs of one spring with two discs, at two benches."""
    top = tmp_path_factory.mktemp("course")
    (top / "runs").mkdir()
    rows = []
    for i, (disc, bob_kg) in enumerate((disc, bob_kg) for disc in DRAG for bob_kg in BOBS_KG):
        write_recording(top / "runs" / f"run{i}.txt", simulate(bob_kg, DRAG[disc], i))
        rows.append(
            {"path": f"runs/run{i}.txt", "bob_mass_kg": bob_kg, "bob_mass_kg_u": 5e-5, "spring_mass_kg": SPRING_KG,
             "disc_diameter_m": DIAMETER_M, "air_temperature_c": 20.0, "section": "AB"[i % 2], "disc": disc}
        )  # fmt: skip
    with (top / "runs.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    options = ["--runs", str(top / "runs.csv"), "-o", str(top / "out"), "--jobs", "1", "--reports", "0"]
    assert main(["batch", str(top / "runs"), *options, "--accuracy", "fast"]) == 0
    return top / "out"


def test_a_course_is_compared_by_spring_and_disc(course, cli):
    """One spring constant of all runs, one drag coefficient a disc, scatter within and between benches."""
    done = cli("compare", course, "--json")
    compared = json.loads(done.out)
    found = {(one["quantity"], one["group"]): one for one in compared["agreements"]}
    (spring,) = (one for (quantity, _), one in found.items() if quantity == "spring_constant")
    assert spring["runs"] == 8
    assert spring["benches"] == 2
    assert spring["mean"]["value"] == pytest.approx(K, abs=3.0 * spring["mean"]["u"] + 1e-3 * K)
    for disc, drag in DRAG.items():
        assert found["drag_coefficient", disc]["runs"] == 4
        assert found["drag_coefficient", disc]["mean"]["value"] == pytest.approx(drag, rel=0.03)
    assert compared["suspects"] == []
