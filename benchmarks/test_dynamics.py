"""Test the benchmarked trajectories without timing limits: they must run and have the stated accuracy."""

from __future__ import annotations

from benchmarks import dynamics


def test_one_trajectory_of_mixed_drag(benchmark):
    """Strang splitting of 120 s of mixed drag dissipates most of the energy."""
    run = benchmark(dynamics.get_integrator("strang").run, dynamics.MIXED, 0.01, 12_000)
    assert run.relative_energy()[-1] < 0.05


def test_the_compared_errors_are_equal():
    """All errors are at most 1e-6, and the error of DOP853 is no smaller than that of step halving."""
    errors = dynamics.errors()
    assert errors["strang"] <= 1e-6
    assert errors["auto for 1e-6"] <= errors["DOP853"] <= 1e-6


def test_every_ratio_can_be_taken():
    """Each pair runs, and both sides of the compared pairs give the same trajectory."""
    found = {name: (ours(), theirs()) for name, _, _, _, ours, theirs, _ in dynamics.cases()}
    exact, filtered = found["exact propagator, linear, 120 s"]
    assert abs(exact.y - filtered).max() < 1e-12
    halved, by_dop853 = found["step halving to 1e-6, mixed drag, 120 s"]
    assert abs(halved.y - by_dop853.y).max() < 0.05e-5
