"""The simulated bench moves as ``springmass simulate`` says."""

from __future__ import annotations

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.dynamics.strang import STRANG
from springmass.simulations.bench import REST_M, bench_position
from springmass.simulations.simulation import prepare


def test_drag_that_disc_and_air_imply_damps_the_simulated_bench() -> None:
    """Without a stated damping the bench decays as the prediction for the same time does."""
    scene = Scene.from_mapping(
        {
            "bob": {"mass_kg": 0.2},
            "spring": {"constant_n_per_m": 20.0},
            "disc": {"diameter_m": 0.16},
            "air": {"temperature_c": 20.0},
            "start": {"displacement_m": 0.05},
        }
    )
    position = bench_position(scene, 20.0)
    predicted = STRANG.run(prepare(scene, 20.0).problem, 0.001, 20_000, every=100)
    recorded = np.array([position(t) for t in predicted.t]) - REST_M
    np.testing.assert_allclose(recorded, predicted.y, rtol=0.0, atol=1e-7)
    assert np.abs(recorded[-50:]).max() < 0.6 * np.abs(recorded[:50]).max()
