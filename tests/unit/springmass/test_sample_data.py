"""The simulated recordings: reproducible, in the form of MotionSensor.vi, and true to their truth files."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sample_data import generate

FOLDER = Path(__file__).resolve().parents[3] / "sample_data"
NAMES = ("undamped", "damped", "clipped", "cropped", "sixty_hz")
PAIRED = ("undamped", "damped")
POSITION_ROW = re.compile(rb"\d+\.\d{3}\t\d+\.\d{3}\t0\.239")
VELOCITY_ROW = re.compile(rb"\d+\.\d{3}\t-?\d+\.\d{3}")
PRINTED_CM = 0.0005 + 1e-9
IMPORTED = re.compile(r"^(?:from|import) (\w+)", re.MULTILINE)


def truth_of(name: str) -> dict[str, Any]:
    """Return a run's truth file."""
    content: dict[str, Any] = json.loads((FOLDER / f"{name}_simulated.truth.json").read_text("ascii"))
    return content


def value_of(truth: dict[str, Any], name: str) -> float:
    """Return one quantity of a truth, in its stated unit."""
    return float(truth["truth"][name]["value"])


def lines_of(name: str, quantity: str) -> list[bytes]:
    """Return a file's lines, split at CRLF only."""
    return (FOLDER / f"{name}_simulated_{quantity}.txt").read_bytes().split(b"\r\n")


def rows_of(name: str, quantity: str) -> list[bytes]:
    """Return a file's data rows."""
    return lines_of(name, quantity)[0 if name == "cropped" else 2 :]


def columns_of(name: str, quantity: str) -> np.ndarray:
    """Return a file's numbers, (rows, columns)."""
    return np.array([[float(cell) for cell in row.split(b"\t")] for row in rows_of(name, quantity)])


def since_first(truth: dict[str, Any]) -> np.ndarray:
    """Return the time since the first sample, (samples,), s."""
    elapsed: np.ndarray = np.arange(truth["samples"]) / truth["rate_hz"]
    return elapsed


def model_cm(truth: dict[str, Any]) -> np.ndarray:
    """Return the truth's noiseless distance, cm, the amplitude law integrated step by step."""
    t = since_first(truth)
    amplitude = np.empty(len(t))
    amplitude[0] = value_of(truth, "amplitude")
    gamma, beta, step = value_of(truth, "gamma"), value_of(truth, "beta"), 1 / truth["rate_hz"]
    for i in range(1, len(t)):
        a = amplitude[i - 1]
        middle = a - step / 2 * (gamma * a + beta * a * a)
        amplitude[i] = a - step * (gamma * middle + beta * middle * middle)
    angle = value_of(truth, "angular_frequency") * t + value_of(truth, "phase")
    distance: np.ndarray = 100 * (value_of(truth, "offset") + amplitude * np.cos(angle))
    return distance


