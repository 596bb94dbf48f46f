"""Troubles of the motion: the hand at start and end, another law than the fit's, a bench that is not still."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tests.trials.troubles.motion import F8, GRAVITY_M_PER_S2, swing
from tests.trials.troubles.record import Bench, Kind, Make, Record, Truth


def _eased(s: F8) -> F8:
    """A hand's way from 0 to 1."""
    inside = np.clip(s, 0.0, 1.0)
    return inside**3 * (10.0 - 15.0 * inside + 6.0 * inside**2)


def _released(still_s: float, *, hung: bool, seconds: float = 20.0) -> Make:
    """Still seconds at rest and a hand that lifts the bob, or seconds in which the hand holds it; then the release."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"released {still_s} {hung}", seconds=seconds)
        a = float(b.rng.uniform(0.04, 0.05))
        at = still_s + float(b.rng.uniform(0.0, 0.5)) + (0.8 if hung else 0.0)
        motion = swing(replace(b.bob, amplitude=a, phase=0.0), seconds, start=at)
        before = a * _eased((b.t - (at - 0.7)) / 0.6) if hung else np.full(b.t.size, a)
        if not hung:
            # No hand holds still to less than a few tenths of a millimetre.
            before = before + 3e-4 * np.sin(2 * math.pi * 1.3 * b.t + b.rng.uniform(0, 6))
        x = np.where(b.t < at, before, motion.position(b.t))
        return b.record(
            b.rest_m + x + b.noise(),
            "offset",
            period=motion.period(at, seconds),
            amplitude=lambda t: motion.amplitude(max(t, at)),
            damping_rate=lambda t: motion.rate(max(t, at)),
        )

    return make


def _restarted(first_s: float, pause_s: float, *, amplitude: float = 0.035) -> Make:
    """The hand stops the bob and releases it again, with the one part longer than the other."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"restarted {first_s} {pause_s}", seconds=30.0)
        again = first_s + pause_s
        later = swing(replace(b.bob, amplitude=amplitude, phase=0.0), 30.0, start=again)
        stop = b.motion.position(np.array([first_s]))[0]
        way = _eased((b.t - first_s) / max(0.6 * pause_s, 1e-9))
        x = np.where(b.t < first_s, b.motion.position(b.t), stop + (amplitude - stop) * way)
        x = np.where(b.t < again, x, later.position(b.t))

        def amplitude_at(t: float) -> float:
            return b.motion.amplitude(t) if t < first_s else later.amplitude(max(t, again))

        def rate_at(t: float) -> float:
            return b.motion.rate(t) if t < first_s else later.rate(max(t, again))

        return b.record(b.rest_m + x + b.noise(), "period", "offset", amplitude=amplitude_at, damping_rate=rate_at)

    return make


def _touched(kick: float, at_s: float = 11.0) -> Make:
    """A touch takes a share of the velocity, in either direction, in a tenth of a second."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"touched {kick}", seconds=25.0)
        at = at_s + float(b.rng.uniform(-2.0, 2.0))
        here = np.array([at])
        x, v = float(b.motion.position(here)[0]), float(b.motion.velocity(here)[0])
        v += kick * b.motion.amplitude(at) * b.bob.omega
        later = swing(
            replace(b.bob, amplitude=math.hypot(x, v / b.bob.omega), phase=math.atan2(-v / b.bob.omega, x)),
            25.0,
            start=at,
        )

        def amplitude_at(t: float) -> float:
            return (b.motion if t < at else later).amplitude(t)

        def rate_at(t: float) -> float:
            return (b.motion if t < at else later).rate(t)

        moved = np.where(b.t < at, b.motion.position(b.t), later.position(b.t))
        y = b.rest_m + moved + b.noise()
        # The period between turning points of one side of the touch: across it the phase jumps.
        period = b.motion.period(0.0, at)
        return b.record(y, "offset", period=period, amplitude=amplitude_at, damping_rate=rate_at)

    return make


def _caught(seed: int) -> Record:
    """The hand stops the bob some seconds before the record ends, and holds it near its rest position."""
    b = Bench(seed, "caught", seconds=24.0)
    at = 17.0 + float(b.rng.uniform(-1.0, 1.0))
    x = b.motion.position(b.t)
    stop = b.motion.position(np.array([at]))[0]
    held = stop + (0.012 - stop) * _eased((b.t - at) / 0.4)
    return b.record(b.rest_m + np.where(b.t < at, x, held) + b.noise())


def _hand_in_beam(seed: int) -> Record:
    """In the last second and a half the sensor sees the hand that comes for the bob."""
    b = Bench(seed, "hand", seconds=20.0)
    hand = 0.12 + 0.03 * _eased((b.t - 18.5) / 1.2)
    return b.record(np.where(b.t < 18.5, b.distance(), hand) + b.noise())


def _at_rest_long_before(*, mu: float, gamma: float, seconds: float) -> Make:
    """A record that goes on long after the bob has come to rest."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"long {mu} {gamma}", seconds=seconds, gamma=gamma, mu=mu)
        end = min(seconds, b.motion.t[-1])
        last = min(end, 6.0 / gamma) if gamma else end
        y = b.distance() + b.noise()
        names = ("amplitude", "damping_rate") if not mu else ("amplitude",)
        # Where friction stops the bob it hangs a little off the rest position that the motion was about.
        return b.record(y, *(names if mu else (*names, "offset")), period=b.motion.period(0.0, last))

    return make


