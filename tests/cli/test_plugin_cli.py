"""A package that adds a format, a sensor, a law and an integrator: found by its entry points, used by its names."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

PLUGIN = Path(__file__).resolve().parents[1] / "plugin"
RECORDING = PLUGIN.parents[1] / "sample_data" / "damped_simulated_position.txt"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder that holds the package as an installer leaves it: its module, its name and its entry points."""
    site = tmp_path_factory.mktemp("site")
    (site / "bench_extras.py").write_bytes((PLUGIN / "bench_extras.py").read_bytes())
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text("utf-8"))["project"]
    described = site / f"bench_extras-{project['version']}.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n")
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {target}" for name, target in entries.items())]
    (described / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return site


def program(installed: Path, *arguments: str | Path) -> Any:
    """Run the program in a process that has the package on its path; return its JSON."""
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-m", "springmass", *map(str, arguments), "--json"]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout)


def test_its_sensor_is_listed(installed: Path) -> None:
    """``springmass ports`` has it next to those that ship."""
    listed = program(installed, "ports", "--no-probe")["sensors"]
    assert {"line-protocol", "plain-millimetres"} <= {sensor["name"] for sensor in listed}


def test_its_format_is_recognised_and_analysed(installed: Path, tmp_path: Path) -> None:
    """A file of its kind is read by content alone."""
    t = np.arange(1000) / 100
    heights = 200 + 50 * np.cos(8.3 * t) + 0.2 * np.random.default_rng(1).standard_normal(t.size)
    path = tmp_path / "run.txt"
    path.write_text("\n".join(["Height log, 100 Hz", *(f"{i};{y:.2f}" for i, y in enumerate(heights))]) + "\n")
    results = program(installed, "analyse", path)
    assert results["input"]["format"] == "height-log"
    assert results["estimates"]["period"]["value"] == pytest.approx(2 * np.pi / 8.3, rel=1e-4)


def test_its_law_and_its_integrator_are_found_by_their_names(installed: Path, tmp_path: Path) -> None:
    """On the command line as those that ship; a name that none has is answered with all of them."""
    scene = tmp_path / "scene.toml"
    spring = "[bob]\nmass_kg = 0.2\n[spring]\nconstant_n_per_m = 15.0\n"
    scene.write_text(f"{spring}[start]\ndisplacement_m = 0.05\n[damping]\ngamma_per_s = 0.007\n")
    simulated = program(installed, "simulate", "--scene", scene, "--method", "midpoint", "--dt", "0.001")
    assert "midpoint" in json.dumps(simulated)
    results = program(installed, "analyse", RECORDING, "--law", "three-halves", "--no-report")
    assert results["damping"]["selected"] == "three-halves"


def test_its_own_tests_pass(installed: Path) -> None:
    """``springmass.testing`` holds everything that it adds to the rules."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(installed), str(PLUGIN)])}
    subprocess.run([sys.executable, "-m", "check_extras"], check=True, env=environment)