def test_check_names_the_files_that_differ(tmp_path: Path, capsys: Any) -> None:
    """``--check`` exits with 1 and names, one line each, a file that lost a byte and one that is gone."""
    assert generate.main([str(tmp_path / "new")]) == 0
    changed, gone = (
        tmp_path / "new" / "undamped_simulated_position.txt",
        tmp_path / "new" / "damped.scene.toml",
    )
    changed.write_bytes(changed.read_bytes()[:-1])
    gone.unlink()
    assert generate.main(["--check", str(tmp_path / "new")]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert any(str(changed) in line for line in lines)
    assert any(str(gone) in line for line in lines)


def test_files_regenerate_byte_for_byte() -> None:
    """Every file is made again byte for byte, and nothing simulated lies there that is not made."""
    made = generate.every_file()
    assert {name: (FOLDER / name).read_bytes() for name in made} == made
    kept = {path.name for pattern in ("*.txt", "*.json", "*.toml") for path in FOLDER.glob(pattern)}
    assert kept == set(made)


def test_generator_shares_no_code_with_the_project() -> None:
    """The generator imports the standard library and numpy only."""
    source = (FOLDER / "generate.py").read_text("utf-8")
    imported = set(IMPORTED.findall(source))
    assert imported <= {*sys.stdlib_module_names, "numpy"}


def test_no_reading_hangs_on_a_last_bit() -> None:
    """No unrounded reading is within 1e-7 tick of a half, where another platform's cosine could tip it."""
    for run in generate.RUNS:
        exact = generate.measure(run).exact_ticks
        assert np.abs(exact - np.floor(exact) - 0.5).min() > 1e-7


@pytest.mark.parametrize("name", NAMES)
def test_position_file_has_the_instruments_form(name: str) -> None:
    """Position rows are TAB-separated, three decimals, constant error; CRLF, none after the last row."""
    lines = lines_of(name, "position")
    if name != "cropped":
        assert lines[0].startswith(b"Motion Sensor Data File ")
        assert lines[1] == b"Time (s)\tDistance (cm)\tDist Error (cm)"
    rows = rows_of(name, "position")
    assert len(rows) == truth_of(name)["samples"]
    assert all(POSITION_ROW.fullmatch(row) for row in rows)


@pytest.mark.parametrize("name", PAIRED)
def test_velocity_file_has_the_instruments_form(name: str) -> None:
    """Velocity rows are two columns with three decimals, first ``NaN``; no CRLF after the last row."""
    lines = lines_of(name, "velocity")
    assert lines[0] == lines_of(name, "position")[0]
    assert lines[1] == b"Time (s)\tVelocity (cm/s)"
    assert lines[2] == b"0.000\tNaN"
    assert len(lines) - 2 == truth_of(name)["velocity_samples"]
    assert all(VELOCITY_ROW.fullmatch(row) for row in lines[3:])


@pytest.mark.parametrize("name", NAMES)
def test_times_are_nominal(name: str) -> None:
    """Times are i / rate, rounded to a millisecond, from the truth's first time on."""
    truth = truth_of(name)
    expected = truth["t_first_s"] + since_first(truth)
    assert columns_of(name, "position")[:, 0] == pytest.approx(expected, abs=PRINTED_CM)


@pytest.mark.parametrize("name", NAMES)
def test_distances_lie_on_the_tick_lattice(name: str) -> None:
    """Every printed distance is a whole number of the truth's quantum, within the printed digits."""
    distance_cm = columns_of(name, "position")[:, 1]
    quantum_cm = 100 * value_of(truth_of(name), "quantum")
    assert np.abs(distance_cm - quantum_cm * np.rint(distance_cm / quantum_cm)).max() <= PRINTED_CM


@pytest.mark.parametrize("name", PAIRED)
def test_velocity_is_the_backward_difference(name: str) -> None:
    """Velocity is the backward difference of the distance, up to the distance's printed digits."""
    distance, velocity = columns_of(name, "position")[:, 1], columns_of(name, "velocity")[:, 1]
    difference = np.diff(distance) * truth_of(name)["rate_hz"]
    assert np.abs(velocity[1 : len(distance)] - difference).max() <= 0.1 + 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_truth_is_consistent(name: str) -> None:
    """k is omega squared times bob + spring / 3 + added mass, 14 N/m in every run; f and T follow omega."""
    truth = truth_of(name)
    scene, omega = truth["scene"], value_of(truth, "angular_frequency")
    radius_m = scene.get("disc", {"diameter_m": {"value": 0.0}})["diameter_m"]["value"] / 2
    added = 8 / 3 * value_of(truth, "air_density") * radius_m**3
    mass = scene["bob"]["mass_kg"]["value"] + scene["spring"]["mass_kg"]["value"] / 3 + added
    assert value_of(truth, "effective_mass") == pytest.approx(mass, rel=1e-12)
    assert value_of(truth, "spring_constant") == 14.0
    assert omega**2 * mass == pytest.approx(14.0, rel=1e-12)
    assert value_of(truth, "frequency") == pytest.approx(omega / (2 * math.pi), rel=1e-12)
    assert value_of(truth, "period") == pytest.approx(2 * math.pi / omega, rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_readings_follow_the_motion_of_the_truth(name: str) -> None:
    """Off the listed rows the readings differ from the truth's motion by its noise and rounding to ticks."""
    truth = truth_of(name)
    residual_mm = 10 * (columns_of(name, "position")[:, 1] - model_cm(truth))
    core = np.ones(truth["samples"], dtype=bool)
    core[[*truth["false_echo_rows"], *truth["clipped_rows"], *truth["heavy_tail_rows"]]] = False
    expected_mm = 1e3 * value_of(truth, "noise")
    assert abs(residual_mm[core].mean()) < 4 * expected_mm / math.sqrt(core.sum())
    assert residual_mm[core].std() == pytest.approx(expected_mm, rel=4 / math.sqrt(2 * core.sum()))


@pytest.mark.parametrize("name", NAMES)
def test_false_echoes_are_clusters_near_the_near_turning_point(name: str) -> None:
    """False echoes come near the smallest distance, some millimetres too far, in the share that is stated."""
    truth = truth_of(name)
    rows = np.array(truth["false_echo_rows"], dtype=int)
    share = {"undamped": 0.01, "damped": 0.05, "clipped": 0.0, "cropped": 0.01, "sixty_hz": 0.01}[name]
    assert len(rows) == truth["counts"]["false_echo"] == round(share * truth["samples"])
    angle = value_of(truth, "angular_frequency") * rows / truth["rate_hz"] + value_of(truth, "phase")
    assert np.all(np.cos(angle) < -0.4)
    shift_mm = 10 * (columns_of(name, "position")[:, 1] - model_cm(truth))[rows]
    assert np.all((shift_mm > 0.5) & (shift_mm < 9.0))


def test_clipped_run_is_clipped_at_the_far_end() -> None:
    """A quarter to 30 % of the clipped run reads the limit, within noise, where the bob is beyond it."""
    truth = truth_of("clipped")
    rows, limit_cm = np.array(truth["clipped_rows"]), 100 * truth["clip_limit_m"]
    assert 0.25 <= len(rows) / truth["samples"] <= 0.30
    assert np.array_equal(rows, np.flatnonzero(model_cm(truth) > limit_cm))
    plateau_mm = 10 * (columns_of("clipped", "position")[rows, 1] - limit_cm)
    assert np.median(np.abs(plateau_mm)) < 0.08
    assert np.abs(plateau_mm).max() < 6 * 0.32