def _moving(key: str, *, seconds: float = 20.0, **bob: float) -> Make:
    """A bob of another law, measured well."""

    def make(seed: int) -> Record:
        b = Bench(seed, key, seconds=seconds, **bob)
        return b.record(b.distance() + b.noise())

    return make


def _hitting(seed: int) -> Record:
    """A stop in the bob's way that throws it back at a little less speed, until it does not reach there any more."""
    b = Bench(seed, "hitting", seconds=30.0, beta=0.0)
    omega, gamma, level = b.bob.omega, b.bob.gamma, -0.9 * b.bob.amplitude
    x, v, h, rows = b.bob.amplitude * math.cos(b.bob.phase), 0.0, 1e-3, []
    v = -b.bob.amplitude * omega * math.sin(b.bob.phase)
    last_hit = 0.0
    for k in range(10 * b.t.size):
        if k % 10 == 0:
            rows.append(x)
        v -= h * (omega * omega * x + 2.0 * gamma * v)
        x += h * v
        if x < level:
            x, v, last_hit = 2.0 * level - x, 0.97 * abs(v), k * h
    # A stop shortens every period; after its last hit the bob is free, and loses what drag takes.
    truth: dict[str, Truth] = {"offset": b.rest_m, "period": 2.0 * math.pi / math.sqrt(omega**2 - gamma**2)}
    truth["damping_rate"] = lambda t: gamma if t >= last_hit - 1.0 else math.nan
    return Record(t=b.t, y=b.rest_m + np.array(rows) + b.noise(), truth=truth)


def _slack(excess: float) -> Make:
    """A bob that rises to where its spring hangs slack, by so much of the sag more than that, at the start."""

    def make(seed: int) -> Record:
        omega = 9.5
        sag = GRAVITY_M_PER_S2 / omega**2
        b = Bench(seed, f"slack {excess}", omega=omega, amplitude=sag * (1.0 + excess), gamma=0.01)
        return b.record(b.distance() + b.noise(), "period", "offset", "amplitude")

    return make


def _shape(how: str) -> Make:
    """A motion that is periodic and no sinusoid, without damping."""

    def make(seed: int) -> Record:
        b = Bench(seed, how)
        period, a = 2.0 * math.pi / b.bob.omega, b.bob.amplitude
        share = (b.t / period + b.rng.uniform()) % 1.0
        if how == "triangle":
            y = a * (4.0 * np.abs(share - 0.5) - 1.0)
        elif how == "bouncing":
            y = a * (8.0 * share * (1.0 - share) - 1.0)  # parabolas, one after another
        else:
            y = np.clip(1.3 * a * np.sin(2 * math.pi * share), -a, a)
        middle = b.rest_m
        return Record(t=b.t, y=middle + y + b.noise(), truth={"period": period, "amplitude": a, "damping_rate": 0.0})

    return make


def _drifting_rest(how: str, size_m: float) -> Make:
    """A rest position that moves: its truth is the mean."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"rest {how} {size_m}", seconds=40.0)
        s = b.t / b.seconds
        moved: F8 = np.zeros(b.t.size)
        if how == "line":
            moved += size_m * (s - 0.5)
        elif how == "wave":
            moved += 0.5 * size_m * np.sin(2 * math.pi * (1.3 * s + b.rng.uniform()))
        elif how == "creep":  # a spring or a clamp that gives, fastest at first
            moved += size_m * (1.0 - np.exp(-b.t / 8.0))
        else:
            moved += np.where(s > b.rng.uniform(0.3, 0.7), 0.5, -0.5) * size_m
        return b.record(b.distance() + moved + b.noise(), offset=b.rest_m + float(np.mean(moved)))

    return make


def _second_mode(ratio: float, size_m: float, seconds: float = 40.0) -> Make:
    """Another mode of the bench in the distances."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"mode {ratio} {size_m}", seconds=seconds)
        mode = size_m * np.cos(ratio * b.bob.omega * b.t + b.rng.uniform(0, 6))
        return b.record(b.distance() + mode + b.noise())

    return make


