"""A package that adds a format, a sensor, a law and an integrator works in a checkout and next to a wheel alike."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from springmass import extend

PLUGIN = Path(__file__).resolve().parents[1] / "plugin"

USES = """
import numpy as np
import springmass as sm
from bench_extras import MIDPOINT, THREE_HALVES
from springmass.extend import Equation, Problem, get_integrator

t = np.arange(6000) / 100
y = 0.2 + THREE_HALVES.curve(t, np.array([0.05, 0.2]))[0] * np.cos(8 * t)
y += 1e-4 * np.random.default_rng(1).standard_normal(t.size)
print(sm.analyse((t, y), laws=[..., THREE_HALVES]).motion.damping.selected)
problem = Problem(Equation.from_laws(8.66, gamma_per_s=0.0073), 0.05)
exact = get_integrator("strang").run(problem, 0.001, 1000)
print(float(np.max(np.abs(MIDPOINT.run(problem, 0.001, 1000).y - exact.y))))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the package by pip into a separate folder, without network, and return the folder."""
    folder = tmp_path_factory.mktemp("plugin")
    source = shutil.copytree(PLUGIN, folder / "source")
    quiet = ["--quiet", "--disable-pip-version-check", "--no-index", "--no-deps", "--no-build-isolation"]
    command = [sys.executable, "-m", "pip", "install", *quiet, "--target", str(folder / "site"), str(source)]
    subprocess.run(command, check=True)
    return folder / "site"


def python(installed: Path, *arguments: str) -> str:
    """Run the interpreter with the package on its path and return what it prints."""
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout


def test_its_sensor_is_listed(installed: Path) -> None:
    """``springmass sensors`` has it next to those that ship."""
    listed = json.loads(python(installed, "-m", "springmass", "sensors", "--json"))
    assert {"line-protocol", "plain-millimetres"} <= {sensor["name"] for sensor in listed}


def test_its_format_is_recognised_and_analysed(installed: Path, tmp_path: Path) -> None:
    """A file of its kind is read by content alone."""
    t = np.arange(1000) / 100
    heights = 200 + 50 * np.cos(8.3 * t) + 0.2 * np.random.default_rng(1).standard_normal(t.size)
    path = tmp_path / "run.txt"
    path.write_text("\n".join(["Height log, 100 Hz", *(f"{i};{y:.2f}" for i, y in enumerate(heights))]) + "\n")
    (line,) = python(installed, "-m", "springmass", "analyse", "--json", "--no-report", str(path)).splitlines()
    results = json.loads(line)
    assert results["input"]["format"] == "height-log"
    assert results["estimates"]["period"]["value"] == pytest.approx(2 * np.pi / 8.3, rel=1e-4)


def test_its_law_and_its_integrator_run(installed: Path) -> None:
    """Both are made of public names, and agree with the truth and with another method."""
    law, difference = python(installed, "-c", USES).split()
    assert law == "three-halves"
    assert 0.0 < float(difference) < 1e-5


def test_every_public_name_of_extend_loads() -> None:
    """The list, the table of modules and what is imported agree; a name that it lacks is an AttributeError."""
    assert sorted(name for names in extend._WHERE.values() for name in names) == extend.__all__ == dir(extend)
    assert all(getattr(extend, name) is not None for name in extend.__all__)
    with pytest.raises(AttributeError, match="it has AnalysisError"):
        _ = extend.nonsense  # type: ignore[attr-defined]
