"""Kinds of trouble in which one model does not describe the motion, made from seeds in plain numpy and scipy.

Each kind is that of a case of ``../shared/cases``; a seed draws rates, sizes and noises about those of the case. The
truth of a coefficient of a drag that is not there is zero.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.synthetic import F8, solved
from tests.trials.grades.graded import Said, Truth, said_of

GRAVITY_M_PER_S2 = 9.81


@dataclass(frozen=True, kw_only=True)
class Trouble:
    """A record and what is true of it."""

    t: F8
    y: F8
    truth: Mapping[str, Truth]
    unit: str = "m"
    scene: Mapping[str, Any] = field(default_factory=dict)

    def said(self) -> Said:
        """Return what the program says of it."""
        track = Track.from_arrays(self.t, self.y, unit=self.unit)
        return said_of(analyse(track, Scene.from_mapping(self.scene)))


class Draw:
    """What a seed draws of a kind."""

    def __init__(self, kind: str, seed: int) -> None:
        self.rng = np.random.default_rng([seed, *kind.encode()])

    def near(self, value: float, share: float = 0.2) -> float:
        """Return a number within a share of a value."""
        return value * float(self.rng.uniform(1.0 - share, 1.0 + share))

    def times(self, seconds: float, *rates_hz: float) -> F8:
        """Return the times of a record at one of some rates, s."""
        rate_hz = float(self.rng.choice(rates_hz))
        return np.arange(round(self.near(seconds, 0.1) * rate_hz)) / rate_hz

    def noise(self, t: F8, sigma: float) -> F8:
        """Return white noise."""
        return self.near(sigma, 0.5) * self.rng.standard_normal(t.size)


Maker = Callable[[Draw], Trouble]
NO_DRAG = {"beta": 0.0, "mu": 0.0}


def swung(t: F8, degrees: float, length_m: float, gamma: float) -> tuple[F8, F8]:
    """Return angle and angular velocity of a pendulum that is released at rest."""
    square = GRAVITY_M_PER_S2 / length_m
    return solved(lambda _, x, v: -square * math.sin(x) - 2.0 * gamma * v, math.radians(degrees), t)


# Issue 75


def strong_pendulum(draw: Draw) -> Trouble:
    """A pendulum under an eddy-current brake, released from a wide angle."""
    t, length_m, gamma = draw.times(16.0, 25.0, 50.0), draw.near(0.4, 0.1), draw.near(0.3)
    degrees = draw.near(30.0, 0.4)
    angle, _ = swung(t, degrees, length_m, gamma)
    small = math.tau / math.sqrt(GRAVITY_M_PER_S2 / length_m - gamma**2)
    wide = small * (1.0 + math.radians(degrees) ** 2 / 16.0)
    truth = {"amplitude": math.radians(degrees), "period": (small, wide), "period_small_swings": small}
    return Trouble(t=t, y=angle + draw.noise(t, math.radians(0.1)), truth=truth, unit="rad")


def strong_creep(draw: Draw) -> Trouble:
    """A strongly damped bob whose rest position creeps."""
    t, rate, period = draw.times(20.0, 50.0, 100.0), draw.near(0.4), draw.near(0.79, 0.1)
    creep_m = draw.near(0.004, 0.5)
    y = 0.4 + 0.05 * np.exp(-rate * t) * np.cos(math.tau * t / period) + creep_m * np.exp(-t / draw.near(3.0))
    truth = {"period": period, "amplitude": lambda at: 0.05 * math.exp(-rate * at), "damping_rate": rate}
    return Trouble(t=t, y=y + draw.noise(t, 1e-3), truth=truth | {"offset": (0.4, 0.4 + creep_m)})


def brake_switched(draw: Draw) -> Trouble:
    """A brake that is weakened in the middle of a run."""
    t, first, second = draw.times(30.0, 50.0, 100.0), draw.near(0.06), draw.near(0.02)
    at_s = float(t[-1]) * draw.near(0.5)
    log = first * np.minimum(t, at_s) + second * np.maximum(t - at_s, 0.0)
    period = draw.near(0.79, 0.1)
    y = 0.4 + 0.05 * np.exp(-log) * np.cos(math.tau * t / period) + draw.noise(t, 1.5e-3)
    truth = {"period": period, "amplitude": 0.05, "damping_rate": first, "gamma": (second, first), **NO_DRAG}
    return Trouble(t=t, y=y, truth=truth)


def moving_rest(draw: Draw) -> Trouble:
    """One of two gliders on a spring, which drift along the track together."""
    t, period, gamma = draw.times(12.0, 50.0, 25.0), draw.near(0.79, 0.1), draw.near(0.01)
    y = 0.3 + draw.near(0.06, 0.5) * t + 0.05 * np.exp(-gamma * t) * np.cos(math.tau * t / period)
    truth = {"period": period, "amplitude": 0.05, "damping_rate": gamma}
    return Trouble(t=t, y=y + draw.noise(t, 5e-4), truth=truth)


def cavendish_moved(draw: Draw) -> Trouble:
    """A torsion balance whose rest position jumps in the middle."""
    period, decay_s, seconds = draw.near(615.0, 0.1), draw.near(1500.0), draw.near(7200.0, 0.1)
    t = np.arange(0.0, seconds, 15.0)
    at_s = seconds * draw.near(0.5, 0.1)
    omega, shift = math.tau / period, draw.near(0.024)
    first = 0.12 + 0.04 * np.exp(-t / decay_s) * np.cos(omega * t)
    rate = 1.0 / decay_s
    x = 0.04 * math.exp(-rate * at_s) * math.cos(omega * at_s) + shift
    v = -rate * (x - shift) - 0.04 * omega * math.exp(-rate * at_s) * math.sin(omega * at_s)
    tau = np.maximum(t - at_s, 0.0)
    second = np.exp(-rate * tau) * (x * np.cos(omega * tau) + (v + rate * x) / omega * np.sin(omega * tau))
    y = np.where(t < at_s, first, 0.12 - shift + second) + draw.noise(t, 5e-4)
    truth = {"period": period, "damping_rate": rate}
    return Trouble(t=t, y=y, truth=truth | {"offset": lambda at: 0.12 if at < at_s else 0.12 - shift})


def turning_plane(draw: Draw) -> Trouble:
    """A pendulum whose plane turns, seen along one axis."""
    t, turn_s, gamma = draw.times(120.0, 20.0, 50.0), draw.near(1500.0), draw.near(0.003)
    y = 0.15 * np.exp(-gamma * t) * np.cos(math.pi * t) * np.cos(math.tau * t / turn_s) + draw.noise(t, 1e-3)
    return Trouble(t=t, y=y, truth={"period": 2.0, "amplitude": 0.15, "damping_rate": gamma, **NO_DRAG})


def ellipse(draw: Draw) -> Trouble:
    """A pendulum that swings in a narrow ellipse whose axes turn."""
    t, turn, gamma = draw.times(120.0, 20.0, 50.0), math.tau / draw.near(2000.0), draw.near(0.003)
    x = np.cos(math.pi * t) * np.cos(turn * t) - 0.2 * np.sin(math.pi * t) * np.sin(turn * t)
    y = 0.15 * np.exp(-gamma * t) * x + draw.noise(t, 1e-3)
    return Trouble(t=t, y=y, truth={"period": 2.0, "period_small_swings": 2.0, "damping_rate": gamma, **NO_DRAG})


def close_modes(draw: Draw) -> Trouble:
    """Two modes close to each other, for a part of a beat."""
    t, gamma, share = draw.times(40.0, 50.0, 25.0), draw.near(0.01), draw.near(0.3)
    first, second = 0.79, 0.79 / (1.0 + 0.3 / draw.near(1.0) * 0.79 / float(t[-1]))
    y = np.cos(math.tau * t / first) + share * np.cos(math.tau * t / second)
    y = 0.4 + 0.05 / (1.0 + share) * np.exp(-gamma * t) * y + draw.noise(t, 3e-4)
    truth = {"period": (second, first), "period_small_swings": (second, first), "damping_rate": gamma, **NO_DRAG}
    return Trouble(t=t, y=y, truth=truth)


def slack_string(draw: Draw) -> Trouble:
    """A bob on a spring and a string that goes slack in the first swings."""
    t, mass, stiffness, gamma = draw.times(40.0, 50.0, 100.0), draw.near(0.2), 14.0, draw.near(0.015)
    sag, square = GRAVITY_M_PER_S2 * mass / stiffness, stiffness / mass
    x, _ = solved(lambda _, x, v: -min(square * x, GRAVITY_M_PER_S2) - 2.0 * gamma * v, -draw.near(1.14, 0.1) * sag, t)
    return Trouble(
        t=t,
        y=0.4 + x + draw.noise(t, 5e-4),
        truth={"period_small_swings": math.tau / math.sqrt(square - gamma**2), "damping_rate": gamma, **NO_DRAG},
    )


# Issue 76


def magnitude(draw: Draw) -> Trouble:
    """The absolute value of an acceleration."""
    t, period, gamma = draw.times(30.0, 50.0, 100.0), draw.near(0.79, 0.1), draw.near(0.02)
    y = np.abs(3.2 * np.exp(-gamma * t) * np.cos(math.tau * t / period) + draw.noise(t, 0.02))
    return Trouble(t=t, y=y, truth={"period": period}, unit="m/s^2")


def radial_acceleration(draw: Draw) -> Trouble:
    """A phone on a pendulum, whose axis along the string is tilted a little."""
    t, degrees, tilt = draw.times(40.0, 50.0, 100.0), draw.near(12.0), math.radians(draw.near(3.0))
    angle, speed = swung(t, degrees, 1.0, 0.004)
    y = (GRAVITY_M_PER_S2 * np.cos(angle) + speed**2) * math.cos(tilt) + draw.noise(t, 0.005)
    small = math.tau / math.sqrt(GRAVITY_M_PER_S2)
    wide = small * (1.0 + math.radians(degrees) ** 2 / 16.0)
    truth = {"period": (small, wide), "period_small_swings": small}
    return Trouble(t=t, y=y + 0.008 * speed * math.sin(tilt) / 0.05, truth=truth, unit="m/s^2")


def magnet_pendulum(draw: Draw) -> Trouble:
    """A magnet on a pendulum over a magnetometer: one pulse at each passage."""
    t, degrees = draw.times(30.0, 50.0, 100.0), draw.near(12.0)
    angle, _ = swung(t, degrees, 1.0, 0.006)
    x = np.sin(angle) - draw.near(0.02)
    y = 200.0 + 300.0 / (1.0 + (x / 0.15) ** 2) ** 1.5 + draw.noise(t, 0.5)
    small = math.tau / math.sqrt(GRAVITY_M_PER_S2)
    wide = small * (1.0 + math.radians(degrees) ** 2 / 16.0)
    return Trouble(t=t, y=y, truth={"period": (small, wide), "period_small_swings": small}, unit="1")


def driven(draw: Draw) -> Trouble:
    """A bob at rest that a vibrator drives at nine tenths of its own frequency."""
    t, mass, stiffness, gamma = draw.times(60.0, 50.0), 0.2, draw.near(14.0), draw.near(0.05)
    square = stiffness / (mass + 0.01 / 3.0)
    drive = draw.near(0.9, 0.05) * math.sqrt(square)
    force = 0.02 * (square - drive**2)
    x, _ = solved(lambda at, x, v: -square * x - 2.0 * gamma * v + force * math.sin(drive * at), 0.0, t)
    scene = {"bob": {"mass_kg": {"value": mass, "u": 1e-4}}, "spring": {"mass_kg": {"value": 0.01, "u": 2e-4}}}
    return Trouble(
        t=t, y=0.4 + x + draw.noise(t, 3e-4), truth={"spring_constant": stiffness, "gamma": gamma}, scene=scene
    )


def mains_hum(draw: Draw) -> Trouble:
    """A ring-down with mains hum beside it."""
    t, f, rate = draw.times(12.0, 500.0), draw.near(7.3), draw.near(0.2)
    y = 0.3 * np.exp(-rate * t) * np.cos(math.tau * f * t) + draw.near(0.25) * np.cos(
        math.tau * draw.near(50.0, 4e-4) * t
    )
    return Trouble(t=t, y=y + draw.noise(t, 0.01), truth={"period": 1.0 / f, "damping_rate": rate}, unit="V")


def three_modes(draw: Draw) -> Trouble:
    """The first of three coupled pendulums."""
    t, gamma = draw.times(60.0, 20.0, 50.0), draw.near(0.01)
    frequencies = (1.0, draw.near(1.05, 0.01), draw.near(1.14, 0.01))
    y = sum(draw.near(0.018) * np.cos(math.tau * f * t) for f in frequencies) * np.exp(-gamma * t)
    periods = (1.0 / max(frequencies), 1.0)
    return Trouble(t=t, y=y + draw.noise(t, 5e-4), truth={"period": periods, "damping_rate": gamma})


def cantilever_overtone(draw: Draw) -> Trouble:
    """An accelerometer on a plucked beam, with an overtone that is at first as large."""
    t, f, rate = draw.times(30.0, 100.0, 200.0), draw.near(2.3, 0.1), draw.near(0.072)
    y = 10.0 * np.exp(-rate * t) * np.cos(math.tau * f * t)
    y += 10.0 * np.exp(-draw.near(0.45) * t) * np.cos(math.tau * 6.267 * f * t) + draw.noise(t, 0.2)
    truth = {"period": 1.0 / f, "damping_rate": rate, "amplitude": lambda at: 10.0 * math.exp(-rate * at), **NO_DRAG}
    return Trouble(t=t, y=y, truth=truth, unit="m/s^2")


def irregular_slow(draw: Draw) -> Trouble:
    """A sensor that sends less than two samples per period, at uneven times."""
    t = np.cumsum(draw.rng.exponential(0.3, 240) + 0.2)
    period = draw.near(0.79, 0.05)
    y = 0.26 + 0.05 * np.cos(math.tau * t / period) + draw.noise(t, 5e-4)
    return Trouble(t=np.round(t, 3), y=y, truth={"period": period})


def ambient(draw: Draw) -> Trouble:
    """A bridge that the wind shakes: white noise through a resonance."""
    from scipy.signal import lfilter

    rate_hz, f, ratio, seconds = 50.0, draw.near(2.1, 0.1), draw.near(0.01), draw.near(30.0, 0.1)
    omega = math.tau * f
    pole = np.exp((-ratio + 1j) * omega / rate_hz)
    white = draw.rng.standard_normal(round((seconds + 100.0) * rate_hz))
    y = lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], white)[round(100.0 * rate_hz) :]
    y *= 0.05 / y.std()
    t = np.arange(y.size) / rate_hz
    period, spread = 1.0 / f, 0.5 * math.sqrt(ratio / (math.tau * f * seconds)) / f
    truth = {"period": (period - spread, period + spread), "damping_rate": ratio * omega, **NO_DRAG}
    return Trouble(t=t, y=y + draw.noise(t, 5e-4), truth=truth, unit="m/s^2")


def cavendish_spot(draw: Draw) -> Trouble:
    """A torsion balance, whose period no spring of a laboratory has."""
    t, period, decay_s = np.arange(0.0, draw.near(3000.0), 15.0), draw.near(615.0), draw.near(1500.0)
    y = 0.12 + 0.085 * np.exp(-t / decay_s) * np.cos(math.tau * t / period) + draw.noise(t, 5e-4)
    return Trouble(t=t, y=y, truth={"period": period, "damping_rate": 1.0 / decay_s})


def leaking_mass(draw: Draw) -> Trouble:
    """A bob that loses mass evenly."""
    t, gamma, loss = draw.times(60.0, 50.0, 25.0), draw.near(0.01), draw.near(0.002, 0.8)
    seconds = float(t[-1])
    phase = math.tau / 0.79 * (t + 0.25 * loss * t**2 / seconds)
    periods = (0.79 / (1.0 + 0.5 * loss), 0.79)
    y = 0.4 + 0.05 * np.exp(-gamma * t) * np.cos(phase) + draw.noise(t, 3e-4)
    return Trouble(t=t, y=y, truth={"period": periods, "period_small_swings": periods, "damping_rate": gamma})


def frame_rate(draw: Draw) -> Trouble:
    """A video whose frame rate falls, with times that are frame numbers over the nominal rate."""
    count, gamma, slower = round(draw.near(900.0)), draw.near(0.02), draw.near(0.045)
    frame = np.arange(count)
    t = np.cumsum(1.0 / (30.0 * (1.0 - slower * frame / count)))
    y = 0.12 * np.exp(-gamma * t) * np.cos(math.tau * t / 1.2) + draw.noise(t, 5e-4)
    periods = (1.2 * (1.0 - slower), 1.2)
    return Trouble(t=frame / 30.0, y=y, truth={"period": periods, "period_small_swings": periods})


def pendulum_position(draw: Draw) -> Trouble:
    """The horizontal position of a pendulum that swings wide."""
    t = draw.times(60.0, 30.0)
    angle, _ = swung(t, draw.near(25.0, 0.4), 1.0, 0.004)
    truth = {"period_small_swings": math.tau / math.sqrt(GRAVITY_M_PER_S2), "gravity": GRAVITY_M_PER_S2}
    scene = {"pendulum": {"length_m": {"value": 1.0, "u": 1e-3}}}
    return Trouble(t=t, y=np.sin(angle) + draw.noise(t, 5e-4), truth=truth, scene=scene)


def pendulum_gyro(draw: Draw) -> Trouble:
    """The angular velocity of a pendulum that swings wide."""
    t = draw.times(60.0, 30.0, 100.0)
    _, speed = swung(t, draw.near(35.0, 0.3), 1.0, 0.004)
    truth = {"period_small_swings": math.tau / math.sqrt(GRAVITY_M_PER_S2), "gravity": GRAVITY_M_PER_S2}
    scene = {"pendulum": {"length_m": {"value": 1.0, "u": 1e-4}}}
    return Trouble(t=t, y=speed + draw.noise(t, 3e-3), truth=truth, unit="rad/s", scene=scene)


KINDS: Mapping[str, Maker] = {
    maker.__name__.replace("_", "-"): maker
    for maker in (
        strong_pendulum,
        strong_creep,
        brake_switched,
        moving_rest,
        cavendish_moved,
        turning_plane,
        ellipse,
        close_modes,
        slack_string,
        magnitude,
        radial_acceleration,
        magnet_pendulum,
        driven,
        mains_hum,
        three_modes,
        cantilever_overtone,
        irregular_slow,
        ambient,
        cavendish_spot,
        leaking_mass,
        frame_rate,
        pendulum_position,
        pendulum_gyro,
    )
}


def trouble(kind: str, seed: int) -> Trouble:
    """Return the record of a kind and a seed."""
    return KINDS[kind](Draw(kind, seed))
