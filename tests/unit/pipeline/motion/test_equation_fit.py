"""Strong drag and friction are told by the equation of motion, against an adaptive integration of it."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.sampling import sampled

OMEGA, START, ANGLE, MASS = 8.3, 0.1, 0.4, 0.2
SPRING = Scene.from_mapping({"bob": {"mass_kg": {"value": MASS, "u": 1e-9}}})
T = np.arange(2000) / 100.0
TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "12"))


@lru_cache
def moved(gamma: float, beta: float, mu: float) -> np.ndarray:
    """Return the displacement at T, m, by a method of order 8 from turning point to turning point."""
    drag, hold = 0.75 * math.pi * beta / OMEGA, 0.5 * math.pi * OMEGA * mu
    state = np.array([START * math.cos(ANGLE), -START * OMEGA * math.sin(ANGLE)])
    found, now = np.full(T.size, np.nan), 0.0
    way = math.copysign(1.0, state[1])
    while way and now < T[-1]:

        def pull(_: float, s: np.ndarray, way: float = way) -> list[float]:
            return [s[1], -(OMEGA**2) * s[0] - 2.0 * gamma * s[1] - drag * way * s[1] ** 2 - hold * way]

        def turns(_: float, s: np.ndarray) -> float:
            return float(s[1])

        turns.terminal, turns.direction = True, -way  # type: ignore[attr-defined]
        run = solve_ivp(
            pull, (now, T[-1] + 1.0), state, "DOP853", rtol=1e-10, atol=1e-13, events=turns, dense_output=True
        )
        rows = (run.t[-1] >= T) & (now <= T)
        if rows.any():
            found[rows] = run.sol(T[rows])[0]
        state, now = np.array([run.y[0, -1], 0.0]), float(run.t[-1])
        way = -math.copysign(1.0, state[0]) if OMEGA**2 * abs(state[0]) > hold else 0.0
    return np.where(np.isnan(found), state[0], found)


@lru_cache
def amplitude_at_start(gamma: float, beta: float, mu: float) -> float:
    """Return the amplitude at the first sample, m, from the turning points before and after it.

    Under linear drag the curve through the turning points lies at 1/sqrt(1 + (rate/omega)^2) of the amplitude.
    """
    drag, hold = 0.75 * math.pi * beta / OMEGA, 0.5 * math.pi * OMEGA * mu
    times, sizes = [], []
    for direction in (-1.0, 1.0):
        state = [START * math.cos(ANGLE), -START * OMEGA * math.sin(ANGLE)]
        now = 0.0
        for _ in range(4):
            way = math.copysign(1.0, state[1] if state[1] else -direction * state[0])

            def pull(_: float, s: np.ndarray, way: float = way, direction: float = direction) -> list[float]:
                force = -(OMEGA**2) * s[0] - 2.0 * gamma * s[1] - drag * way * s[1] ** 2 - hold * way
                return [direction * s[1], direction * force]

            # A turning point is left, not found again.
            def turns(at: float, s: np.ndarray, now: float = now, away: float = way) -> float:
                return float(s[1]) if at > now + 0.02 else away

            turns.terminal = True  # type: ignore[attr-defined]
            run = solve_ivp(
                pull, (now, now + 2.0), state, "DOP853", rtol=1e-11, atol=1e-14, events=turns, max_step=0.01
            )
            now, state = float(run.t[-1]), [run.y[0, -1], 0.0]
            times.append(direction * now)
            sizes.append(abs(state[0]))
            if OMEGA**2 * sizes[-1] <= hold and direction > 0.0:
                break
    order = np.argsort(times)
    # Under quadratic drag the inverse is nearly a straight line, under friction the amplitude itself.
    power = -1.0 if beta else 1.0 if mu else 0.01
    curve = CubicSpline(np.array(times)[order], np.array(sizes)[order] ** power)
    level, slope = float(curve(0.0)), float(curve(0.0, 1))
    return level ** (1.0 / power) * math.hypot(1.0, slope / level / power / OMEGA)


def analysed(coefficients: dict[str, float], seed: int, accuracy: float = 3e-4) -> Analysis:
    """Return the analysis of such a record with white noise, about a rest position of 300 mm."""
    y = moved(coefficients.get("gamma", 0.0), coefficients.get("beta", 0.0), coefficients.get("mu", 0.0))
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
@pytest.mark.parametrize(("law", "coefficients"), CASES)
def test_strong_damping_gives_law_spring_constant_and_coefficients(
    law: str, coefficients: dict[str, float], seed: int
) -> None:
    """The true law is admitted, and k, first amplitude, rest position and coefficients lie within 4 of their u."""
    result = analysed(coefficients, seed)
    assert isinstance(result.motion, Oscillation)
    damping = result.motion.damping
    assert "strongly_damped" in {finding.code for finding in result.findings}
    assert law in damping.admissible
    # Scale and spring have uncertainties that the noise does not contain.
    e, joint = result.motion.derived.statistical, damping.fits[law].joint
    first = amplitude_at_start(*(coefficients.get(name, 0.0) for name in ("gamma", "beta", "mu")))
    true = {"spring_constant": OMEGA**2 * MASS, "amplitude": first, "offset": 0.3}
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
    first = amplitude_at_start(*(coefficients.get(name, 0.0) for name in ("gamma", "beta", "mu")))
    true = {"spring_constant": OMEGA**2 * MASS, "amplitude": first, "offset": 0.3} | coefficients
    pulls = []
    for seed in range(TRIALS):
        y = 0.3 + moved(coefficients.get("gamma", 0.0), coefficients.get("beta", 0.0), coefficients.get("mu", 0.0))
        y = y + 3e-4 * np.random.default_rng((seed, 5)).standard_normal(T.size)
        result = analyse(replace(Track.from_arrays(T, y), clock="device"), SPRING)
        assert isinstance(result.motion, Oscillation)
        # Without the scale's and the sound's uncertainties, which do not scatter from run to run.
        found = result.motion.derived.statistical | result.motion.damping.fits[law].joint.estimates()
        pulls.append([abs(found[name].value - x) / found[name].u for name, x in true.items()])
    for level, width in ((0.6827, 1.0), (0.95, 1.959964)):
        shares = dict(zip(true, np.mean(np.array(pulls) <= width, axis=0).round(3).tolist(), strict=True))
        print(f"{law} {coefficients}: of {TRIALS} intervals of {level:.0%} hold {shares}")
        slack = 0.03 + 3.3 * math.sqrt(level * (1.0 - level) / TRIALS)
        assert all(level - slack <= share <= level + slack for share in shares.values()), shares


@pytest.mark.trials
@pytest.mark.parametrize(("ratio", "seed"), [(0.03, 2), (0.03, 6), (0.03, 9), (0.03, 14), (0.1, 7), (0.1, 20)])
def test_friction_is_not_mistaken_for_a_drag_that_drives(ratio: float, seed: int) -> None:
    """Friction is found on records whose richest law ends at linear drag below zero, quadratic drag and friction."""
    y = 0.3 + moved(0.0, 0.0, ratio * OMEGA * START) + 3e-4 * np.random.default_rng((seed, 5)).standard_normal(T.size)
    result = analyse(Track.from_arrays(T, y))
    assert "strongly_damped" in {finding.code for finding in result.findings}
    assert isinstance(result.motion, Oscillation)
    assert result.motion.damping.selected == "friction"


def test_weak_damping_is_left_to_the_amplitude() -> None:
    """Below a damping ratio of 0.01 no equation of motion is solved."""
    result = analysed({"beta": 0.004 * OMEGA / START}, 1)
    assert "strongly_damped" not in {finding.code for finding in result.findings}


def test_false_echoes_leave_the_fit() -> None:
    """Five per cent of false echoes are flagged and move the spring constant by no more than its uncertainty allows."""
    y = 0.3 + moved(0.0, 0.03 * OMEGA / START, 0.0)
    rng = np.random.default_rng(4)
    y = y + 3e-4 * rng.standard_normal(T.size)
    echoes = rng.random(T.size) < 0.05
    y[echoes] = rng.uniform(0.1, 1.5, np.count_nonzero(echoes))
    result = analyse(Track.from_arrays(T, y), SPRING)
    assert isinstance(result.motion, Oscillation)
    k = result.motion.derived.statistical["spring_constant"]
    assert abs(k.value - OMEGA**2 * MASS) < 3.0 * k.u
    assert k.u < 3e-4 * k.value
    assert result.quality["false_echo"] >= 0.9 * np.count_nonzero(echoes)


def test_a_motion_of_another_equation_is_not_forced_into_this_one() -> None:
    """A record whose drag grows with the cube of speed keeps the averaged law, and says that no solution follows it."""
    run = solve_ivp(
        lambda _, s: [s[1], -(OMEGA**2) * s[0] - 4.0 * s[1] ** 3],
        (0.0, T[-1]),
        [START, 0.0],
        "DOP853",
        t_eval=T,
        rtol=1e-10,
        atol=1e-13,
    )
    y = 0.3 + run.y[0] + 2e-5 * np.random.default_rng(2).standard_normal(T.size)
    codes = {finding.code for finding in analyse(Track.from_arrays(T, y), SPRING).findings}
    assert "strongly_damped" not in codes
    assert "not_converged" in codes


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
