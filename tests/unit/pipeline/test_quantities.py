"""Angles, voltages, accelerations and forces through the whole analysis: their own units, and what needs a length."""

import re

import numpy as np
import pytest

from acquisition.block import UNITS
from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.errors import AnalysisError, TrackError
from pipeline.results.classic import classic
from pipeline.several.compare import SpringRun
from pipeline.track import Track
from tests.sampling import sampled
from tests.synthetic import Truth, noisy, times

TRUTH = Truth(gamma=0.0073, beta=0.235)
SIGMA = 3e-4
SCENE = Scene.from_mapping(
    {
        "bob": {"mass_kg": {"value": 0.2, "u": 1e-4}},
        "disc": {"diameter_m": {"value": 0.1, "u": 1e-3}},
        "air": {"temperature_c": 20.0},
    }
)
every = pytest.mark.parametrize("unit", sampled(list(UNITS.values())[1:], 3))


def track(unit: str = "m", *, seconds: float = 60.0, seed: int = 1) -> Track:
    """Return the same numbers as a record of one quantity."""
    t = times(seconds)
    return Track.from_arrays(t, noisy(TRUTH, t, SIGMA, seed), unit=unit)


@every
def test_the_same_numbers_give_the_same_results_in_their_own_unit(unit: str) -> None:
    """Whatever a record is of, period, damping and amplitudes are those of a length, and only the units differ."""
    length, other = analyse(track()), analyse(track(unit))
    for name in ("period", "frequency", "damping_rate", "quality_factor", "phase"):
        assert other.estimates[name] == length.estimates[name], name
    for name in ("amplitude", "offset", "noise"):
        mine, its = other.estimates[name], length.estimates[name]
        assert (mine.value, mine.u) == (its.value, its.u)
        assert (mine.unit, its.unit) == (unit, "m")
    assert other.damping.selected == length.damping.selected == "linear+quadratic"
    units = dict(zip(*(getattr(other.damping.best.joint, each) for each in ("names", "units")), strict=True))
    per = {
        "rad": "1/(rad s)",
        "V": "1/(V s)",
        "m/s": "1/m",
        "rad/s": "1/rad",
        "m/s^2": "s/m",
        "N": "1/(N s)",
        "1": "1/s",
    }
    assert units == {"A0": unit, "gamma": "1/s", "beta": per[unit]}
    assert other.derived.coefficients["beta"].unit == per[unit]


@every
def test_no_number_is_in_metres_where_nothing_was_measured_in_them(unit: str) -> None:
    """Units of estimates, budgets, laws and effects, with a bench that knows everything."""
    found = analyse(track(unit), SCENE)
    units = {name: each.unit for name, each in found.estimates.items()}
    units |= {f"budget {name}": each.estimate.unit for name, each in found.derived.budgets.items()}
    units |= {f"effect {each.name}": each.unit for each in found.effects}
    for name, fit in found.damping.fits.items():
        units |= {f"{name} {x}": own for x, own in zip(fit.joint.names, fit.joint.units, strict=True)}
    needless = {name for name, own in units.items() if re.search(r"\bm\b", own.replace(unit, ""))}
    # A mass and a period give N/m whatever was recorded; an acceleration gives lengths by omega^2.
    allowed = {"spring_constant", "budget spring_constant"}
    if unit in ("m/s", "m/s^2"):
        derived = ("displacement_amplitude", "velocity_rms")
        allowed |= {*derived, *(f"budget {name}" for name in derived)}
        own = ("m/s^2", "m/s^3", "1/m", "s/m", f"({unit})^(1-n)/s")
        needless = {name for name in needless if units[name] not in own}
    assert needless <= allowed


@pytest.mark.parametrize("order", [1, 2])
def test_a_derivative_gives_the_displacement_and_what_follows_from_it(order: int) -> None:
    """Of a velocity or an acceleration amplitude, Reynolds number, drag and energy are the bob's, within two u."""
    t = times(60.0)
    start, lam = TRUTH.amplitude, TRUTH.gamma + TRUTH.beta * TRUTH.amplitude
    displacement = TRUTH.position(t) - TRUTH.offset
    noise = np.random.default_rng(4).standard_normal(t.size)
    if order == 2:
        y = 9.81 + TRUTH.omega**2 * displacement + 0.02 * noise
        by_derivative = analyse(Track.from_arrays(t, y, unit="m/s^2"), SCENE)
    else:
        # A central difference is smaller than the velocity by sin(omega h)/(omega h).
        y = np.gradient(displacement, t, edge_order=2) / np.sinc(TRUTH.omega * (t[1] - t[0]) / np.pi) + 0.0025 * noise
        by_derivative = analyse(Track.from_arrays(t, y, unit="m/s"), SCENE)
    by_length = analyse(track(), SCENE)
    amplitude = by_derivative.estimates["displacement_amplitude"]
    assert amplitude.unit == "m"
    assert abs(amplitude.value - start) < 2.5 * amplitude.u < 0.01 * start
    assert abs(by_derivative.estimates["damping_rate"].value - lam) < 3.0 * by_derivative.estimates["damping_rate"].u
    names = ("velocity_rms", "reynolds_number", "keulegan_carpenter_number", "spring_constant")
    drag = "drag_coefficient"
    both = drag in by_derivative.estimates and drag in by_length.estimates
    for name in (*names, drag) if both else names:
        mine, its = by_derivative.estimates[name], by_length.estimates[name]
        assert mine.unit == its.unit
        assert abs(mine.value - its.value) < 3.0 * np.hypot(mine.u, its.u), name


def test_what_needs_a_length_says_so_in_one_line() -> None:
    """The report's own method, and springs compared by a pendulum's angle."""
    with pytest.raises(TrackError, match="length in m, got voltage in V"):
        classic(track("V"))
    found = analyse(track("rad"), SCENE)
    with pytest.raises(AnalysisError, match=r"^swing: "):
        SpringRun.of("swing", found.derived)
    assert SpringRun.of("coil", analyse(track("V"), SCENE).derived).clock == ""
