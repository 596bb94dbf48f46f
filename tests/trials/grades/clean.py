"""Clean records of every law, in which each input that u counts is drawn from its assumed u, and their bars.

The bars compare with release 0.3.0 on the same records: ``released.npz`` has what it says of each of them. A check of
the model that finds faults in records without any is timid: values that are right would no longer be sound.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.analyse import analyse
from pipeline.bench.air import U_SOUND, speed_of_sound
from pipeline.bench.clock_rate import U_CRYSTAL
from pipeline.bench.scene import Scene
from pipeline.bench.spring import oscillating_mass_kg
from pipeline.track import Track
from tests.synthetic import LAW_TRUTHS
from tests.trials.grades.graded import Said, Truth, said_of
from tests.trials.troubles.motion import Bob, swing

RELEASED = Path(__file__).with_name("released.npz")
RECORDS = 4000
LAWS = ({}, *LAW_TRUTHS.values())
NOISES_M = (3e-4, 2e-3)
SHORTEST_S, LONGEST_S = 10.0, 600.0
MOST_SAMPLES = 6000
RATES_HZ = (100.0, 50.0, 20.0, 10.0)
JUDGED = ("period", "amplitude", "damping_rate", "spring_constant")
U_ZERO_M = 1e-3
STATED = {"bob": (0.2, 1e-4), "spring": (0.010, 2e-4), "temperature": (21.0, 0.5), "pressure": (101325.0, 500.0)}
STATED |= {"humidity": (0.5, 0.1)}


@dataclass(frozen=True)
class Record:
    """A record, the scene that is stated for it, and what is true of it."""

    track: Track
    scene: Scene
    truth: Mapping[str, Truth]


def make(seed: int) -> Record:
    """Return the record of a seed; laws and noises take turns, and all else is drawn."""
    rng = np.random.default_rng([75, seed])
    law, noise_m = LAWS[seed % len(LAWS)], NOISES_M[seed // len(LAWS) % len(NOISES_M)]
    seconds = math.exp(rng.uniform(math.log(SHORTEST_S), math.log(LONGEST_S)))
    rate_hz = next((rate for rate in RATES_HZ if rate * seconds <= MOST_SAMPLES), RATES_HZ[-1])
    stronger = math.exp(rng.uniform(math.log(0.3), math.log(4.0)))
    drag = {name: value if name == "n" else value * stronger for name, value in law.items()}
    omega, amplitude = rng.uniform(5.0, 9.0), rng.uniform(0.03, 0.07)
    motion = swing(Bob(omega=omega, amplitude=amplitude, phase=rng.uniform(-math.pi, math.pi), **drag), seconds)
    true = {name: value + u * rng.standard_normal() for name, (value, u) in STATED.items()}
    stated = {name: value for name, (value, _) in STATED.items()}
    air = ("temperature", "pressure", "humidity")
    sound = speed_of_sound(*(true[name] for name in air)) * (1.0 + U_SOUND * rng.standard_normal())
    scale = speed_of_sound(*(stated[name] for name in air)) / sound
    clock = 1.0 + math.sqrt(3.0) * U_CRYSTAL * rng.uniform(-1.0, 1.0)
    t = np.arange(round(seconds * rate_hz)) / rate_hz  # of the sensor, whose clock is fast by clock - 1
    rest_m = rng.uniform(0.28, 0.36) + U_ZERO_M * rng.standard_normal()
    y = rest_m + scale * motion.position(t / clock) + noise_m * rng.standard_normal(t.size)
    tables = {
        "bob": {"mass_kg": _stated("bob")},
        "spring": {"mass_kg": _stated("spring")},
        "air": {
            "temperature_c": _stated("temperature"),
            "pressure_pa": _stated("pressure"),
            "relative_humidity": _stated("humidity"),
        },
    }
    track = replace(Track.from_arrays(t, y, rate_hz=rate_hz, kind="simulated"), sonic=True, u_offset_m=U_ZERO_M)
    truth = {
        "period": motion.period(0.0, seconds / clock),
        "amplitude": lambda at: motion.amplitude(at / clock),
        "damping_rate": lambda at: motion.rate(at / clock),
        "spring_constant": omega**2 * oscillating_mass_kg(true["spring"], true["bob"]),
    }
    return Record(track, Scene.from_mapping(tables), truth)


def _stated(name: str) -> dict[str, float]:
    value, u = STATED[name]
    return {"value": value, "u": u}


def said_of_record(seed: int) -> tuple[Said, dict[str, float]]:
    """Return what the program says of the record of a seed, and the errors of its values in u."""
    record = make(seed)
    said = said_of(analyse(record.track, record.scene))
    return said, said.errors(record.truth)


@dataclass(frozen=True)
class Bar:
    """A number that must lie within limits."""

    name: str
    value: float
    least: float = -math.inf
    most: float = math.inf

    @property
    def met(self) -> bool:
        """Whether it does."""
        return self.least <= self.value <= self.most

    def __str__(self) -> str:
        limits = [f"at least {self.least:g}"] * (self.least > -math.inf) + [f"at most {self.most:g}"] * (
            self.most < math.inf
        )
        return f"{'met   ' if self.met else 'MISSED'} {self.name}: {self.value:.4f}, {', '.join(limits)}"


def bars(seeds: Iterable[int], outcomes: Iterable[tuple[Said, dict[str, float]]]) -> Iterator[Bar]:
    """Yield the bars of the records of some seeds.

    A share of few records is uncertain, so its limit is wider by 3.3 standard deviations of the binomial distribution.
    """
    rows = list(seeds)
    with np.load(RELEASED) as released:
        before_warnings, before_u, right = (released[name][rows] for name in ("warnings", "u", "right"))
    outcomes = list(outcomes)
    for k, name in enumerate(JUDGED):
        now = [(said.values[name], z[name]) if name in z else None for said, z in outcomes]
        sound = np.array([each is not None and each[0].sound for each in now])
        was = right[:, k]
        if was.any():
            stay = float(np.mean(sound[was]))
            yield Bar(
                f"{name}: share of what was sound and right that stays sound", stay, 0.97 - _doubt(0.97, was.sum())
            )
            both = was & sound
            growth = [now[i][0].u / before_u[i, k] for i in np.flatnonzero(both)]
            yield Bar(f"{name}: u over that of 0.3.0, in the median", float(np.median(growth or [1.0])), most=1.10)
        if sound.any():
            covered = float(np.mean([abs(now[i][1]) <= 1.959964 for i in np.flatnonzero(sound)]))
            doubt = _doubt(0.95, sound.sum()) if len(rows) < RECORDS else 0.0
            yield Bar(f"{name}: share of 95 % intervals that cover the truth", covered, 0.93 - doubt, 0.99 + doubt)
    new = [
        bool(said.warnings - set(before.split())) for (said, _), before in zip(outcomes, before_warnings, strict=True)
    ]
    yield Bar(
        "records with a warning that 0.3.0 does not give", float(np.mean(new)), most=0.015 + _doubt(0.015, len(rows))
    )


def _doubt(share: float, count: int) -> float:
    """Return 3.3 standard deviations of a share of so many records; 0 for large sets, for which the bars hold."""
    return 0.0 if count > RECORDS // 3 else 3.3 * math.sqrt(share * (1.0 - share) / count)
