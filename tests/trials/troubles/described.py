"""Motions that the models describe: a long gap, friction, strong damping, relaxations, two modes, a still bob.

No finding excuses a wrong number here. The motions are closed forms, or solved step by step where friction stops the
bob; the sensor may average samples, and its clock or the speed of sound may be off by what the track states.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from tests.trials.troubles.motion import F8
from tests.trials.troubles.record import Bench, Kind, Record, Truth

FAST = 0.005
"""How much faster than the host's the sensor's clock runs: as a ceramic resonator does."""
FAST_CLOCK = {"clock": "device", "rate_error": FAST, "u_rate_error": 1e-6}
DEVICE_CLOCK = {"clock": "device"}
SPRING: Mapping[str, Mapping[str, object]] = {
    "bob": {"mass_kg": {"value": 0.2, "u": 2e-6}},
    "spring": {"mass_kg": {"value": 1e-6, "u": 1e-8}},
}


def _long_gap(seed: int, gap_s: float) -> Record:
    """Two parts of 20 s of one motion, and nothing between them."""
    b = Bench(seed, f"gap {gap_s}", seconds=40.0 + gap_s)
    given = (b.t < 20.0) | (b.t >= 20.0 + gap_s)
    made = b.record((b.distance() + b.noise())[given], t=b.t[given], noise=b.sigma_m)
    return replace(made, track=DEVICE_CLOCK)


def _friction(seed: int, mu: float, *, seconds: float) -> Record:
    """Friction stops the bob; the other drag is small, and both its terms count for a share."""
    rng = np.random.default_rng([seed, 5])
    b = Bench(
        seed, f"friction {mu}", seconds=seconds, mu=mu, gamma=rng.uniform(0.005, 0.02), beta=rng.uniform(0.02, 0.2)
    )
    # Once it stopped, it hangs off the rest position that the motion was about, and the period is of what moved.
    truth = {name: value for name, value in b.truth().items() if name != "damping_rate"}
    last = float(b.motion.turns[0][-2]) if b.motion.t[-1] < b.seconds else b.seconds
    truth |= {"period": b.motion.period(0.0, last), "noise": b.sigma_m}
    return Record(t=b.t, y=b.distance() + b.noise(), truth=truth, track=DEVICE_CLOCK)


def _damped(seed: int, ratio: float, *, mean_of: int = 1, fast: float = 0.0, sigma_m: float = 3e-4) -> Record:
    """An oscillation of a damping ratio by linear drag, until little of it is left.

    The sensor may give the mean of some samples, and its clock may be fast.
    """
    rng = np.random.default_rng([seed, round(1e4 * ratio), mean_of, round(1e4 * fast)])
    natural, start, rest_m = rng.uniform(7.9, 8.7), rng.uniform(0.04, 0.06), rng.uniform(0.28, 0.36)
    gamma, angle = ratio * natural, rng.uniform(-math.pi, math.pi)
    omega = natural * math.sqrt(1.0 - ratio**2)
    t = np.arange(-mean_of, 100.0 * min(max(6.0 / gamma, 4.0), 30.0)) / 100.0
    y = rest_m + start * np.exp(-gamma * t) * np.cos(omega * t + angle) + sigma_m * rng.standard_normal(t.size)
    if mean_of > 1:
        y = np.convolve(y, np.full(mean_of, 1.0 / mean_of), "valid")
        t = t[mean_of - 1 :]
    truth: dict[str, Truth] = {
        "period": 2.0 * math.pi / omega,
        "offset": rest_m,
        "damping_rate": gamma,
        "spring_constant": 0.2 * natural**2,
        "mu": 0.0,
        "gamma": gamma,
        "beta": 0.0,
    }
    if mean_of == 1:
        # A mean is late, so that its amplitude is that of a moment ago.
        truth |= {"amplitude": _decaying(start, gamma / (1.0 + fast)), "noise": sigma_m}
    return Record(t=t * (1.0 + fast), y=y, truth=truth, scene=SPRING, track=FAST_CLOCK if fast else DEVICE_CLOCK)


def _relaxed(seed: int, ratio: float, *, fast: float = 0.0, scale: float = 1.0, sigma_m: float = 3e-4) -> Record:
    """A bob that comes back without swinging, let go from rest."""
    rng = np.random.default_rng([seed, round(1e4 * ratio), round(1e4 * fast)])
    natural, start, rest_m = rng.uniform(7.9, 8.7), rng.uniform(0.04, 0.06), rng.uniform(0.28, 0.36)
    t = np.arange(600) / 100.0
    truth: dict[str, Truth] = {"offset": rest_m, "noise": sigma_m, "spring_constant": 0.2 * natural**2}
    if ratio == 1.0:
        x = start * (1.0 + natural * t) * np.exp(-natural * t)
        truth["relaxation_rate"] = natural
    else:
        apart = natural * math.sqrt(ratio**2 - 1.0)
        slow, quick = ratio * natural - apart, ratio * natural + apart
        x = start * (quick * np.exp(-slow * t) - slow * np.exp(-quick * t)) / (quick - slow)
        truth |= {"relaxation_rate_slow": slow, "relaxation_rate_fast": quick}
    y = scale * (rest_m + x + sigma_m * rng.standard_normal(t.size))
    sound = {} if scale == 1.0 else {"speed_of_sound_m_per_s": 344.0}
    clock = FAST_CLOCK if fast else DEVICE_CLOCK
    return Record(t=t * (1.0 + fast), y=y, truth=truth, scene=SPRING, track={**clock, **sound})


def _decaying(start: float, rate: float) -> Callable[[float], float]:
    """Return the amplitude as a function of the stamped time."""
    return lambda at: start * math.exp(-rate * at)


def _two_modes(seed: int, ratio: float, *, seconds: float, fast: float = 0.0) -> Record:
    """Two modes of like strength, each with its own damping."""
    rng = np.random.default_rng([seed, round(1e4 * ratio), round(seconds), round(1e4 * fast)])
    first, rest_m = rng.uniform(7.9, 8.7), rng.uniform(0.28, 0.36)
    omegas, starts = (first, ratio * first), (0.04, 0.04 * rng.uniform(0.6, 0.9))
    gammas, angles = rng.uniform(0.003, 0.01, 2), rng.uniform(-math.pi, math.pi, 2)
    t, sigma_m = np.arange(round(100.0 * seconds)) / 100.0, 3e-4
    y: F8 = rest_m + sigma_m * rng.standard_normal(t.size)
    for omega, start, gamma, angle in zip(omegas, starts, gammas, angles, strict=True):
        y = y + start * np.exp(-gamma * t) * np.cos(omega * t + angle)
    truth: dict[str, Truth] = {"offset": rest_m, "noise": sigma_m, "period": 2.0 * math.pi / first}
    for name, omega, start, gamma in zip(("first", "second"), omegas, starts, gammas, strict=True):
        truth[f"{name}_mode_period"] = 2.0 * math.pi / omega
        truth[f"{name}_mode_amplitude"] = _decaying(start, gamma / (1.0 + fast))
    return Record(t=t * (1.0 + fast), y=y, truth=truth, track=FAST_CLOCK if fast else DEVICE_CLOCK)


def _still(seed: int, *, scale: float = 1.0) -> Record:
    """A bob that hangs still."""
    rng = np.random.default_rng([seed, 9, round(1e4 * scale)])
    rest_m, t = rng.uniform(0.28, 0.36), np.arange(1000) / 100.0
    sound = {} if scale == 1.0 else {"speed_of_sound_m_per_s": 344.0}
    y = scale * (rest_m + 3e-4 * rng.standard_normal(t.size))
    return Record(t=t, y=y, truth={"offset": rest_m, "noise": 3e-4}, track={**DEVICE_CLOCK, **sound})


def _named(name: str, make: Callable[..., Record], *given: float, **named: float) -> Kind:
    return Kind(name, "described", lambda seed: make(seed, *given, **named))


RATIOS = (0.02, 0.05, 0.1, 0.145, 0.2, 0.3)

KINDS = (
    *(_named(f"gap: {gap_s:g} s", _long_gap, gap_s) for gap_s in (10.0, 60.0)),
    *(_named(f"friction: stops the bob, {1e3 * mu:g} mm/s", _friction, mu, seconds=40.0) for mu in (1e-3, 2e-3, 4e-3)),
    *(_named(f"damped: ratio {ratio:g}", _damped, ratio) for ratio in RATIOS),
    *(
        _named(f"averaging sensor: {size} samples, ratio {ratio:g}", _damped, ratio, mean_of=size)
        for size in (2, 4)
        for ratio in RATIOS
    ),
    *(_named(f"fast clock: ratio {ratio:g}", _damped, ratio, fast=FAST) for ratio in (0.005, *RATIOS)),
    *(_named(f"relaxation: ratio {ratio:g}", _relaxed, ratio) for ratio in (1.0, 1.6)),
    *(
        _named(f"relaxation: ratio {ratio:g}, fast clock", _relaxed, ratio, fast=FAST, sigma_m=3e-5)
        for ratio in (1.0, 1.6)
    ),
    _named("relaxation: ratio 1.6, air not stated", _relaxed, 1.6, scale=0.997),
    _named("two modes: ratio 1.06", _two_modes, 1.06, seconds=30.0),
    _named("two modes: ratio 1.06, for a minute", _two_modes, 1.06, seconds=60.0),
    _named("two modes: ratio 1.06, fast clock", _two_modes, 1.06, seconds=30.0, fast=FAST),
    _named("two modes: ratio 1.5", _two_modes, 1.5, seconds=30.0),
    _named("still bob", _still),
    _named("still bob: air not stated", _still, scale=0.997),
)
