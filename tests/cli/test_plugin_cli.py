"""A package that adds a format, a sensor, a law and an integrator: found by its entry points, used by its names."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import MIXED

PLUGIN = Path(__file__).resolve().parents[1] / "plugin"
RECORDING = PLUGIN.parents[1] / "sample_data" / "damped_simulated_position.txt"


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """Return a folder that holds the package as an installer leaves it: its module, its name and its entry points."""
    site = tmp_path / "site"
    site.mkdir()
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


PROGRAM = """
import json, sys
from springmass.cli import main
for line in json.loads(sys.argv[1]):
    assert main([*line, "--json"]) == 0, line
import check_extras
check_extras.test_all()
"""


def test_what_it_adds_is_found_by_its_names_and_keeps_the_rules(installed: Path, tmp_path: Path) -> None:
    """Its sensor is listed, its format recognised by content, its integrator and its law are options like any others.

    ``springmass.testing`` holds everything that it adds to the rules.
    """
    t = np.arange(1000) / 100
    heights = 200 + 50 * np.cos(8.3 * t) + 0.2 * np.random.default_rng(1).standard_normal(t.size)
    path, scene = tmp_path / "run.txt", tmp_path / "scene.toml"
    path.write_text("\n".join(["Height log, 100 Hz", *(f"{i};{y:.2f}" for i, y in enumerate(heights))]) + "\n")
    scene.write_text(MIXED)
    lines = [
        ["ports", "--no-probe"],
        ["analyse", str(path)],
        ["simulate", "--scene", str(scene), "--method", "midpoint", "--dt", "0.001"],
        ["analyse", str(RECORDING), "--law", "three-halves"],
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(installed), str(PLUGIN)])}
    command = [sys.executable, "-c", PROGRAM, json.dumps(lines)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    ports, logged, simulated, analysed = map(json.loads, done.stdout.splitlines())
    assert {"line-protocol", "plain-millimetres"} <= {sensor["name"] for sensor in ports["sensors"]}
    assert logged["input"]["format"] == "height-log"
    assert logged["estimates"]["period"]["value"] == pytest.approx(2 * np.pi / 8.3, rel=1e-4)
    assert "midpoint" in json.dumps(simulated)
    assert analysed["damping"]["selected"] == "three-halves"
