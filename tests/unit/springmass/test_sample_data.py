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
