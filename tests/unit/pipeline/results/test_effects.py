"""The effects table lists every effect, in or out, with sizes calculated by hand."""

import math
from functools import cache
from typing import Any

import pytest

from pipeline.analyse import analyse
from pipeline.bench.disc import added_mass_kg
from pipeline.bench.scene import Scene
from pipeline.results.effects import Effect
from pipeline.track import Track
from tests.synthetic import Truth, noisy, times

T = times(60.0)
Y = noisy(Truth(omega=8.0, gamma=0.007, beta=0.2), T, 3e-5, 1)
BENCH: dict[str, Any] = {
    "bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}},
    "spring": {"mass_kg": 0.0100},
    "disc": {"diameter_m": 0.102},
    "air": {"temperature_c": 20.0, "pressure_pa": 101325.0, "relative_humidity": 0.0},
    "sensor": {"position": "below"},
}


@cache
def effects(*, known: bool) -> dict[str, Effect]:
    """Return the effects of a run of 8 rad/s with mixed drag, by name, on the whole bench or if nothing is known."""
    scene = Scene.from_mapping(BENCH if known else {})
    return {effect.name: effect for effect in analyse(Track.from_arrays(T, Y), scene).effects}


def test_masses_by_hand() -> None:
    """A third of 10 g and a little is 1.54 % of the bob, 0.43 g of air 0.196 %; without a bob nothing is predicted."""
    bench, bare = effects(known=True), effects(known=False)
    assert bench["spring_mass"].predicted == pytest.approx(0.01 / 3 / 0.2176 + (0.01 / 0.2176) ** 2 / 45, rel=1e-4)
    assert bench["added_mass"].predicted == pytest.approx(8 / 3 * 1.2041 * 0.051**3 / 0.2176, rel=1e-3)
    assert added_mass_kg(Scene.from_mapping(BENCH)) == pytest.approx(8 / 3 * 1.2041 * 0.051**3, rel=5e-4)
    for name in ("spring_mass", "added_mass"):
        assert bench[name].included
        assert (bare[name].predicted, bare[name].included) == (None, False)


def test_drag_by_hand() -> None:
    """The disc's drag by one formula, C = 4.8 KC^(-1/3), stands next to all damping that was measured at the start."""
    bench, bare = effects(known=True), effects(known=False)
    mass = 0.2176 + 0.0100 / 3 + 8 / 3 * 1.2041 * 0.051**3
    coefficient = 16 * (2 / math.pi) ** (8 / 3) * (2 * math.pi * 0.05 / 0.102) ** (-1 / 3)
    drag_per_m = 0.5 * coefficient * 1.2041 * math.pi * 0.051**2 / mass
    assert bench["disc_drag"].predicted == pytest.approx(4 * drag_per_m * 8.0 * 0.05 / (3 * math.pi), rel=5e-3)
    assert bench["disc_drag"].measured == pytest.approx(0.007 + 0.2 * 0.05, rel=0.02)
    assert bare["disc_drag"].predicted is None
    longer = bench["damping"].measured
    assert longer is not None
    assert 0.5 * (0.007 / 8) ** 2 < longer < (0.017 / 8) ** 2


def test_buoyancy_by_hand() -> None:
    """A steel bob is lifted by rho / rho_steel g / omega^2 = 23 um."""
    assert effects(known=True)["buoyancy"].predicted == pytest.approx(1.2041 / 7850 * 9.81 / 64, rel=1e-2)
