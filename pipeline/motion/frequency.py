"""How the frequency changes during a run: with the amplitude, with time, or not at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from pipeline.damping.laws import Law
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import VERY_STRONG
from pipeline.numerics.regression import Line, Scatter, solve_weighted
from pipeline.track import F8

TimeTable = tuple[F8, F8]  # values at ascending times, s
# Number of points in the tables of the lag and of the integrals of the frequency. If A^2 falls by e^10 within a table,
# the trapezoidal rule errs by h^2/12 = 2e-6: P. J. Davis, P. Rabinowitz, "Methods of Numerical Integration" (1984).
TABLE_POINTS = 2049


class Change(NamedTuple):
    """The frequency is a sum of powers of the amplitude or of the time from the middle, and a constant."""

    by: Literal["amplitude", "time"]
    powers: tuple[float, ...]

    def terms(self, amplitude: F8, elapsed: F8) -> list[F8]:
        """Return the powers at amplitudes (n,) and at times (n,) from the middle."""
        base = np.maximum(amplitude, 0.0) if self.by == "amplitude" else elapsed
        return [base**power for power in self.powers]


# A nonlinear spring and a pendulum change the frequency with the square of the amplitude, and with more of them by its
# next power; the air that moves with a disc changes it with the amplitude or its root (docs/explanation/real-records).
# A mass that leaves, a temperature and the clock of a camera change it with time.
CHANGES = (
    Change("amplitude", (2.0,)),
    Change("amplitude", (2.0, 4.0)),
    Change("amplitude", (1.0,)),
    Change("amplitude", (0.5,)),
    Change("time", (1.0,)),
    Change("time", (1.0, 2.0)),
)


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """The change of the frequency that describes the phases best, and what the others that are not excluded say."""

    law: Change
    tables: tuple[TimeTable, ...]  # integrals of its terms from the middle
    rivals: tuple[Change, ...]  # all laws that are not excluded, from best to worst
    u_choice: float  # largest difference of the angular frequency of very small swings among those of the amplitude
    # Largest difference of the mean frequency from that of very small swings, or for laws of time from that at the
    # start, rad/s.
    apart: float

    @property
    def by_amplitude(self) -> bool:
        """Whether the frequency may change with the amplitude."""
        return any(law.by == "amplitude" for law in self.rivals)

    @property
    def by_time(self) -> bool:
        """Whether it may change with time."""
        return any(law.by == "time" for law in self.rivals)


class Phases(NamedTuple):
    """Phases of windows, less their lag, and the time of the start and of the middle."""

    t: F8
    phase: F8
    spread: Scatter
    t0: float
    middle: float

    def fit(self, tables: Sequence[TimeTable] = ()) -> Line:
        """Fit a straight line and the integrals of the terms of a change."""
        kept = self.spread.kept
        return solve_weighted(turns(self.t, self.middle, tables)[kept], self.phase[kept], self.spread.u[kept])


def find_bend(
    phases: Phases, straight: Line, amplitude: TimeTable, *, decays: bool
) -> tuple[Bend, Line, Estimate | None] | None:
    """Return the change of the frequency that the phases support, its fit, and the frequency of very small swings.

    The result is None if a constant frequency describes the phases. That of very small swings is the angular frequency
    by the best law of the amplitude, and None if all of them are excluded; its u includes the choice among them.

    A change must lower the BIC by more than :data:`VERY_STRONG`, and those within this of the best are not excluded.
    Correlated windows count as fewer, and chi-square is divided by that of the best per degree of freedom, if that is
    larger than 1. An ``amplitude`` that does not decay cannot change the frequency.
    """
    spread, count = phases.spread, int(np.count_nonzero(phases.spread.kept))
    tables = {law: bends_of(law, amplitude, phases.middle) for law in CHANGES if decays or law.by == "time"}
    lines = {law: phases.fit(each) for law, each in tables.items()}
    fits = (straight, *lines.values())
    excess = max(1.0, min(fit.chi2 / max(count - fit.values.size, 1) for fit in fits))
    price = math.log(max(count / spread.correlation, 2.0))

    def bic(fit: Line) -> float:
        return fit.chi2 / (spread.correlation * excess) + price * fit.values.size

    order = sorted(lines, key=lambda law: bic(lines[law]))
    best = order[0]
    if bic(straight) - bic(lines[best]) <= VERY_STRONG:
        return None
    rivals = tuple(law for law in order if bic(lines[law]) - bic(lines[best]) <= VERY_STRONG)
    mean, start = float(straight.values[1]), phases.t0 - phases.middle
    small = {law: float(lines[law].values[1]) for law in rivals if law.by == "amplitude"}
    first = [
        float(lines[law].values[1:] @ [1.0, *(start**n for n in law.powers)]) for law in rivals if law.by == "time"
    ]
    estimate, u_choice = None, 0.0
    if small:
        law, omega = next(iter(small.items()))
        fit, u_choice = lines[law], max(abs(other - omega) for other in small.values())
        u = math.sqrt(float(fit.covariance[1, 1]) * fit.widening(spread.correlation))
        estimate = Estimate(omega, math.hypot(u, u_choice), "rad/s") if omega > 0.0 else None
    apart = max(abs(omega - mean) for omega in (*small.values(), *first))
    return Bend(best, tables[best], rivals, u_choice, apart), lines[best], estimate


def amplitude_table(law: Law, theta: F8, t0: float, last: float) -> TimeTable:
    """Return the amplitudes of a law from t0 to the last time."""
    grid = np.linspace(t0, max(last, t0 + 1e-9), TABLE_POINTS)
    amplitude = law.curve(grid - t0, theta)[0]
    return grid, np.where(np.isfinite(amplitude), amplitude, 0.0)


def bends_of(law: Change, amplitude: TimeTable, middle: float) -> tuple[TimeTable, ...]:
    """Return the integrals of the terms of a change from the middle."""
    from scipy.integrate import cumulative_trapezoid

    grid, size = amplitude
    each = [cumulative_trapezoid(term, grid, initial=0.0) for term in law.terms(size, grid - middle)]
    return tuple((grid, np.asarray(integral - np.interp(middle, grid, integral))) for integral in each)


def turns(t: F8, middle: float, tables: Sequence[TimeTable]) -> F8:
    """Return the columns of the phase: 1, the time from the middle, and the integrals of the terms of a change."""
    return np.stack([np.ones(t.size), t - middle, *(np.interp(t, *table) for table in tables)], axis=1)
