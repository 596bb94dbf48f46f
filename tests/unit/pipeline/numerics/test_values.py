"""Values keep uncertainty, correlation and unit in arithmetic, numpy, ``uncertainties``, copies and other processes."""

import copy
import dataclasses
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
import uncertainties
from uncertainties import UFloat, ufloat, umath, unumpy

from pipeline.numerics.estimate import Estimate, UpperLimit

PERIOD, STIFFNESS = Estimate(0.7431, 0.0002, "s"), Estimate(14.0, 0.1, "N/m")
NO_UNIT = "none that a result has"

# What is done with the period T and the spring constant k, the unit of the result, and its derivatives by T and k.
WAYS: dict[str, tuple[Callable[[Any], Any], str | None, float, float]] = {
    "2 T": (lambda t: 2 * t, "s", 2.0, 0.0),
    "T 2": (lambda t: t * 2, "s", 2.0, 0.0),
    "T + T": (lambda t: t + t, "s", 2.0, 0.0),
    "T - T / 2": (lambda t: t - t / 2, "s", 0.5, 0.0),
    "1 / T": (lambda t: 1 / t, "1/s", -(0.7431**-2), 0.0),
    "T / T": (lambda t: t / t, "", 0.0, 0.0),
    "T**2": (lambda t: t**2, "s^2", 2 * 0.7431, 0.0),
    "2**(T / T)": (lambda t: 2 ** (t / t), "", 0.0, 0.0),
    "-T": (lambda t: -t, "s", -1.0, 0.0),
    "+T": (lambda t: +t, "s", 1.0, 0.0),
    "abs": (lambda t: abs(-t), "s", 1.0, 0.0),
    "round": (lambda t: round(t, 3), "s", 1.0, 0.0),
    "k T^2": (lambda t: STIFFNESS * t**2, "kg", 2 * 14.0 * 0.7431, 0.7431**2),
    "k T": (lambda t: STIFFNESS * t, NO_UNIT, 14.0, 0.7431),
    "T + k": (lambda t: t + STIFFNESS, NO_UNIT, 1.0, 1.0),
    "T + 1": (lambda t: t + 1.0, NO_UNIT, 1.0, 0.0),
    "T times a number of the package": (lambda t: t * ufloat(3.0, 1e-9) / 3.0, NO_UNIT, 1.0, 0.0),
    "sum": (lambda t: sum([t, t]), "s", 2.0, 0.0),
    "array": (lambda t: (t * np.array([1.0, 3.0]))[1], "s", 3.0, 0.0),
    "array on the left": (lambda t: (np.array([1.0, 3.0]) * t)[1], "s", 3.0, 0.0),
    "np.sum": (lambda t: np.sum(np.array([t, 2 * t])), "s", 3.0, 0.0),
    "np.mean": (lambda t: np.array([t, 3 * t]).mean(), "s", 2.0, 0.0),
    "np.dot": (lambda t: np.array([t, t]) @ np.array([1.0, 2.0]), "s", 3.0, 0.0),
    "np.square": (lambda t: np.square(t), "s^2", 2 * 0.7431, 0.0),
    "np.sqrt": (lambda t: np.sqrt(t * t), "s", 1.0, 0.0),
    "np.exp": (lambda t: np.exp(t), "", math.exp(0.7431), 0.0),
    "np.log": (lambda t: np.log(t), "", 1 / 0.7431, 0.0),
    "np.cos": (lambda t: np.cos(t), "", -math.sin(0.7431), 0.0),
    "np.arctan": (lambda t: np.arctan(t), "", 1 / (1 + 0.7431**2), 0.0),
    "np.float64 on the left": (lambda t: np.float64(2.0) * t, "s", 2.0, 0.0),
    "umath.sqrt": (lambda t: umath.sqrt(t), NO_UNIT, 0.5 / math.sqrt(0.7431), 0.0),
    "umath.log": (lambda t: umath.log(t), NO_UNIT, 1 / 0.7431, 0.0),
    "umath.atan2": (lambda t: umath.atan2(t, STIFFNESS), NO_UNIT, 14.0 / 196.5522, -0.7431 / 196.5522),
    "unumpy": (lambda t: unumpy.log(np.array([t]))[0], NO_UNIT, 1 / 0.7431, 0.0),
    "pandas": (lambda t: pd.Series([t, 3 * t]).sum(), "s", 4.0, 0.0),
    "copy": (lambda t: copy.copy(t), "s", 1.0, 0.0),
    "deepcopy": (lambda t: copy.deepcopy([t])[0], "s", 1.0, 0.0),
    "asdict": (lambda t: dataclasses.asdict(Kept(t))["value"], "s", 1.0, 0.0),
}


@dataclasses.dataclass
class Kept:
    """Something of a person's own that has a value."""

    value: Any


@pytest.mark.parametrize("name", WAYS)
def test_nothing_drops_the_uncertainty_or_a_unit_that_is_defined(name: str) -> None:
    """Against the first-order propagation by hand; where results have no such unit, there is none and no wrong one."""
    function, unit, by_period, by_stiffness = WAYS[name]
    found = function(PERIOD)
    assert isinstance(found, UFloat)
    assert found.std_dev == pytest.approx(math.hypot(by_period * 0.0002, by_stiffness * 0.1), rel=1e-6, abs=1e-17)
    assert getattr(found, "unit", None) == (None if unit is NO_UNIT else unit)


def test_nothing_is_made_uncertain_that_is_exact() -> None:
    """What depends on itself cancels, two alike do not, and half of an exact value is exact."""
    twin, exact = Estimate(0.7431, 0.0002, "s"), Estimate(4.0, 0.0)
    assert (PERIOD - PERIOD).std_dev == 0.0
    assert (PERIOD - twin).std_dev == pytest.approx(0.0002 * math.sqrt(2.0))
    assert (PERIOD, hash(PERIOD)) == (twin, hash(twin))
    assert exact / 2 == 2.0
    assert (exact / 2).u == 0.0


def test_a_value_stays_correlated_in_another_process() -> None:
    """A pickle keeps class, text, unit and what its values share."""
    period, double, limit = pickle.loads(pickle.dumps((PERIOD, 2 * PERIOD, UpperLimit(0.01, 0.02, "m"))))
    assert (period, repr(period), str(limit)) == (PERIOD, "0.74310(20) s", "< 0.047 m (95 %)")
    assert double - 2 * period == Estimate(0.0, 0.0, "s")


def test_copies_are_the_same_quantity() -> None:
    """What is made of a copy cancels with the original."""
    for copied in (copy.copy(PERIOD), copy.deepcopy(PERIOD), dataclasses.asdict(Kept(PERIOD))["value"]):
        assert (copied - PERIOD).u == 0.0
    assert uncertainties.correlation_matrix([PERIOD, copy.deepcopy(2 * PERIOD)])[0, 1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "lossy",
    [float, int, complex, math.log, math.floor, np.cbrt, np.float64, lambda x: np.array([x], dtype=float)],
    ids=["float", "int", "complex", "math.log", "math.floor", "cbrt", "float64", "array"],
)
def test_what_would_drop_the_uncertainty_is_refused(lossy: Callable[..., Any]) -> None:
    """A plain number is asked for by ``value``."""
    with pytest.raises(TypeError):
        lossy(PERIOD)
