"""Drag derived from disc, bob and air: its scaling, its parts, and what it stands for."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pipeline.bench.derived_drag import derive_drag, disc_drag_coefficient, needs_drag
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError

BENCH: dict[str, Any] = {
    "bob": {"mass_kg": 0.2176},
    "spring": {"constant_n_per_m": 15.2, "mass_kg": 0.01},
    "disc": {"diameter_m": 0.102},
    "air": {"temperature_c": 20.0},
}


def test_the_coefficient_falls_as_the_stroke_grows_and_ends_at_the_steady_one() -> None:
    """4.8 KC^(-1/3) by a plate's 8.0 and the edges' ratio of velocities; 1.17 from KC of 70 on."""
    assert disc_drag_coefficient(1.0) == pytest.approx(16.0 * (2.0 / math.pi) ** (8.0 / 3.0))
    assert disc_drag_coefficient(8.0) == pytest.approx(0.5 * disc_drag_coefficient(1.0))
    assert disc_drag_coefficient(200.0) == 1.17
    assert disc_drag_coefficient(0.0) == math.inf


def test_drag_is_derived_only_where_nothing_is_stated_of_it() -> None:
    """A scene without disc and air names no medium; one with any damping has its own; a spring is needed."""
    assert needs_drag(Scene.from_mapping(BENCH))
    assert not needs_drag(Scene.from_mapping({"bob": BENCH["bob"], "spring": BENCH["spring"]}))
    assert not needs_drag(Scene.from_mapping({**BENCH, "damping": {"mu_m_per_s": 0.0}}))
    with pytest.raises(SceneError, match=r"\[spring\] constant_n_per_m"):
        derive_drag(Scene.from_mapping({"bob": BENCH["bob"], "disc": BENCH["disc"]}), 0.05, 1.0)
