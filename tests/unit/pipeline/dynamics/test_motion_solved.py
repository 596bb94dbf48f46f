"""The equation of motion, and what a scene makes of it."""

import math

import numpy as np
import pytest

from pipeline.bench.disc import added_mass_kg
from pipeline.bench.scene import Scene
from pipeline.bench.spring import oscillating_mass_kg
from pipeline.errors import SceneError
from pipeline.simulation import Problem, effective_mass_kg, get_integrator
from springmass.simulations.bench import REST_M, bench_position
from springmass.simulations.simulation import prepare

BENCH = {
    "bob": {"mass_kg": 0.2176},
    "spring": {"mass_kg": 0.01, "constant_n_per_m": 14.0},
    "disc": {"diameter_m": 0.102},
    "start": {"displacement_m": 0.05},
}


def test_the_mass_is_bob_air_and_the_springs_share() -> None:
    """As an analysis counts it."""
    scene = Scene.from_mapping(BENCH)
    expected = oscillating_mass_kg(0.01, 0.2176 + added_mass_kg(scene))
    assert effective_mass_kg(scene) == pytest.approx(expected, rel=1e-15)
    found = Problem.from_scene(scene).equation.angular_frequency_per_s
    assert found == pytest.approx(math.sqrt(14.0 / expected), rel=1e-15)
    with pytest.raises(SceneError, match=r"\[spring\] constant_n_per_m"):
        Problem.from_scene(Scene.from_mapping({**BENCH, "spring": {}}))
    with pytest.raises(SceneError, match="mass_kg"):
        effective_mass_kg(Scene())


def test_the_bench_moves_by_the_equation() -> None:
    """Position by position within 1e-7 of finer steps, with friction and a stop too, in any order of asking."""
    damping = {"gamma_per_s": 0.01, "beta_per_m_s": 0.2, "mu_m_per_s": 0.003}
    scene = Scene.from_mapping({**BENCH, "damping": damping})
    position = bench_position(scene)
    run = get_integrator("strang").run(Problem.from_scene(scene), 0.000137, 150_000, every=100)
    rows = np.random.default_rng(1).permutation(1501)[:400]
    found = np.array([position(run.t[row]) for row in rows])
    np.testing.assert_allclose(found - REST_M, run.y[rows], rtol=0, atol=0.05 * 2e-6)
    assert position(1e3) == position(2e3) != REST_M
    assert position(-1.0) == pytest.approx(REST_M + 0.05)


def test_drag_that_disc_and_air_imply_damps_the_simulated_bench() -> None:
    """Without a stated damping the bench decays as the prediction for the same time does."""
    disc = {"disc": {"diameter_m": 0.16}, "air": {"temperature_c": 20.0}}
    scene = Scene.from_mapping({**BENCH, **disc})
    position = bench_position(scene, 20.0)
    predicted = get_integrator("strang").run(prepare(scene, 20.0).problem, 0.001, 20_000, every=100)
    recorded = np.array([position(t) for t in predicted.t]) - REST_M
    np.testing.assert_allclose(recorded, predicted.y, rtol=0.0, atol=1e-7)
    assert np.abs(recorded[-50:]).max() < 0.6 * np.abs(recorded[:50]).max()