def _exchanging(seed: int) -> Record:
    """The bob gives its energy to a swing sideways and takes it back: amplitude and phase go to and fro."""
    b = Bench(seed, "exchange", seconds=40.0)
    depth, beat = 0.15, 2.0 * math.pi / b.rng.uniform(11.0, 15.0)
    start = b.rng.uniform(0, 6)
    factor = 1.0 + depth * np.cos(beat * b.t + start)
    return b.record(b.rest_m + b.motion.position(b.t) * factor + b.noise(), "period", "offset")


def _warming_air(seed: int) -> Record:
    """Air that warms by several kelvin: the scale of all distances grows, 0.18 % a kelvin."""
    b = Bench(seed, "warming", seconds=120.0)
    scale = 1.0 - 0.0018 * 6.0 * b.t / b.seconds
    return b.record(b.distance() * scale + b.noise(), "period", "amplitude", "offset")


def _warming_sensor(seed: int) -> Record:
    """A sensor that warms up: the scale of all distances grows by a hundredth, most of it at first."""
    b = Bench(seed, "warming sensor", seconds=30.0)
    return b.record(b.distance() * (1.0 + 0.01 * (1.0 - np.exp(-b.t / 20.0))) + b.noise())


def _steered(how: str) -> Make:
    """A periodic force: near its resonance, away from there, or sweeping through."""

    def make(seed: int) -> Record:
        omega = 8.3
        drive: dict[str, float] = {
            "near": {"drive": 0.02, "drive_omega": omega * 1.004},
            "aside": {"drive": 0.4, "drive_omega": omega * 0.8},
            "sweep": {"drive": 0.1, "drive_omega": omega * 0.9, "drive_chirp": omega * 0.2 / 40.0},
        }[how]
        b = Bench(seed, f"driven {how}", seconds=40.0, omega=omega, **drive)
        # Two periods stand side by side where the force is aside; else the period is what ran.
        period = 2.0 * math.pi / omega if how == "aside" else b.motion.period(0.0, b.seconds)
        return b.record(b.distance() + b.noise(), "offset", period=period)

    return make


def _heavy_spring(ratio: float, *, stated: bool) -> Make:
    """A spring of a good share of the bob's mass: its frequency is that of a rod with the bob at the end."""

    def make(seed: int) -> Record:
        rng = np.random.default_rng([seed, 77])
        bob_kg, k = 0.2, float(rng.uniform(13.0, 16.0))
        spring_kg = ratio * bob_kg
        # x tan x = m_s/M by bisection, omega = x sqrt(k/m_s).
        low, high = 1e-9, 0.5 * math.pi - 1e-9
        for _ in range(200):
            x = 0.5 * (low + high)
            low, high = (x, high) if x * math.tan(x) < ratio else (low, x)
        b = Bench(seed, f"spring {ratio}", seconds=40.0, omega=low * math.sqrt(k / spring_kg))
        scene: dict[str, dict[str, object]] = {"bob": {"mass_kg": {"value": bob_kg, "u": 2e-6}}}
        if stated:
            scene["spring"] = {"mass_kg": {"value": spring_kg, "u": 2e-6}}
        made = b.record(b.distance() + b.noise(), spring_constant=k)
        return replace(made, scene=scene)

    return make


def _stuck(seed: int) -> Record:
    """Dry friction that stops the bob within the record, off its rest position."""
    b = Bench(seed, "stuck", seconds=30.0, mu=2.5e-3, gamma=0.004)
    return b.record(b.distance() + b.noise(), "amplitude", period=b.motion.period(0.0, b.motion.t[-3]))


