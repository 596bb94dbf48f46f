"""The measurement: errors relative to the bound, and times, of every method on the same simulated records."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.options import TIERS
from pipeline.track import Track
from springmass.trade.methods import Method
from springmass.trade.truth import Truth, bounds, record

__all__ = ["EQUAL", "OwnResult", "Row", "Trade", "measure", "own_record"]

ENOUGH = 1.10  # maximum error of a recommended tier, as a multiple of the bound
EQUAL = 0.01  # relative difference up to which errors count as equal
FAILURES = (AnalysisError, ValueError, ArithmeticError, np.linalg.LinAlgError)


@dataclass(frozen=True, slots=True)
class Row:
    """The result of one method.

    Parameters
    ----------
    method : Method
    seconds : float
        Minimum time for one record, s: the cost of the method without delays by other programs.
    error, bias : mapping of str to float
        Root mean square error and mean error, divided by the bound, by quantity; only of records that the method could
        evaluate.
    failed : int
        Number of records that the method could not evaluate.
    """

    method: Method
    seconds: float
    error: Mapping[str, float]
    bias: Mapping[str, float]
    failed: int

    @property
    def worst(self) -> float:
        """The largest error of the method; infinite if it evaluated no record."""
        return max(self.error.values(), default=math.inf)


@dataclass(frozen=True, slots=True)
class Trade:
    """A measurement on ``seeds`` records with the same true values; ``bound`` is in SI units, by quantity."""

    truth: Truth
    seeds: int
    bound: Mapping[str, float]
    rows: tuple[Row, ...]

    def over_least(self, row: Row) -> dict[str, float]:
        """Return a row's errors, each divided by the smallest error of any row in the same quantity."""
        return {q: error / min(each.error.get(q, math.inf) for each in self.rows) for q, error in row.error.items()}

    @property
    def enough(self) -> float:
        """The largest error over the bound that counts as within a tenth of the bound.

        It includes two standard deviations of a root mean square of ``seeds`` errors.
        """
        return ENOUGH * (1.0 + 2.0 / math.sqrt(2.0 * self.seeds))

    def beaten(self, row: Row) -> str | None:
        """Return the most accurate method that is quicker, estimates as much and is nowhere worse, or None."""
        better = [
            each
            for each in self.rows
            if each.seconds < row.seconds
            and each.failed <= row.failed
            and all(each.error.get(q, math.inf) <= error * (1.0 + EQUAL) for q, error in row.error.items())
        ]
        return min(better, key=lambda each: each.worst).method.label if better and row.error else None

    @property
    def recommended(self) -> Row:
        """The quickest tier that never failed and whose errors are all within a tenth of the bound.

        If there is none, it is the tier that failed least often, or of several such tiers the most accurate one.
        """
        tiers = [row for row in self.rows if row.method.name in TIERS]
        good = [row for row in tiers if row.failed == 0 and row.worst <= self.enough]
        return min(good, key=lambda row: row.seconds) if good else min(tiers, key=lambda row: (row.failed, row.worst))


def measure(
    truth: Truth,
    methods: Sequence[Method],
    seeds: int,
    *,
    timer: Callable[[], float],
    progress: Callable[[int], None] = lambda _: None,
) -> Trade:
    """Run all methods in turn on each record, so that a busy machine slows all of them alike.

    Parameters
    ----------
    truth : Truth
    methods : sequence of Method
    seeds : int
        Number of records; record i is made by ``default_rng(i)``.
    timer : callable
        Returns the time of a monotonic clock, s.
    progress : callable
        Called after each record with the number of finished records.

    Returns
    -------
    Trade
        Deterministic apart from its times.
    """
    bound = bounds(truth)
    true = {"frequency": truth.frequency_hz, "amplitude": truth.amplitude_m, "damping_rate": truth.damping_rate}
    errors: list[list[dict[str, float]]] = [[] for _ in methods]
    times: list[list[float]] = [[] for _ in methods]
    for seed in range(seeds):
        track = Track.from_arrays(truth.times, record(truth, np.random.default_rng(seed)), kind="simulated")
        for i, method in enumerate(methods):
            if seed == 0:
                _timed(method, track, timer)  # an untimed first run imports modules and fills caches
            estimates, spent_s = _timed(method, track, timer)
            times[i].append(spent_s)
            if not isinstance(estimates, str):
                errors[i].append({q: (estimates[q].value - true[q]) / bound[q] for q in true if q in estimates})
        progress(seed + 1)
    return Trade(truth, seeds, bound, tuple(_row(*each) for each in zip(methods, times, errors, strict=True)))


def _timed(method: Method, track: Track, timer: Callable[[], float]) -> tuple[Mapping[str, Estimate] | str, float]:
    """Run a method; return its estimates or the reason for its failure, and the time in s."""
    start = timer()
    try:
        estimates: Mapping[str, Estimate] | str = method.run(track)
    except FAILURES as error:
        estimates = " ".join(str(error).split())
    return estimates, timer() - start


def _row(method: Method, times: list[float], errors: list[dict[str, float]]) -> Row:
    values = {q: np.array([each[q] for each in errors if q in each]) for q in (errors[0] if errors else {})}
    error = {q: float(np.sqrt(np.mean(each**2))) for q, each in values.items()}
    bias = {q: float(np.mean(each)) for q, each in values.items()}
    return Row(method, min(times), error, bias, len(times) - len(errors))


OwnResult = tuple[Method, Mapping[str, Estimate] | str, float]
"""A method, its estimates or the reason for its failure, and its time in s."""


def own_record(
    track: Track, methods: Sequence[Method], *, timer: Callable[[], float], rounds: int = 5
) -> list[OwnResult]:
    """Run every method on one record; the time is the minimum of several rounds."""
    results = []
    for method in methods:
        rounds_of = [_timed(method, track, timer) for _ in range(rounds)]
        results.append((method, rounds_of[-1][0], min(spent_s for _, spent_s in rounds_of)))
    return results
