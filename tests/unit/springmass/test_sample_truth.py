"""The simulated recordings are reproducible, and each truth lies within three of its stated uncertainties."""

import json
import re
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.track import Quality, Track

FOLDER = Path(__file__).resolve().parents[3] / "sample_data"
NAMES = ("undamped", "damped", "clipped", "cropped", "sixty_hz")
STATED_ERROR_M = 0.00239


@dataclass(frozen=True)
class Sample:
    """One simulated recording, its truth, and what the analysis makes of it."""

    truth: dict[str, Any]
    result: Analysis

    def value(self, name: str) -> float:
        """Return one true quantity."""
        return float(self.truth["truth"][name]["value"])

    def share_flagged(self, rows: str, flag: Quality) -> float:
        """Share of the listed rows that ended with a flag."""
        return float(np.mean((self.result.flags[self.truth[rows]] & np.uint8(flag)) > 0))


@lru_cache
def sample(name: str) -> Sample:
    """Read a recording in plain Python, at its row numbers over the nominal rate, and analyse it."""
    truth: dict[str, Any] = json.loads((FOLDER / f"{name}_simulated.truth.json").read_text("ascii"))
    lines = (FOLDER / f"{name}_simulated_position.txt").read_text("ascii").splitlines()
    rows = [line.split("\t") for line in lines if line[:1].isdigit()]
    assert len(rows) == truth["samples"]
    t = truth["t_first_s"] + np.arange(len(rows)) / truth["rate_hz"]
    assert np.max(np.abs(t - np.array([float(row[0]) for row in rows]))) <= 0.0005 + 1e-9
    track = Track(
        t=t,
        y=np.array([float(row[1]) / 100.0 for row in rows]),
        flags=np.zeros(len(rows), np.uint8),
        rate_hz=float(truth["rate_hz"]),
        quantum_m=truth["truth"]["quantum"]["value"],
        stated_error_m=STATED_ERROR_M,
        kind="simulated",
    )
    return Sample(truth, analyse(track, Scene.from_mapping(truth["scene"])))


@pytest.fixture(params=NAMES)
def run(request: pytest.FixtureRequest) -> Sample:
    """Return one recording after the other."""
    return sample(request.param)


def test_every_truth_is_within_three_uncertainties(run: Sample) -> None:
    """Whatever is both known and estimated agrees."""
    compared = set(run.truth["truth"]) & set(run.result.estimates)
    assert compared >= {
        "period",
        "frequency",
        "amplitude",
        "offset",
        "phase",
        "noise",
        "damping_rate",
        "spring_constant",
    }
    pulls = {n: (run.result.estimates[n].value - run.value(n)) / run.result.estimates[n].u for n in compared}
    assert max(abs(z) for z in pulls.values()) <= 3.0, pulls


def test_true_law_is_admissible(run: Sample) -> None:
    """The law that made the recording is not rejected."""
    assert run.truth["law"] in run.result.damping.admissible
    assert "none" not in run.result.damping.admissible


def test_false_echoes_are_flagged(run: Sample) -> None:
    """At least 99 % of the listed false echoes end flagged, and little else but heavy tails."""
    echoes = run.truth["false_echo_rows"]
    if echoes:
        assert run.share_flagged("false_echo_rows", Quality.FALSE_ECHO) >= 0.99
    others = run.result.quality["false_echo"] - len(echoes)
    assert others <= 0.02 * run.truth["samples"]


def test_clipped_run() -> None:
    """The clipped run's amplitude is right to 1 %, the plateau is found and named."""
    run = sample("clipped")
    assert run.result.estimates["amplitude"].value == pytest.approx(run.value("amplitude"), rel=0.01)
    assert "clipped" in {finding.code for finding in run.result.findings}
    assert run.result.samples.plateaus == (pytest.approx(run.truth["clip_limit_m"], abs=2e-4),)
    assert run.share_flagged("clipped_rows", Quality.CLIPPED) >= 0.98
    assert run.result.quality["clipped"] <= 1.02 * len(run.truth["clipped_rows"])


def test_generator_shares_no_code_with_the_project() -> None:
    """The generator imports the standard library and numpy only."""
    source = (FOLDER / "generate.py").read_text("utf-8")
    imported = set(re.findall(r"^(?:from|import) (\w+)", source, re.MULTILINE))
    assert imported <= {*sys.stdlib_module_names, "numpy"}
