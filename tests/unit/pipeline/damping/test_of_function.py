"""Laws made of functions: they fit as the laws with a class do, and what is no law of damping is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.damping.laws import LAWS
from pipeline.damping.laws.of_function import FunctionLaw, make_law
from pipeline.errors import AnalysisError
from pipeline.options import Options, options_for
from pipeline.track import Track
from tests.plugin.bench_extras import falling, first_guess

T = np.arange(6000) / 100


def three_halves(**options: Any) -> FunctionLaw:
    """Return the law of these functions."""
    return make_law("three-halves", falling, {"d": (-1 / 2, -1)}, first_guess, **options)


def analysed(amplitude: Any, *laws: Any, accuracy: str = "standard", seed: int = 1) -> Analysis:
    """Return the analysis of a minute with this amplitude, with these laws beside all others."""
    noise_m = 1e-4 * np.random.default_rng(seed).standard_normal(T.size)
    options = replace(options_for(accuracy), laws=(*LAWS, *laws))
    return analyse(Track.from_arrays(T, 0.2 + amplitude * np.cos(8.0 * T) + noise_m), options=options)


@pytest.mark.parametrize("accuracy", ["standard", "best"])
def test_a_law_of_a_function_is_found_where_it_holds(accuracy: str) -> None:
    """It is selected, and its coefficient is the true one, with the clock in its uncertainty and a budget."""
    found = analysed(falling(T, 0.05, 0.2), three_halves(words="a law of mine"), accuracy=accuracy)
    assert found.damping.selected == "three-halves"
    d = found.derived.coefficients["d"]
    assert d.unit == "1/(m^1/2 s)"
    assert abs(d.value - 0.2) < 4.0 * d.u < 0.01
    assert {"clock_rate", "damping_law"} <= {c.name for c in found.derived.budgets["d"].contributions}


@pytest.mark.parametrize("name", ["n", "beta"])
def test_a_coefficient_means_nothing_by_its_name(name: str) -> None:
    """A coefficient with the name of one of ours is neither a power nor a drag coefficient nor friction."""
    t = np.arange(3000) / 100.0
    y = 0.3 + falling(t, 0.05, 0.3) * np.cos(8.3 * t) + 3e-4 * np.random.default_rng(1).standard_normal(t.size)
    law = make_law("own", falling, {name: (-1 / 2, -1)}, first_guess)
    bench = Scene.from_mapping({"bob": {"mass_kg": 0.2}, "disc": {"diameter_m": 0.1}, "air": {"temperature_c": 20.0}})
    options = Options(laws=(law,))
    found = analyse(Track.from_arrays(t, y), bench, options)
    own = found.derived.coefficients
    assert set(own) == {name}
    assert own[name].value == pytest.approx(0.3, rel=0.05)
    assert "drag_coefficient" not in found.estimates


def test_a_coefficient_with_the_name_of_an_estimate_is_refused() -> None:
    """A coefficient called "period" would take the place of the period."""
    with pytest.raises(AnalysisError, match="period"):
        make_law("own", lambda t, a, d: a * np.exp(-d * t), {"period": (0, -1)}, lambda t, a: (a[0], 1.0 / t[-1]))
