"""A recording with a disc, predicted from the run without it: k from there, the drag from disc and air alone.

The masses, 200.7 g bare and 217.6 g with a disc of 102 mm, are assumed: they are those of a report on such a bench.
"""

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.disc import derive_drag
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.simulation.band import spread
from springmass.simulations.simulation import prepare
from tests.recordings.test_real_runs import RECORDINGS, track_of

ASSUMED_KG = {"bare": Estimate(0.2007, 5e-5, "kg"), "disc": Estimate(0.2176, 5e-5, "kg")}

pytestmark = pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/recordings")


def analysed(name: str, scene: Scene) -> Analysis:
    """Analyse a MotionSensor.vi position file with a scene."""
    return analyse(track_of(f"AyushPandhi__Pandhi_Ayush_PHY224/{name}"), scene)


def test_the_amplitude_with_a_disc_is_predicted() -> None:
    """After 60 s it lies inside the 95 % band of disc and air alone, and the band is no wider than +-30 %."""
    bare = analysed("position data.txt", Scene(bob_mass_kg=ASSUMED_KG["bare"]))
    constant = bare.estimates["spring_constant"]
    scene = Scene.from_mapping(
        {
            "disc": {"diameter_m": {"value": 0.102, "u": 5e-4}},
            "air": {"temperature_c": 20.0},
            "bob": {"mass_kg": {"value": ASSUMED_KG["disc"].value, "u": ASSUMED_KG["disc"].u}},
            "spring": {"constant_n_per_m": {"value": constant.value, "u": constant.u}},
        }
    )
    damped = analysed("damped position.txt", scene)
    ready = prepare(scene, 120.0, analysis=damped)
    assert ready.drag is not None
    assert ready.from_run == ("start_displacement_m", "start_velocity_m_per_s")
    band = spread(ready.solved, 120.0, ready.measured)
    middle, quantiles = band.amplitude_at(np.array([60.0]))
    measured = float(damped.damping.best.amplitude(np.array([60.0]))[0])
    low, high = float(quantiles[0, 0]), float(quantiles[3, 0])
    assert low < measured < high
    assert 0.7 * middle[0] < low
    assert high < 1.3 * middle[0]


def test_the_disc_takes_what_the_law_of_its_edge_says() -> None:
    """The rate at the start with the disc, less that without it, is the one derived, within a standard uncertainty."""
    rates, start = {}, 0.0
    for name, file in (("bare", "position data.txt"), ("disc", "damped position.txt")):
        found = analysed(file, Scene(bob_mass_kg=ASSUMED_KG[name]))
        rates[name], start = found.estimates["damping_rate"].value, found.estimates["amplitude"].value
        constant = found.estimates["spring_constant"].value
    scene = Scene(
        bob_mass_kg=ASSUMED_KG["disc"],
        spring_constant_n_per_m=Estimate(constant, 0.0, "N/m"),
        disc_diameter_m=Estimate(0.102, 0.0, "m"),
    )
    gamma, beta = derive_drag(scene, start, 120.0).joint.values
    assert rates["disc"] - rates["bare"] == pytest.approx(gamma + beta * start, rel=0.2)
