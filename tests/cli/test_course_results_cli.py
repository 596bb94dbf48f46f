"""A course's results compared: one spring, one drag coefficient for each disc."""

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from springmass.cli import main
from springmass.course.results_csv import write_results
from tests.courses import faulty_course, rows_of, write_recording

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


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of a course with planted faults."""
    top = tmp_path_factory.mktemp("faulty")
    assert main(["batch", *faulty_course(top), "-o", str(top / "out"), "--reports", "0"]) == 1
    return top / "out"


def test_the_drag_of_the_disc_stands_beside_the_damping(course):
    """A prediction by diameter and air is the same for both discs, and of the size of what was measured."""
    rows = rows_of(course / "results.csv")
    predicted = {disc: [float(row["disc_damping_rate"]) for row in rows if row["disc"] == disc] for disc in DRAG}
    assert predicted["thin"] == pytest.approx(predicted["thick"], rel=0.05)
    assert all(0.3 < float(row["damping_rate"]) / float(row["disc_damping_rate"]) < 3.0 for row in rows)
    page = (course / "index.html").read_text(encoding="utf-8")
    assert all(f">{float(row['disc_damping_rate']):.2g}</td>" in page for row in rows)


def test_planted_faults_are_named_and_the_mean_is_of_the_others(faulty, cli):
    """Exchanged masses are named as pairs, within a bench and between two; a mass in grams by itself."""
    compared = json.loads(cli("compare", faulty, "--json").out)
    said = {one["name"]: one["message"] for one in compared["suspects"]}
    assert said.keys() == {"A1", "A3", "B2", "C3", "D2"}
    assert said["A1"] == said["A3"]
    assert "A1 and A3 exchanged" in said["A1"]
    assert "B2 and C3 exchanged" in said["B2"]
    assert "200 kg or 200 g?" in said["D2"]
    (spring,) = compared["agreements"]
    assert spring["mean"]["value"] == pytest.approx(14.0, rel=1e-3)
    assert compared["disagreements"] == []
    assert cli("compare", faulty, "--strict").code == 5


def test_every_group_is_told_of_its_faults(faulty):
    """One paragraph a group; the page has a row a file, those with faults before the others and in the same words."""
    paragraphs = {text[6]: text for text in (faulty / "groups.txt").read_text().split("\n\n")}
    assert list(paragraphs) == list("ABCDEF")
    for run in ("A1", "A3", "B2", "C3", "D2", "E1", "E3", "F2", "F4"):
        assert re.search(rf"^  .*\b{run}\b.*: ", paragraphs[run[0]], re.MULTILINE)
    for run in ("A2", "B1", "C1", "D1", "E2", "F1"):
        assert run not in paragraphs[run[0]]
    page = (faulty / "index.html").read_text()
    looks = re.findall(r'<tr class="(\w+)">.*?<th[^>]*>(\w+)<', page)
    assert len(looks) == 24
    assert {run for look, run in looks if look != "fine"} == {"A1", "A3", "B2", "C3", "D2", "E1", "E3", "F2", "F4"}
    assert [look for look, _ in looks[9:]] == ["fine"] * 15
    assert "A1 and A3 exchanged" in page


def bench_rows(spread: float, exchanged: tuple[str, str], *, runs_of_bench: int) -> list[dict[str, object]]:
    """Return results of twelve benches, each with its own spring, bare and with a disc, and one exchange of files."""
    rng, rows = np.random.default_rng(5), dict[str, dict[str, object]]()
    for bench in range(12):
        k, bare_kg = 14.0 * (1.0 + spread * rng.standard_normal()), rng.uniform(0.18, 0.225)
        for disc_kg in (0.0, 0.0169)[-runs_of_bench:]:
            mass = bare_kg + disc_kg
            omega = math.sqrt(k / (mass + SPRING_KG / 3.0)) * (1.0 + 2e-5 * rng.standard_normal())
            name = f"G{bench}_{'disc' if disc_kg else 'bare'}"
            numbers = {"natural_angular_frequency": omega, "own_mass_kg": mass, "spring_mass_kg": SPRING_KG}
            rows[name] = {"run": name, "path": f"{name}.txt", "status": "ok", "unit": "m", "clock": "device",
                          "u_clock": 2.9e-5, "group": f"{bench:02d}", **numbers}  # fmt: skip
    one, other = (rows[name] for name in exchanged)
    key = "natural_angular_frequency"
    one[key], other[key] = other[key], one[key]
    for row in rows.values():
        mass, omega = float(str(row["own_mass_kg"])), float(str(row[key]))
        row["spring_constant"] = omega**2 * (mass + SPRING_KG / 3.0)
        row |= {"own_mass_kg_u": 5e-5, f"{key}_u": 2e-5 * omega, "spring_mass_kg_u": 1e-4, "spring_constant_u": 0.01}
    return list(rows.values())


def suspects_of(cli, folder: Path, rows: list[dict[str, object]]) -> dict[str, str]:
    """Compare rows as the results of a course; return what is said about each suspect, which no mean includes."""
    folder.mkdir()
    write_results(folder, rows, ["group"])
    compared = json.loads(cli("compare", folder, "--json").out)
    assert compared["disagreements"] == []
    assert compared["agreements"][0]["runs"] == len(rows) - len(compared["suspects"])
    return {one["name"]: one["message"] for one in compared["suspects"]}


@pytest.mark.parametrize("spread", [0.0, 0.006, 0.02])
def test_exchanged_files_are_named_by_the_other_runs_of_their_benches(spread, tmp_path, cli):
    """However much the springs of a box differ, both files of an exchange are named, and no other run."""
    names = ("G5_disc", "G6_disc")
    said = suspects_of(cli, tmp_path / "two", bench_rows(spread, names, runs_of_bench=2))
    assert said.keys() == {*names}
    assert all("G5_disc and G6_disc exchanged" in message for message in said.values())
    # With one run a bench, springs that differ hide or question the exchange, but nothing else is said to be one.
    said = suspects_of(cli, tmp_path / "one", bench_rows(spread, names, runs_of_bench=1))
    assert said.keys() <= {*names}
    if spread == 0.0:
        assert all("G5_disc and G6_disc exchanged" in message for message in said.values())
