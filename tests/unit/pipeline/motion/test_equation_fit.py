"""Strong drag and friction by the equation of motion, compared with the trials' own integration of it."""

import math
import os
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.sampling import sampled
from tests.trials.troubles.motion import Bob, swing

OMEGA, START, ANGLE, MASS = 8.3, 0.1, 0.4, 0.2
SPRING = Scene.from_mapping({"bob": {"mass_kg": {"value": MASS, "u": 1e-9}}})
T = np.arange(2000) / 100.0
TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "12"))


@lru_cache
def moved(gamma: float = 0.0, beta: float = 0.0, mu: float = 0.0) -> np.ndarray:
    """Return the displacement at T, m."""
    bob = Bob(omega=OMEGA, amplitude=START, phase=ANGLE, gamma=gamma, beta=beta, mu=mu)
    return swing(bob, float(T[-1]), start=0.0).position(T)


def analysed(coefficients: dict[str, float], seed: int, accuracy: float = 3e-4) -> Analysis:
    """Return the analysis of such a record with white noise, about a rest position of 300 mm."""
    y = moved(**coefficients)
    noise = accuracy * np.random.default_rng(seed).standard_normal(T.size)
    return analyse(Track.from_arrays(T, 0.3 + y + noise), SPRING)


CASES = [
    ("quadratic", {"beta": 0.03 * OMEGA / START}),
    ("quadratic", {"beta": 0.1 * OMEGA / START}),
    ("friction", {"mu": 0.03 * OMEGA * START}),
    ("friction", {"mu": 0.1 * OMEGA * START}),
    ("linear+quadratic", {"gamma": 0.05 * OMEGA, "beta": 0.05 * OMEGA / START}),
    ("quadratic+friction", {"beta": 0.018 * OMEGA / START, "mu": 0.012 * OMEGA * START}),
]


@pytest.mark.parametrize("seed", sampled(range(8), 1))
@pytest.mark.parametrize(("law", "coefficients"), sampled(CASES, 4))
def test_strong_damping_gives_law_spring_constant_and_coefficients(
    law: str, coefficients: dict[str, float], seed: int
) -> None:
    """The true law is admitted, and k, rest position and coefficients lie within 4 of their u."""
    result = analysed(coefficients, seed)
    damping = result.damping
    assert "strongly_damped" in {finding.code for finding in result.findings}
    assert law in damping.admissible
    # Scale and spring have uncertainties that the noise does not contain.
    e, joint = result.derived.statistical, damping.fits[law].joint
    true = {"spring_constant": OMEGA**2 * MASS, "offset": 0.3}
    pulls = {name: (joint[name].value - x) / joint[name].u for name, x in coefficients.items()}
    if damping.selected == law:
        pulls |= {name: (e[name].value - x) / e[name].u for name, x in true.items()}
    assert max(map(abs, pulls.values())) < 4.0, pulls
    assert abs(e["noise"].value - 3e-4) < 4.0 * e["noise"].u < 0.8 * 3e-4


@pytest.mark.trials
@pytest.mark.parametrize(
    ("law", "coefficients"),
    [
        ("linear+quadratic", {"gamma": 0.015 * OMEGA, "beta": 0.015 * OMEGA / START}),
        ("quadratic", {"beta": 0.1 * OMEGA / START}),
        ("friction", {"mu": 0.03 * OMEGA * START}),
    ],
)
def test_intervals_hold_under_strong_damping(law: str, coefficients: dict[str, float]) -> None:
    """At damping ratios of 0.03 and 0.1 intervals of 68 and 95 % hold so often, for k and for each coefficient."""
    true = {"spring_constant": OMEGA**2 * MASS, "offset": 0.3} | coefficients
    pulls = []
    for seed in range(TRIALS):
        y = 0.3 + moved(**coefficients) + 3e-4 * np.random.default_rng((seed, 5)).standard_normal(T.size)
        result = analyse(replace(Track.from_arrays(T, y), clock="device"), SPRING)
        # Without the scale's and the sound's uncertainties, which do not scatter from run to run.
        found = result.derived.statistical | result.damping.fits[law].joint.estimates()
        pulls.append([abs(found[name].value - x) / found[name].u for name, x in true.items()])
    for level, width in ((0.6827, 1.0), (0.95, 1.959964)):
        shares = dict(zip(true, np.mean(np.array(pulls) <= width, axis=0).round(3).tolist(), strict=True))
        print(f"{law} {coefficients}: of {TRIALS} intervals of {level:.0%} hold {shares}")
        slack = 0.03 + 3.3 * math.sqrt(level * (1.0 - level) / TRIALS)
        assert all(level - slack <= share <= level + slack for share in shares.values()), shares


def test_false_echoes_leave_the_fit() -> None:
    """Five per cent of false echoes are flagged and move the spring constant by no more than its uncertainty allows."""
    y = 0.3 + moved(beta=0.03 * OMEGA / START)
    rng = np.random.default_rng(4)
    y = y + 3e-4 * rng.standard_normal(T.size)
    echoes = rng.random(T.size) < 0.05
    y[echoes] = rng.uniform(0.1, 1.5, np.count_nonzero(echoes))
    result = analyse(Track.from_arrays(T, y), SPRING)
    k = result.derived.statistical["spring_constant"]
    assert abs(k.value - OMEGA**2 * MASS) < 3.0 * k.u
    assert k.u < 3e-4 * k.value
    assert result.quality["false_echo"] >= 0.9 * np.count_nonzero(echoes)


def test_what_swings_up_and_stops_is_no_drag_that_drives() -> None:
    """A neighbour sets a bob going and takes it back: no equation with a negative drag stands for that."""
    t = np.arange(1830) / 19.73
    envelope = np.where(t < 38.0, 0.00035 * t * np.exp(1.0 - t / 10.0), 0.0)
    y = 0.5 + envelope * np.cos(2.0 * np.pi * t / 1.4127 - 0.3 * np.sin(t / 6.0))
    y += 0.0005 * np.random.default_rng(0).standard_normal(t.size)
    found = analyse(Track.from_arrays(t, np.round(y, 3)))
    codes = {each.code for each in found.findings}
    assert "strongly_damped" not in codes
    assert not codes.isdisjoint(("not_converged", "no_law_fits", "no_oscillation"))
