"""``springmass compare`` from the outside: what it says of runs of one spring, and what it refuses."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springmass.cli import main
from springmass.runs.loading import sample_data

DATA = sample_data()
BARE, DISC = (str(DATA / f"{name}_simulated_position.txt") for name in ("undamped", "damped"))
BARE_SCENE, DISC_SCENE = (str(DATA / f"{name}.scene.toml") for name in ("undamped", "damped"))
FAST = ("--accuracy", "fast")
RIGHT = [BARE, DISC, "--scene", BARE_SCENE, "--scene", DISC_SCENE]
EXCHANGED = [BARE, DISC, "--scene", DISC_SCENE, "--scene", BARE_SCENE]


def compared(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 0) -> dict[str, Any]:
    """Return the JSON object of a comparison; nothing but it stands on stdout."""
    assert main(["compare", *arguments, "--json"]) == code
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1
    return dict(json.loads(lines[0]))


def written_run(
    path: Path,
    *,
    omega: float,
    amplitude_m: float = 0.05,
    gamma: float = 0.006,
    beta: float = 0.2,
    seconds: float = 60.0,
    seed: int = 1,
) -> str:
    """Write a MotionSensor.vi position file of a damped oscillation by its closed form; return its name."""
    t = np.arange(round(100 * seconds)) / 100
    decay = np.exp(-gamma * t)
    envelope = amplitude_m * decay / (1 + beta * amplitude_m * (1 - decay) / gamma)
    y = 0.22 + envelope * np.cos(omega * t) + 1e-4 * np.random.default_rng(seed).standard_normal(t.size)
    rows = "".join(f"{a:.3f}\t{100 * b:.3f}\t0.239\r\n" for a, b in zip(t, y, strict=True))
    path.write_text(f"Motion Sensor Data File\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n{rows}", "utf-8")
    return str(path)


def test_the_reports_exchange_is_found_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    """With the two scenes exchanged the constants part as 14.0 and 16.3 N/m did, and the exchange is named."""
    result = compared(EXCHANGED, capsys)
    found = result["comparison"]
    low, high = sorted(each["spring_constant"]["value"] for each in found["each"])
    # (0.2214 / 0.2040)^2 between the two, as 16.3 / 14.0 between the report's.
    assert high / low == pytest.approx(16.311 / 13.979, abs=0.02)
    assert found["agree"] is False
    assert found["spring_constant"] is None
    assert found["exchanged"] == ["undamped_simulated_position", "damped_simulated_position"]
    assert [(f["code"], f["severity"]) for f in result["findings"]] == [("runs_exchanged", "error")]


def test_disagreement_is_an_error_under_strict(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 5 and one line that says why; the same runs with their own scenes agree on the true 14 N/m."""
    assert main(["compare", *EXCHANGED, "--strict", "--json", *FAST]) == 5
    (line,) = capsys.readouterr().err.splitlines()
    assert "runs_exchanged" in line
    constant = compared([*RIGHT, "--strict", *FAST], capsys)["comparison"]["spring_constant"]
    assert constant["value"] == pytest.approx(14.0, abs=3 * constant["u"])


def test_another_spring_is_told_apart_from_an_exchange(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two springs under one bob differ, and nothing is said to be exchanged."""
    runs = [written_run(tmp_path / f"{o}.txt", omega=o, seconds=20.0) for o in (8.0, 8.4)]
    result = compared([*runs, "--scene", BARE_SCENE], capsys)
    assert result["comparison"]["exchanged"] == []
    assert [f["code"] for f in result["findings"]] == ["springs_differ"]


def test_a_report_is_written_where_it_is_wanted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder holds the page with the figure of the constants, and the JSON as printed; without --output nothing."""
    out = tmp_path / "both"
    assert main(["compare", *RIGHT, *FAST, "--output", str(out), "--json", "--figures", "svg"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert json.loads((out / "results.json").read_text("utf-8")) == printed
    assert (out / "figures" / "comparison.svg").stat().st_size > 1000
    assert "damped_simulated_position" in (out / "report.html").read_text("utf-8")


def test_a_run_that_does_not_oscillate_cannot_be_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A bob at rest has no spring constant: exit code 3 and its name."""
    still = written_run(tmp_path / "still.txt", omega=8.0, amplitude_m=1e-9, seconds=10.0)
    assert main(["compare", BARE, still, "--scene", BARE_SCENE]) == 3
    assert "still" in capsys.readouterr().err


def test_an_unreadable_run_ends_the_comparison(capsys: pytest.CaptureFixture[str]) -> None:
    """A comparison of what is left would answer another question: exit code 3."""
    assert main(["compare", BARE, "nothing.txt", "--scene", BARE_SCENE]) == 3
    assert "nothing.txt" in capsys.readouterr().err


def test_runs_of_one_bob_that_differ_in_damping_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where two runs of one bob follow laws with other coefficients a warning says so, and k agrees all the same."""
    omega = math.sqrt(14.0 / (0.2176 + 0.01 / 3 + 8 / 3 * 1.1999 * 0.051**3))
    runs = [
        written_run(tmp_path / f"{name}.txt", omega=omega, beta=beta, seed=seed)
        for name, beta, seed in (("still_air", 0.2, 1), ("draught", 0.3, 2))
    ]
    result = compared([*runs, "--scene", DISC_SCENE], capsys)
    assert result["comparison"]["agree"] is True
    assert [f["code"] for f in result["findings"]] == ["laws_differ"]
