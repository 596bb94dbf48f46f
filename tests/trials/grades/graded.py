"""What the program says of a recording: values with their grades, and the codes of its warnings."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis
from pipeline.track import UNUSABLE
from springmass.result.grades import grades_of

F8 = NDArray[np.float64]
# A value, a range in which it lies, or a function of the time (s) for which the program states it.
Truth = float | tuple[float, float] | Callable[[float], float]


@dataclass(frozen=True)
class Graded:
    """A printed value."""

    value: float
    u: float
    sound: bool

    def z(self, truth: float | tuple[float, float]) -> float:
        """Return the distance from the truth in standard uncertainties."""
        low, high = truth if isinstance(truth, tuple) else (truth, truth)
        error = self.value - min(max(self.value, low), high)
        return error / self.u if self.u > 0.0 else math.copysign(math.inf, error) if error else 0.0


@dataclass(frozen=True)
class Said:
    """What the program says of a recording."""

    values: Mapping[str, Graded] = field(default_factory=dict)
    warnings: frozenset[str] = frozenset()
    start_s: float = 0.0  # time at which amplitude and damping rate are stated

    def errors(self, truths: Mapping[str, Truth]) -> dict[str, float]:
        """Return the errors of the printed values that have a truth, in standard uncertainties."""
        by_name = {name: truth(self.start_s) if callable(truth) else truth for name, truth in truths.items()}
        return {name: self.values[name].z(truth) for name, truth in by_name.items() if name in self.values}

    def wrong(self, truths: Mapping[str, Truth], limit: float) -> dict[str, float]:
        """Return the errors of the sound values that lie beyond a limit, in standard uncertainties."""
        errors = self.errors(truths)
        return {name: z for name, z in errors.items() if self.values[name].sound and not abs(z) <= limit}


def said_of(analysis: Analysis) -> Said:
    """Return what the program says of an analysed recording; a value without a grade passes for sound."""
    grades = grades_of(analysis)
    every = dict(analysis.estimates)
    start_s = float(analysis.track.t[np.argmax((analysis.flags & UNUSABLE) == 0)])
    if (motion := analysis.oscillation) is not None:
        start_s = motion.phase.t0
        if analysis.derived.quoted:
            every = {**analysis.derived.coefficients, **every}
    values = {
        name: Graded(float(x.value), float(x.u), name not in grades or grades[name].grade == "sound")
        for name, x in every.items()
    }
    return Said(values, frozenset(f.code for f in analysis.findings if f.severity != "info"), start_s)
