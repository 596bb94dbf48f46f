"""Drag derived from disc, bob and air: its scaling, its parts, and what it stands for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.bench.derived_drag import derive_drag, disc_drag_coefficient, needs_drag
from pipeline.bench.scene import Scene
from pipeline.dynamics.amplitude import amplitude
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


def test_two_coefficients_stand_for_the_law_that_they_are_fitted_to() -> None:
    """The amplitude after 120 s is that of dA/dt = -c A^(5/3) - g A, solved by scipy, within 2 %."""
    drag = derive_drag(Scene.from_mapping(BENCH), 0.05, 120.0)
    viscous = drag.layer_per_s + drag.bob_per_s

    def rate(_: float, a: np.ndarray) -> np.ndarray:
        return -drag.shed_per_s * a * np.cbrt(a / 0.05) ** 2 - viscous * a

    ends = solve_ivp(rate, (0.0, 120.0), [0.05], rtol=1e-9, t_eval=[30.0, 60.0, 120.0]).y[0]
    found = amplitude(0.05, drag.gamma_per_s, drag.beta_per_m_s, 0.0, np.array([30.0, 60.0, 120.0]))
    np.testing.assert_allclose(found, ends, rtol=0.02)
    assert drag.mismatch < 0.03
    np.testing.assert_allclose(drag.covariance[0, 1] / drag.covariance[1, 1], 0.2**2 * ratio(drag), rtol=1e-9)


def ratio(drag: Any) -> float:
    """Return gamma over beta of what the edge sheds, over the squared relative uncertainty."""
    return (drag.gamma_per_s - drag.layer_per_s - drag.bob_per_s) / drag.beta_per_m_s / 0.2**2


def test_air_alone_takes_little_from_a_bare_bob() -> None:
    """A sphere of steel of 218 g: Stokes' drag and its layer's, by hand, and half of it uncertain."""
    scene = Scene.from_mapping({name: table for name, table in BENCH.items() if name != "disc"})
    drag = derive_drag(scene, 0.05, 10.0)
    assert drag.beta_per_m_s == 0.0
    assert drag.gamma_per_s == pytest.approx(1.6e-4, rel=0.05)
    assert math.sqrt(drag.covariance[0, 0]) == 0.5 * drag.gamma_per_s
    assert "Landau" in drag.words


def test_drag_is_derived_only_where_nothing_is_stated_of_it() -> None:
    """A scene without disc and air names no medium; one with any damping has its own; a spring is needed."""
    assert needs_drag(Scene.from_mapping(BENCH))
    assert not needs_drag(Scene.from_mapping({"bob": BENCH["bob"], "spring": BENCH["spring"]}))
    assert not needs_drag(Scene.from_mapping({**BENCH, "damping": {"mu_m_per_s": 0.0}}))
    with pytest.raises(SceneError, match=r"\[spring\] constant_n_per_m"):
        derive_drag(Scene.from_mapping({"bob": BENCH["bob"], "disc": BENCH["disc"]}), 0.05, 1.0)
