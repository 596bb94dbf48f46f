"""Troubles of the motion: the hand at start and end, another law than the fit's, a bench that is not still."""

import math
from dataclasses import replace

import numpy as np

from tests.trials.troubles.motion import F8, GRAVITY_M_PER_S2, swing
from tests.trials.troubles.record import Bench, Record, Truth, kind


def _eased(s: F8) -> F8:
    """A hand's way from 0 to 1."""
    inside = np.clip(s, 0.0, 1.0)
    return inside**3 * (10.0 - 15.0 * inside + 6.0 * inside**2)


def _released(seed: int, still_s: float, *, hung: bool, seconds: float = 20.0) -> Record:
    """Still seconds at rest and a hand that lifts the bob, or seconds in which the hand holds it; then the release."""
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


def _restarted(seed: int, first_s: float, pause_s: float, *, amplitude: float = 0.035) -> Record:
    """The hand stops the bob and releases it again, with the one part longer than the other."""
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


def _touched(seed: int, kick: float, at_s: float = 11.0) -> Record:
    """A touch takes a share of the velocity, in either direction, in a tenth of a second."""
    b = Bench(seed, f"touched {kick}", seconds=25.0)
    at = at_s + float(b.rng.uniform(-2.0, 2.0))
    here = np.array([at])
    x, v = float(b.motion.position(here)[0]), float(b.motion.velocity(here)[0])
    v += kick * b.motion.amplitude(at) * b.bob.omega
    later = swing(
        replace(b.bob, amplitude=math.hypot(x, v / b.bob.omega), phase=math.atan2(-v / b.bob.omega, x)), 25.0, start=at
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


def _at_rest_long_before(seed: int, *, mu: float, gamma: float, seconds: float) -> Record:
    """A record that goes on long after the bob has come to rest."""
    b = Bench(seed, f"long {mu} {gamma}", seconds=seconds, gamma=gamma, mu=mu)
    end = min(seconds, b.motion.t[-1])
    last = min(end, 6.0 / gamma) if gamma else end
    y = b.distance() + b.noise()
    names = ("amplitude", "damping_rate") if not mu else ("amplitude",)
    # Where friction stops the bob it hangs a little off the rest position that the motion was about.
    return b.record(y, *(names if mu else (*names, "offset")), period=b.motion.period(0.0, last))


def _moving(seed: int, key: str, *, seconds: float = 20.0, **bob: float) -> Record:
    """A bob of another law, measured well."""
    b = Bench(seed, key, seconds=seconds, **bob)
    return b.record(b.distance() + b.noise())


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


def _slack(seed: int, excess: float) -> Record:
    """A bob that rises to where its spring hangs slack, by so much of the sag more than that, at the start."""
    omega = 9.5
    sag = GRAVITY_M_PER_S2 / omega**2
    b = Bench(seed, f"slack {excess}", omega=omega, amplitude=sag * (1.0 + excess), gamma=0.01)
    return b.record(b.distance() + b.noise(), "period", "offset", "amplitude")


def _shape(seed: int, how: str) -> Record:
    """A motion that is periodic and no sinusoid, without damping."""
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


def _drifting_rest(seed: int, how: str, size_m: float) -> Record:
    """A rest position that moves: its truth is the mean."""
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


def _second_mode(seed: int, ratio: float, size_m: float, seconds: float = 40.0) -> Record:
    """Another mode of the bench in the distances."""
    b = Bench(seed, f"mode {ratio} {size_m}", seconds=seconds)
    mode = size_m * np.cos(ratio * b.bob.omega * b.t + b.rng.uniform(0, 6))
    return b.record(b.distance() + mode + b.noise())


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


def _steered(seed: int, how: str) -> Record:
    """A periodic force: near its resonance, away from there, or sweeping through."""
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


def _heavy_spring(seed: int, ratio: float, *, stated: bool) -> Record:
    """A spring of a good share of the bob's mass: its frequency is that of a rod with the bob at the end."""
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


def _stuck(seed: int) -> Record:
    """Dry friction that stops the bob within the record, off its rest position."""
    b = Bench(seed, "stuck", seconds=30.0, mu=2.5e-3, gamma=0.004)
    return b.record(b.distance() + b.noise(), "amplitude", period=b.motion.period(0.0, b.motion.t[-3]))


KINDS = (
    kind("start: hangs 3 s, lifted, released", "handled", _released, 3.0, hung=True, cure=True),
    kind("start: hangs 8 s, lifted", "handled", _released, 8.0, hung=True, seconds=40.0, cure=True),
    kind("start: held 3 s, released", "handled", _released, 3.0, hung=False, cure=True),
    kind("start: held 1 s, released", "handled", _released, 1.0, hung=False, cure=True),
    kind("restarted late", "restarted", _restarted, 20.0, 1.5, cure=True),
    kind("restarted early", "restarted", _restarted, 8.0, 1.5, cure=True),
    kind("restarted without a pause", "restarted", _restarted, 14.0, 0.3, amplitude=0.05, cure=True),
    kind("touched: hard", "restarted", _touched, 0.5, cure=True),
    kind("touched: lightly", "restarted", _touched, 0.08, cure=True),
    kind("touched: hardly", "restarted", _touched, 0.02),
    kind("end: caught and held", "handled", _caught, cure=True),
    kind("end: a hand in the beam", "handled", _hand_in_beam, cure=True),
    kind(
        "rest: long before the end", "came_to_rest", _at_rest_long_before, mu=0.0, gamma=0.1, seconds=300.0, cure=True
    ),
    kind(
        "rest: after friction, long before the end",
        "stopped",
        _at_rest_long_before,
        mu=1.2e-3,
        gamma=0.01,
        seconds=200.0,
        cure=True,
    ),
    kind("friction: stops within the record", "stopped", _stuck, cure=True),
    kind("shape: triangle", "shape", _shape, "triangle"),
    kind("shape: bouncing", "shape", _shape, "bouncing"),
    kind("shape: between two stops", "stops", _shape, "stops"),
    kind("shape: one stop, hit until out of reach", "contact", _hitting),
    kind("slack spring: by 10 %", "slack", _slack, 0.10),
    kind("slack spring: by 30 %", "slack", _slack, 0.30),
    kind("spring: hardens", "backbone", _moving, "hard", cubic=3.0, gamma=0.02, seconds=60.0),
    kind("spring: softens with amplitude", "backbone", _moving, "soft", cubic=-6.0, seconds=60.0),
    kind("spring: warms", "frequency_drift", _moving, "softening", seconds=60.0, drift=-1e-4),
    kind("air: warms", "rest_or_scale", _warming_air),
    kind("sensor: warms", "rest_or_scale", _warming_sensor, spread=("offset",)),
    kind("rest: drifts by 5 mm", "rest", _drifting_rest, "line", 5e-3, cure=True, spread=("offset",)),
    kind("rest: goes to and fro", "rest", _drifting_rest, "wave", 3e-3, cure=True, spread=("offset",)),
    kind("rest: creeps by 20 mm", "rest", _drifting_rest, "creep", 20e-3, cure=True, spread=("offset",)),
    kind("rest: one step of 3 mm", "rest", _drifting_rest, "step", 3e-3),  # u of the rest spans both
    kind("mode: sideways, 2 mm", "mode", _second_mode, 0.71, 2e-3, cure=True),
    kind("mode: sideways, 6 mm", "mode", _second_mode, 0.62, 6e-3, cure=True),
    kind("mode: beats, 3 mm", "mode", _second_mode, 1.06, 3e-3),
    kind("mode: beats slower than the record", "mode", _second_mode, 1.012, 2e-3, 30.0),
    kind("energy goes to and fro", "modulated", _exchanging),
    kind("driven: near resonance", "driven", _steered, "near"),
    kind("driven: away from resonance", "driven", _steered, "aside"),
    kind("driven: sweeping", "driven", _steered, "sweep"),
    kind("drag: strong, 0.02", "strong", _moving, "z2", gamma=0.166, cure=True),
    kind("drag: strong, 0.08", "strong", _moving, "z8", gamma=0.664, cure=True),
    kind("drag: strong and quadratic", "strong", _moving, "q", gamma=0.01, beta=6.0, cure=True),
    kind("drag: power 1.5", "nothing", _moving, "p", gamma=0.0, beta=0.0, c=0.07, n=1.5, seconds=60.0, cure=True),
    kind(
        "drag: grows in the course",
        "nothing",
        _moving,
        "n",
        gamma=0.0,
        beta=0.0,
        c=0.0006,
        n=0.3,
        seconds=60.0,
        cure=True,
    ),
    kind("spring's mass: 5 %, not stated", "spring", _heavy_spring, 0.05, stated=False),
    kind("spring's mass: 13 %, not stated", "spring", _heavy_spring, 0.135, stated=False),
    kind("spring's mass: 20 %, stated", "spring", _heavy_spring, 0.2, stated=True, cure=True),
    kind("spring's mass: 50 %, stated", "spring", _heavy_spring, 0.5, stated=True, cure=True),
)
