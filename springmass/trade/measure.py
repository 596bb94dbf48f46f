"""The measurement: every method on the same simulated records, its errors against the bound, its time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.accuracy import TIERS
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.track import Track
from springmass.trade.front import EQUAL, Point
from springmass.trade.methods import Method
from springmass.trade.truth import Truth, bounds, record

__all__ = ["ENOUGH", "Row", "Trade", "measure", "own_record"]

ENOUGH = 1.10  # times the bound: what a tier may err before a slower one is recommended
FAILURES = (AnalysisError, ValueError, ArithmeticError, np.linalg.LinAlgError)


@dataclass(frozen=True, slots=True)
class Row:
    """What one method reached.

    Parameters
    ----------
    method : Method
    seconds : float
        Least time of one record, s: what the method costs without the machine's other work.
    error, bias : mapping of str to float
        Root mean square error and mean error over the bound, by quantity; of the records that it could evaluate.
    failed : int
        Records on which it gave up.
    """

    method: Method
    seconds: float
    error: Mapping[str, float]
    bias: Mapping[str, float]
    failed: int

    @property
    def worst(self) -> float:
        """The largest of its errors, infinite where it evaluated no record."""
        return max(self.error.values(), default=math.inf)


@dataclass(frozen=True, slots=True)
class Trade:
    """A measurement.

    Parameters
    ----------
    truth : Truth
    seeds : int
    bound : mapping of str to float
        SI units.
    rows : tuple of Row
    """

    truth: Truth
    seeds: int
    bound: Mapping[str, float]
    rows: tuple[Row, ...]

    def over_least(self, row: Row) -> dict[str, float]:
        """Return a row's errors over the least that any row has in the same quantity."""
        return {q: error / min(other.error.get(q, math.inf) for other in self.rows) for q, error in row.error.items()}

    def points(self, quantity: str) -> list[Point]:
        """Return time and error over the bound of every method that estimates a quantity."""
        return [
            Point(row.method.short, row.seconds, row.error[quantity], row.method.kind)
            for row in self.rows
            if quantity in row.error
        ]

    @property
    def doubt(self) -> float:
        """By which factor a root mean square of so many errors may exceed its expectation: two standard deviations."""
        return 1.0 + 2.0 / math.sqrt(2.0 * self.seeds)

    def beaten(self, row: Row) -> str | None:
        """Return which method is quicker, estimates as much and is nowhere worse: the most exact such, or None."""
        better = [
            other
            for other in self.rows
            if other.seconds < row.seconds
            and other.failed <= row.failed
            and all(other.error.get(q, math.inf) <= error * (1.0 + EQUAL) for q, error in row.error.items())
        ]
        return min(better, key=lambda other: other.worst).method.label if better and row.error else None

    @property
    def recommended(self) -> str:
        """The quickest tier whose errors are all within a tenth of the bound, else the most exact one."""
        tiers = [row for row in self.rows if row.method.name in TIERS]
        good = [row for row in tiers if row.failed == 0 and row.worst <= ENOUGH * self.doubt]
        chosen = min(good, key=lambda row: row.seconds) if good else min(tiers, key=lambda row: (row.failed, row.worst))
        return chosen.method.name


def measure(
    truth: Truth,
    methods: Sequence[Method],
    seeds: int,
    *,
    timer: Callable[[], float],
    progress: Callable[[int], None] | None = None,
) -> Trade:
    """Run every method on every record, in turn, so that a busy machine slows all alike.

    Parameters
    ----------
    truth : Truth
    methods : sequence of Method
    seeds : int
        Records; number i is made by ``default_rng(i)``.
    timer : callable
        Seconds of a clock that runs on.
    progress : callable, optional
        Told after each record how many are done.

    Returns
    -------
    Trade
        Deterministic but for its times.
    """
    t, bound = truth.times, bounds(truth)
    true = {"frequency": truth.frequency_hz, "amplitude": truth.amplitude_m, "damping_rate": truth.damping_rate}
    errors: list[list[dict[str, float]]] = [[] for _ in methods]
    times: list[list[float]] = [[] for _ in methods]
    for seed in range(-1, seeds):
        track = Track.from_arrays(t, record(truth, np.random.default_rng(max(seed, 0))), kind="simulated")
        for i, method in enumerate(methods):
            found, spent = _timed(method, track, timer)
            if seed < 0:
                continue  # imports and caches are paid once, before the measurement
            times[i].append(spent)
            if not isinstance(found, str):
                errors[i].append({q: (e.value - true[q]) / bound[q] for q, e in found.items() if q in true})
        if progress is not None:
            progress(seed + 1)
    return Trade(truth, seeds, bound, tuple(_row(*each) for each in zip(methods, times, errors, strict=True)))


def _timed(method: Method, track: Track, timer: Callable[[], float]) -> tuple[Mapping[str, Estimate] | str, float]:
    """Run a method: what it finds, or why it gave up, and the time, s."""
    start = timer()
    try:
        found: Mapping[str, Estimate] | str = method.run(track)
    except FAILURES as error:
        found = " ".join(str(error).split())
    return found, timer() - start


def _row(method: Method, times: list[float], errors: list[dict[str, float]]) -> Row:
    quantities = errors[0] if errors else {}
    values = {q: np.array([each[q] for each in errors if q in each]) for q in quantities}
    return Row(
        method,
        min(times),
        {q: float(np.sqrt(np.mean(value**2))) for q, value in values.items()},
        {q: float(np.mean(value)) for q, value in values.items()},
        len(times) - len(errors),
    )


def own_record(
    track: Track, methods: Sequence[Method], *, timer: Callable[[], float], rounds: int = 5
) -> list[tuple[Method, Mapping[str, Estimate] | str, float]]:
    """Run every method on one record: what it finds, or why it gave up, and the least time of some rounds, s."""
    results = []
    for method in methods:
        tries = [_timed(method, track, timer) for _ in range(rounds)]
        results.append((method, tries[-1][0], min(spent for _, spent in tries)))
    return results
