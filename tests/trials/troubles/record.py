"""What a trial is made of: a record with its truth, the kind of trouble in it, and the findings that name that kind."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.trials.troubles.motion import F8, Bob, Motion, swing

# A value, or what it is where an analysis begins (s): amplitude and damping rate fall in the course of a record.
Truth = float | Callable[[float], float]

# The findings that name a cause, beside model_misfit, which says of any that the model does not describe the run.
CODES: Mapping[str, frozenset[str]] = {
    "clipped": frozenset({"clipped"}),
    "smoothed": frozenset({"smoothed_sensor"}),
    "held": frozenset({"held_samples", "quantised"}),
    "quantised": frozenset({"quantised"}),
    "few_samples": frozenset({"undersampled"}),
    "shape": frozenset({"not_sinusoidal"}),
    "stops": frozenset({"not_sinusoidal", "clipped"}),
    "contact": frozenset({"not_sinusoidal"}),
    "slack": frozenset({"not_sinusoidal", "amplitude_dependent_frequency"}),
    "scale": frozenset({"not_sinusoidal"}),
    "mirror": frozenset({"not_sinusoidal", "false_echoes"}),
    "backbone": frozenset({"amplitude_dependent_frequency"}),
    "frequency_drift": frozenset({"amplitude_dependent_frequency", "frequency_drift"}),
    "hum": frozenset({"implausible_motion", "no_oscillation"}),
    "hum_and_clip": frozenset({"clipped"}),
    "interleaved": frozenset({"no_oscillation"}),
    "impossible": frozenset({"implausible_motion", "implausible_distance"}),
    "came_to_rest": frozenset({"at_rest", "handled"}),
    "hours": frozenset({"at_rest", "handled", "quantised"}),
    "rows_lost": frozenset({"phase_jump", "restarted", "touched", "handled"}),
    "rows_doubled": frozenset({"phase_jump"}),
    "handled": frozenset({"at_rest", "handled", "restarted"}),
    "restarted": frozenset({"restarted", "handled", "touched", "phase_jump", "at_rest"}),
    "false_echoes": frozenset({"false_echoes"}),
    "missing": frozenset({"missing_samples"}),
    "correlated": frozenset({"smoothed_sensor"}),
    "noise": frozenset({"false_echoes"}),
    "rest": frozenset({"rest_drift"}),
    "rest_or_scale": frozenset({"rest_drift"}),
    "mode": frozenset({"sideways_mode"}),
    "modulated": frozenset({"sideways_mode"}),
    "driven": frozenset({"sideways_mode", "handled", "restarted", "phase_jump"}),
    "clock": frozenset({"amplitude_dependent_frequency", "jittered_time"}),
    "duplicate": frozenset({"duplicate_time", "non_monotonic_time"}),
    "joined": frozenset({"non_monotonic_time", "duplicate_time", "restarted"}),
    "strong": frozenset({"strongly_damped", "overdamped"}),
    "stopped": frozenset({"at_rest", "handled", "strongly_damped"}),
    "spring": frozenset({"spring_mass_missing"}),
    "air": frozenset({"air_temperature_missing"}),
    "described": frozenset(),
    "nothing": frozenset(),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """A record and what is true of it."""

    t: F8  # s
    y: F8  # m; NaN where none was measured
    truth: Mapping[str, Truth]  # by the name of the estimate; empty: nothing moves, so any period is wrong
    scene: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    text: bytes | None = None  # the file to be read instead of the arrays
    track: Mapping[str, Any] = field(default_factory=dict)  # what else is stated of the track: its clock and its sound


@dataclass(frozen=True)
class Kind:
    """A kind of trouble."""

    name: str
    cause: str
    make: Callable[[int], Record]  # of a seed
    cure: bool = False  # whether right numbers are asked for, and not only a warning
    spread: tuple[str, ...] = ()  # estimates whose u states how far something moves, by definition
    plain: bool = False  # whether it is a record without trouble, on which a warning is a false alarm

    @property
    def codes(self) -> frozenset[str]:
        """The findings that name it; a motion that the models describe is to be right, and no finding excuses it."""
        described = self.plain or self.cause == "described"
        return CODES[self.cause] if described else CODES[self.cause] | {"model_misfit", "halves_differ"}


def kind(
    name: str,
    cause: str,
    make: Callable[..., Record],
    *given: Any,
    cure: bool = False,
    spread: tuple[str, ...] = (),
    plain: bool = False,
    **named: Any,
) -> Kind:
    """Return a kind whose records a function makes of a seed and of what else it is given."""
    return Kind(name, cause, lambda seed: make(seed, *given, **named), cure, spread, plain)


class Bench:
    """What a seed and a kind's name draw: a bob, where it hangs, a sensor's noise; ``bob`` says what is not drawn."""

    def __init__(
        self, seed: int, key: str, *, seconds: float = 20.0, rate_hz: float = 100.0, sigma_m: float = 3e-4, **bob: Any
    ) -> None:
        self.rng = np.random.default_rng([seed, *key.encode()])
        drawn: dict[str, Any] = {
            "omega": self.rng.uniform(7.9, 8.7),
            "amplitude": self.rng.uniform(0.04, 0.06),
            "phase": self.rng.uniform(-math.pi, math.pi),
            "gamma": self.rng.uniform(0.008, 0.016),
            # Drag is mixed in every other record: no law is right in all.
            "beta": self.rng.uniform(0.1, 0.3) * (seed % 2),
        }
        self.bob = Bob(**{**drawn, **bob})
        self.rest_m = float(self.rng.uniform(0.28, 0.36))
        self.sigma_m, self.rate_hz = sigma_m, rate_hz
        self.t: F8 = np.arange(round(seconds * rate_hz)) / rate_hz
        self.motion: Motion = swing(self.bob, seconds)

    @property
    def seconds(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.t[-1])

    def distance(self, t: F8 | None = None) -> F8:
        """Return the true distance at t (n,), m; of the record's own times if left out."""
        return self.rest_m + self.motion.position(self.t if t is None else t)

    def noise(self, size: int | None = None) -> F8:
        """Return white normal noise, m."""
        return self.sigma_m * self.rng.standard_normal(self.t.size if size is None else size)

    def truth(self, *names: str) -> dict[str, Truth]:
        """Return what is true of the motion, of these names alone if any is given."""
        every: dict[str, Truth] = {
            "period": self.motion.period(0.0, self.seconds),
            "offset": self.rest_m,
            "amplitude": self.motion.amplitude,
            "damping_rate": self.motion.rate,
            **self.drag(),
        }
        return {name: every[name] for name in names or every}

    def drag(self) -> dict[str, Truth]:
        """Return the coefficients of the bob's drag by name, those that are zero among them."""
        bob = self.bob
        return {"c": bob.c, "n": bob.n} if bob.c else {name: getattr(bob, name) for name in ("mu", "gamma", "beta")}

    def record(self, y: F8, *names: str, t: F8 | None = None, **more: Truth) -> Record:
        """Return the record of distances y (n,), m, at the record's own times, or at t."""
        return Record(t=self.t if t is None else t, y=y, truth={**self.truth(*names), **more})
