"""The benchmarked trajectories as tests: with timing off they still must run and be as exact as they are called."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

HERE = Path(__file__).resolve().parent


@pytest.fixture(scope="module")
def dynamics() -> ModuleType:
    """Return ``benchmarks/dynamics.py``."""
    spec = importlib.util.spec_from_file_location("springmass_benchmark_dynamics", HERE / "dynamics.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_one_trajectory_of_mixed_drag(benchmark, dynamics):
    """120 s of mixed drag by Strang splitting."""
    run = benchmark(dynamics.get_integrator("strang").run, dynamics.MIXED, 0.01, 12_000)
    assert run.relative_energy()[-1] < 0.05


def test_the_compared_errors_are_equal(dynamics):
    """Strang and what is chosen err by at most 1e-6, and LSODA is not asked for more than either has."""
    errors = dynamics.errors()
    assert errors["strang"] <= 1e-6
    assert 0.3 * errors["strang"] <= errors["LSODA"] <= 3.0 * errors["strang"]
    assert errors["auto for 1e-6"] <= errors["finer LSODA"] <= 1e-6


def test_every_ratio_can_be_taken(dynamics):
    """Each pair runs, and gives what the other gives."""
    found = {name: (ours(), theirs()) for name, _, _, _, ours, theirs, _ in dynamics.cases()}
    exact, filtered = found["exact propagator, linear, 120 s"]
    assert abs(exact.y - filtered).max() < 1e-12
    choices, runs = found["choosing for 60 scenes"]
    assert [choice.integrator.name in ("exact", "averaged", "strang", "taylor", "rk4") for choice in choices] == [
        True
    ] * 60
    assert [len(run.y) for run in runs] == [scene[2] + 1 for scene in dynamics.spread_scenes(60)]


def test_what_choosing_costs_can_be_compared_with_the_cheapest(dynamics):
    """By a timer that counts calls every one takes 1, so that to choose and to run takes 2."""
    scenes = [*dynamics.mixed_scenes(2), *dynamics.spread_scenes(4)]
    assert dynamics.over_cheapest(iter(range(10_000)).__next__, scenes, rounds=1).tolist() == [2.0] * 6


def test_planning_can_be_compared_with_running(dynamics):
    """By a timer that counts calls every plan and every run takes one: their ratio is 1 in each scene."""
    shares = dynamics.planning(iter(range(10_000)).__next__, dynamics.mixed_scenes(3))
    assert shares.tolist() == [1.0] * 3
    assert all(len(scene) == 4 for scene in dynamics.long_scenes())


def test_the_cost_of_a_run_can_be_compared_with_its_time(dynamics):
    """By a timer that counts calls every run takes one, over a cost that is positive."""
    ratios = dynamics.costs(iter(range(10_000)).__next__, number=6, rounds=1)
    assert {"strang", "taylor", "averaged", "rk4", "verlet"} <= set(ratios)
    assert all((each > 0.0).all() and np.isfinite(each).all() for each in ratios.values())
