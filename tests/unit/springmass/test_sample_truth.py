"""On every simulated recording each truth lies within three of its stated uncertainties."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.analyse import Analysis, Oscillation, analyse
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

    def stiffness_of_damping(self) -> float:
        """What a spring must add to the recording's k = m omega^2 to keep that frequency under its damping, N/m.

        m times the mean of (A'/A)^2, weighted by A^2, from the true law; the recordings' own truth leaves it out.
        """
        gamma, beta = (self.value(name) if name in self.truth["truth"] else 0.0 for name in ("gamma", "beta"))
        t = np.linspace(0.0, (self.truth["samples"] - 1) / self.truth["rate_hz"], 20_001)
        start = self.value("amplitude")
        fall = np.exp(-gamma * t)
        amplitude = start * fall / (1.0 + beta * start * (1.0 - fall) / gamma)
        mean = np.average((gamma + beta * amplitude) ** 2, weights=amplitude**2)
        return float(self.value("effective_mass") * mean)

    def lag_of_drag(self) -> tuple[float, float]:
        """By what share the frequency and by how many radians the phase may differ, for these motions are cosines.

        Under quadratic drag a bob's first harmonic is late by (5/6) beta A/omega (Krylov and Bogoliubov), which falls
        with A. The analysis takes that out of the phase of a bob; the recordings do not hold it. A straight line
        through a phase that bends has at most 1.5 times the slope between its ends.
        """
        if "beta" not in self.truth["truth"]:
            return 0.0, 0.0
        lag = 5.0 / 6.0 * self.value("beta") * self.value("amplitude") / self.value("angular_frequency")
        turned = self.value("angular_frequency") * self.truth["samples"] / self.truth["rate_hz"]
        return 1.5 * lag / turned, lag

    def stiffness_of_spring(self) -> float:
        """What a uniform spring's share, x tan x = m_s/m, adds to k where the recording took a third, N/m."""
        spring = self.truth["scene"]["spring"]["mass_kg"]["value"]
        load = self.value("effective_mass") - spring / 3.0
        low, high = 0.0, math.pi / 2.0
        for _ in range(60):
            x = 0.5 * (low + high)
            low, high = (x, high) if x * math.sin(x) * load < spring * math.cos(x) else (low, x)
        return self.value("spring_constant") * (spring / x**2 / self.value("effective_mass") - 1.0)

    @property
    def motion(self) -> Oscillation:
        """What was found to move."""
        assert isinstance(self.result.motion, Oscillation)
        return self.result.motion

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


def test_every_truth_is_within_three_statistical_uncertainties(run: Sample) -> None:
    """The record's own scatter, without the shares of clock, scale and masses, holds the truth too."""
    statistical = run.motion.derived.statistical
    assert set(statistical) == set(run.result.estimates)
    share, lag = run.lag_of_drag()
    bent = {name: share * run.value(name) for name in ("period", "frequency", "angular_frequency")} | {"phase": lag}
    pulls = {
        n: max(abs(e.value - run.value(n)) - bent.get(n, 0.0), 0.0) / e.u
        for n, e in statistical.items()
        if n in run.truth["truth"]
    }
    k = statistical["spring_constant"]
    pulls["spring_constant"] = (
        k.value - run.value("spring_constant") - run.stiffness_of_damping() - run.stiffness_of_spring()
    ) / k.u
    assert set(pulls) >= {"period", "frequency", "angular_frequency", "amplitude", "offset", "phase"}
    assert max(abs(z) for z in pulls.values()) <= 3.0, pulls


def test_mixed_drag_fits_every_run(run: Sample) -> None:
    """Gamma and beta of the law with both lie within three uncertainties of the truth, also where one of them is 0."""
    fit = run.motion.damping.fits["linear+quadratic"]
    for name in ("gamma", "beta"):
        assert abs(fit.joint[name].value - run.value(name)) <= 3.0 * fit.joint[name].u, name


def test_true_law_is_admissible(run: Sample) -> None:
    """The law that made the recording is not rejected."""
    assert run.truth["law"] in run.motion.damping.admissible
    assert "none" not in run.motion.damping.admissible


def test_mass_and_velocity(run: Sample) -> None:
    """The mass that swings is the true one, and the velocity that of the true motion."""
    mass = run.motion.derived.effective_mass_kg
    assert mass is not None
    assert abs(mass.value - run.value("effective_mass")) <= 3.0 * mass.u
    t = np.arange(run.truth["samples"]) / run.truth["rate_hz"]
    gamma, beta, start = run.value("gamma"), run.value("beta"), run.value("amplitude")
    decay = np.exp(-gamma * t)
    amplitude = start * decay / (1.0 + beta * start * (1.0 - decay) / gamma)
    # The mean of A^2 in the middle of windows differs from that over samples by the square of the decay in one window.
    expected = run.value("angular_frequency") * np.sqrt(np.mean(amplitude**2) / 2.0)
    found = run.result.estimates["velocity_rms"]
    assert abs(found.value - expected) <= 3.0 * found.u + 5e-5 * expected


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
    assert run.result.conditioned.plateaus_m == (pytest.approx(run.truth["clip_limit_m"], abs=2e-4),)
    assert run.share_flagged("clipped_rows", Quality.CLIPPED) >= 0.98
    assert run.result.quality["clipped"] <= 1.02 * len(run.truth["clipped_rows"])


@pytest.mark.parametrize("name", [n for n in NAMES if n != "clipped"])
def test_no_other_run_is_clipped(name: str) -> None:
    """A crest is no plateau."""
    assert sample(name).result.quality["clipped"] == 0


def test_damped_run_rejects_either_drag_alone() -> None:
    """Two minutes of mixed drag leave one admissible law."""
    damping = sample("damped").motion.damping
    assert damping.admissible == ("linear+quadratic",)
    assert all(damping.fits[name].rejected for name in ("none", "linear", "quadratic"))


def test_stated_error_is_named_for_what_it_is(run: Sample) -> None:
    """The instrument's 2.39 mm are not the noise, and that is said."""
    assert "stated_error_is_not_noise" in {finding.code for finding in run.result.findings}


def test_no_error_and_no_false_alarm(run: Sample) -> None:
    """What the simulation does not hold is not found: no drift, no bend, no misfit."""
    codes = {finding.code for finding in run.result.findings}
    assert not codes & {
        "rest_drift",
        "amplitude_dependent_frequency",
        "model_misfit",
        "no_oscillation",
        "quantised",
    }
    assert "error" not in {finding.severity for finding in run.result.findings}