KINDS = (
    Kind(name="start: hangs 3 s, lifted, released", cause="handled", make=_released(3.0, hung=True), cure=True),
    Kind(name="start: hangs 8 s, lifted", cause="handled", make=_released(8.0, hung=True, seconds=40.0), cure=True),
    Kind(name="start: held 3 s, released", cause="handled", make=_released(3.0, hung=False), cure=True),
    Kind(name="start: held 1 s, released", cause="handled", make=_released(1.0, hung=False), cure=True),
    Kind(name="restarted late", cause="restarted", make=_restarted(20.0, 1.5), cure=True),
    Kind(name="restarted early", cause="restarted", make=_restarted(8.0, 1.5), cure=True),
    Kind(name="restarted without a pause", cause="restarted", make=_restarted(14.0, 0.3, amplitude=0.05), cure=True),
    Kind(name="touched: hard", cause="restarted", make=_touched(0.5), cure=True),
    Kind(name="touched: lightly", cause="restarted", make=_touched(0.08), cure=True),
    Kind(name="touched: hardly", cause="restarted", make=_touched(0.02)),
    Kind(name="end: caught and held", cause="handled", make=_caught, cure=True),
    Kind(name="end: a hand in the beam", cause="handled", make=_hand_in_beam, cure=True),
    Kind(
        name="rest: long before the end",
        cause="came_to_rest",
        make=_at_rest_long_before(mu=0.0, gamma=0.1, seconds=300.0),
        cure=True,
    ),
    Kind(
        name="rest: after friction, long before the end",
        cause="stopped",
        make=_at_rest_long_before(mu=1.2e-3, gamma=0.01, seconds=200.0),
        cure=True,
    ),
    Kind(name="friction: stops within the record", cause="stopped", make=_stuck, cure=True),
    Kind(name="shape: triangle", cause="shape", make=_shape("triangle")),
    Kind(name="shape: bouncing", cause="shape", make=_shape("bouncing")),
    Kind(name="shape: between two stops", cause="stops", make=_shape("stops")),
    Kind(name="shape: one stop, hit until out of reach", cause="contact", make=_hitting),
    Kind(name="slack spring: by 10 %", cause="slack", make=_slack(0.10)),
    Kind(name="slack spring: by 30 %", cause="slack", make=_slack(0.30)),
    Kind(name="spring: hardens", cause="backbone", make=_moving("hard", cubic=3.0, gamma=0.02, seconds=60.0)),
    Kind(name="spring: softens with amplitude", cause="backbone", make=_moving("soft", cubic=-6.0, seconds=60.0)),
    Kind(name="spring: warms", cause="frequency_drift", make=_moving("softening", seconds=60.0, drift=-1e-4)),
    Kind(name="air: warms", cause="rest_or_scale", make=_warming_air),
    Kind(name="sensor: warms", cause="rest_or_scale", make=_warming_sensor, spread=("offset",)),
    Kind(name="rest: drifts by 5 mm", cause="rest", make=_drifting_rest("line", 5e-3), cure=True, spread=("offset",)),
    Kind(name="rest: goes to and fro", cause="rest", make=_drifting_rest("wave", 3e-3), cure=True, spread=("offset",)),
    Kind(
        name="rest: creeps by 20 mm",
        cause="rest",
        make=_drifting_rest("creep", 20e-3),
        cure=True,
        spread=("offset",),
    ),
    Kind(name="rest: one step of 3 mm", cause="rest", make=_drifting_rest("step", 3e-3)),  # u of the rest spans both
    Kind(name="mode: sideways, 2 mm", cause="mode", make=_second_mode(0.71, 2e-3), cure=True),
    Kind(name="mode: sideways, 6 mm", cause="mode", make=_second_mode(0.62, 6e-3), cure=True),
    Kind(name="mode: beats, 3 mm", cause="mode", make=_second_mode(1.06, 3e-3)),
    Kind(name="mode: beats slower than the record", cause="mode", make=_second_mode(1.012, 2e-3, 30.0)),
    Kind(name="energy goes to and fro", cause="modulated", make=_exchanging),
    Kind(name="driven: near resonance", cause="driven", make=_steered("near")),
    Kind(name="driven: away from resonance", cause="driven", make=_steered("aside")),
    Kind(name="driven: sweeping", cause="driven", make=_steered("sweep")),
    Kind(name="drag: strong, 0.02", cause="strong", make=_moving("z2", gamma=0.166), cure=True),
    Kind(name="drag: strong, 0.08", cause="strong", make=_moving("z8", gamma=0.664), cure=True),
    Kind(name="drag: strong and quadratic", cause="strong", make=_moving("q", gamma=0.01, beta=6.0), cure=True),
    Kind(name="drag: power 1.5", cause="nothing", make=_moving("p", gamma=0.0, c=0.07, n=1.5, seconds=60.0), cure=True),
    Kind(
        name="drag: grows in the course",
        cause="nothing",
        make=_moving("n", gamma=0.0, c=0.0006, n=0.3, seconds=60.0),
        cure=True,
    ),
    Kind(name="spring's mass: 5 %, not stated", cause="spring", make=_heavy_spring(0.05, stated=False)),
    Kind(name="spring's mass: 13 %, not stated", cause="spring", make=_heavy_spring(0.135, stated=False)),
    Kind(name="spring's mass: 20 %, stated", cause="spring", make=_heavy_spring(0.2, stated=True), cure=True),
    Kind(name="spring's mass: 50 %, stated", cause="spring", make=_heavy_spring(0.5, stated=True), cure=True),
)
