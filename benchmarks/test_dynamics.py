"""The benchmarked trajectories as tests: with timing off they still must run and be as exact as they are called."""

from __future__ import annotations

from benchmarks import dynamics


def test_one_trajectory_of_mixed_drag(benchmark):
    """120 s of mixed drag by Strang splitting."""
    run = benchmark(dynamics.get_integrator("strang").run, dynamics.MIXED, 0.01, 12_000)
    assert run.relative_energy()[-1] < 0.05


def test_the_compared_errors_are_equal():
    """Strang and step halving err by at most 1e-6, and LSODA is at least as exact as halving needs."""
    errors = dynamics.errors()
    assert errors["strang"] <= 1e-6
    assert errors["auto for 1e-6"] <= errors["LSODA"] <= 1e-6


def test_every_ratio_can_be_taken():
    """Each pair runs, and gives what the other gives."""
    found = {name: (ours(), theirs()) for name, _, _, _, ours, theirs, _ in dynamics.cases()}
    exact, filtered = found["exact propagator, linear, 120 s"]
    assert abs(exact.y - filtered).max() < 1e-12
    halved, by_lsoda = found["step halving to 1e-6, mixed drag, 120 s"]
    assert abs(halved.y - by_lsoda.y).max() < 0.05e-5
