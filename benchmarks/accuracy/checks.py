"""Check the requirements over seeds: each check yields lines with a limit, the measured value, and the result.

A share or a root mean square over finitely many seeds scatters. A limit counts as exceeded if the measured value is
beyond it by more than three of its standard errors. With 2000 seeds these are 3 percentage points for a share of 68 %,
and 5 % of an rms error.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.accuracy.trials import QUANTITIES, Case, Outcome, bounds, evaluate, record, synthetic
from pipeline.options import TIERS
from pipeline.results.classic import classic

__all__ = ["CHECKS", "Bench", "Line"]

NOISES_M = (3e-4, 2.39e-3)
EFFICIENCY = {"standard": 1.10, "best": 1.05}
SIGMAS = 3.0
SINGLE = ("linear", "quadratic", "friction")


@dataclass(frozen=True)
class Line:
    """One requirement.

    Parameters
    ----------
    what, measured, limit : str
    ok : bool
    """

    what: str
    measured: str
    limit: str
    ok: bool


@dataclass(frozen=True)
class Bench:
    """The number of records, and the means of evaluating them.

    Parameters
    ----------
    seeds : int
        Number of records per case.
    map : callable
        The built-in ``map``, or the one of a pool.
    jobs : int
        Number of processes.
    """

    seeds: int
    map: Callable[..., Iterable[Any]]
    jobs: int = 1

    @property
    def short(self) -> bool:
        """Whether this is the short form that runs as a test, without the longest records."""
        return self.seeds < 100

    def run(self, case: Case, tier: str, seeds: int | None = None) -> list[Outcome]:
        """Evaluate a case for every seed."""
        jobs = [(case, tier, seed) for seed in range(seeds or self.seeds)]
        options = {"chunksize": max(1, len(jobs) // (8 * self.jobs))} if self.jobs > 1 else {}
        return list(self.map(evaluate, jobs, **options))


def share_line(what: str, share: float, count: int, low: float, high: float = 1.0) -> Line:
    """Return the line of a share that must lie between two limits."""
    doubt = SIGMAS * math.sqrt(max(share * (1 - share), low * (1 - low), 1.0 / count) / count)
    limit = f">= {low:.0%}" if high == 1.0 else f"<= {high:.0%}" if low == 0.0 else f"{low:.0%} to {high:.0%}"
    return Line(what, f"{share:.1%}", limit, low - doubt <= share <= high + doubt)


def rms(values: np.ndarray) -> float:
    """Return the root mean square of some values."""
    return float(np.sqrt(np.mean(values**2)))


def name_of(case: Case) -> str:
    """Return the duration and noise of a case as text."""
    return f"{case.seconds:g} s, {case.noise_m * 1e3:g} mm"


def efficiency(bench: Bench) -> Iterator[Line]:
    """Check that errors are near the bound, bias is far below it, and intervals cover the stated shares."""
    for seconds, noise, tier in itertools.product((10.0, 120.0), NOISES_M, TIERS):
        case = Case(seconds=seconds, noise_m=noise)
        bound = bounds(case)
        what = f"{name_of(case)}, {tier}"
        outcomes = bench.run(case, tier)
        yield all_found(f"{what}: an estimate", outcomes)
        error, u = stacked(outcomes)
        for k, quantity in enumerate(QUANTITIES):
            yield from quantity_lines(f"{what}, {quantity}", error[:, k] / bound[k], u[:, k] / bound[k], tier)


def quantity_lines(what: str, error: np.ndarray, u: np.ndarray, tier: str) -> Iterator[Line]:
    """Yield efficiency, bias and coverage of one quantity, all in units of the bound."""
    count = error.size
    ratio, bias = rms(error), float(np.mean(error))
    if tier in EFFICIENCY:
        limit = EFFICIENCY[tier]
        doubt = SIGMAS / math.sqrt(2.0 * count)
        yield Line(f"{what}: rms error / bound", f"{ratio:.3f}", f"<= {limit}", ratio <= limit * (1 + doubt))
    else:
        yield Line(f"{what}: rms error / bound", f"{ratio:.3f}", "finite", math.isfinite(ratio))
    yield Line(f"{what}: bias / bound", f"{bias:+.3f}", "<= 0.1", abs(bias) <= 0.1 + SIGMAS * ratio / math.sqrt(count))
    for share, width, low, high in ((0.68, 1.0, 0.66, 0.70), (0.95, 1.959964, 0.94, 0.96)):
        inside = float(np.mean(np.abs(error) <= width * u))
        yield share_line(f"{what}: {share:.0%} interval covers", inside, count, low, high)


def all_found(what: str, outcomes: list[Outcome]) -> Line:
    """Return the line of the requirement that every record gave an estimate."""
    lost = [o.why for o in outcomes if o.why]
    return Line(
        what, f"{len(outcomes) - len(lost)} of {len(outcomes)}" + (f" ({lost[0]})" if lost else ""), "all", not lost
    )


def stacked(outcomes: list[Outcome]) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and uncertainties of the outcomes with an estimate, (n, 4) each."""
    found = [o for o in outcomes if not o.why]
    if not found:
        return np.full((1, 4), np.nan), np.full((1, 4), np.nan)
    return np.array([o.error for o in found]), np.array([o.u for o in found])


def damping_bias(bench: Bench) -> Iterator[Line]:
    """Check that the bias of the classic method's damping is an eighth, and that of ours less than a thousandth."""
    case = Case(noise_m=2.39e-3)
    gamma = case.truth["gamma"]
    for tier in ("standard", "best"):
        error = stacked(bench.run(case, tier))[0][:, 3]
        bias, doubt = float(np.mean(error)) / gamma, SIGMAS * float(np.std(error)) / gamma / math.sqrt(error.size)
        yield Line(f"{name_of(case)}, {tier}: bias of gamma", f"{bias:+.3%}", "<= 0.1 %", abs(bias) <= 1e-3 + doubt)
    theirs = [classic(record(case, seed)[1]).estimates["damping_rate"].value for seed in range(min(bench.seeds, 200))]
    bias = float(np.mean(theirs)) / gamma - 1.0
    yield Line(f"{name_of(case)}, classic: bias of gamma", f"{bias:+.1%}", "-9 to -15 %", -0.15 < bias < -0.09)


def laws(bench: Bench) -> Iterator[Line]:
    """Check that the true law is selected in long records, and is one of the admissible laws in short records."""
    for noise in NOISES_M:
        for law, truth in synthetic.LAW_TRUTHS.items():
            case = Case(noise_m=noise, truth=truth)
            outcomes = bench.run(case, "standard")
            picked = float(np.mean([o.selected == law for o in outcomes]))
            # The power 1.5 lies between two laws of the closed form: in coarse noise it only needs to be admissible.
            if law != "power" or noise < 1e-3:
                least = 0.95 if law in SINGLE or noise < 1e-3 else 0.70
                yield share_line(f"{name_of(case)}, {law}: picked", picked, len(outcomes), least)
            inside = float(np.mean([law in o.admissible for o in outcomes]))
            yield share_line(f"{name_of(case)}, {law}: admissible", inside, len(outcomes), 0.95)
            if noise > 1e-3 and law in ("linear", "quadratic"):
                share = float(np.mean(["linear" in o.rejected for o in outcomes]))
                low, high = (0.99, 1.0) if law == "quadratic" else (0.0, 0.02)
                yield share_line(f"{name_of(case)}, {law}: one exponential rejected", share, len(outcomes), low, high)
            short = replace(case, seconds=30.0)
            outcomes = bench.run(short, "standard")
            inside = float(np.mean([law in o.admissible for o in outcomes]))
            yield share_line(f"{name_of(short)}, {law}: admissible", inside, len(outcomes), 0.95)


def echoes(bench: Bench) -> Iterator[Line]:
    """Check that single or clustered false echoes cost little accuracy, and that no share up to 40 % is refused."""
    for tier in ("standard", "best"):
        clean = stacked(bench.run(Case(), tier))[0]
        for clustered in (False, True):
            for share, limit in ((0.05, 1.15), (0.20, 1.30), (0.40, None)):
                case = Case(echoes=share, clustered=clustered)
                outcomes = bench.run(case, tier)
                what = f"{tier}, {share:.0%} echoes{' in clusters' if clustered else ''}"
                yield all_found(f"{what}: an estimate", outcomes)
                error = stacked(outcomes)[0]
                for k, quantity in enumerate(QUANTITIES):
                    ratio = rms(error[:, k]) / rms(clean[:, k])
                    doubt = SIGMAS / math.sqrt(error.shape[0])
                    stated = "-" if limit is None else f"<= {limit}"
                    ok = math.isfinite(ratio) if limit is None else ratio <= limit * (1 + doubt)
                    yield Line(f"{what}: {quantity}, rms error / clean", f"{ratio:.3f}", stated, ok)


def weak(bench: Bench) -> Iterator[Line]:
    """Check that down to -10 dB every frequency error is within five bounds."""
    for decibel in (0.0, -5.0, -10.0):
        noise = 0.05 / math.sqrt(2.0) / 10 ** (decibel / 20.0)
        case = Case(seconds=10.0, noise_m=noise, truth={"gamma": 0.0})
        outcomes = bench.run(case, "standard")
        error = stacked(outcomes)[0][:, 0] / bounds(case)[0]
        gross = int(np.count_nonzero(~(np.abs(error) < 5.0))) + sum(bool(o.why) for o in outcomes)
        yield Line(f"10 s at {decibel:g} dB: gross failures", f"{gross} of {len(outcomes)}", "0", gross == 0)


def invariance(bench: Bench) -> Iterator[Line]:
    """Check that time origin and size of the motion change no estimate by more than a twentieth of the bound."""
    few = min(bench.seeds, 50)
    for tier in ("standard", "best"):
        base = stacked(bench.run(Case(), tier, few))[0]
        bound = bounds(Case())
        for origin in (1e3, 1e6, 1.7e9):
            error = stacked(bench.run(Case(origin_s=origin), tier, few))[0]
            worst = float(np.max(np.abs(error - base) / bound))
            yield Line(f"{tier}: answer / bound changes at t0 = {origin:g} s", f"{worst:.1e}", "<= 0.05", worst <= 0.05)
        for size in (1e-9, 1e-3, 1e3):
            truth = {"gamma": 0.01463, "amplitude": size, "offset": 4.4 * size}
            case = Case(noise_m=size * 3e-4 / 0.05, truth=truth)
            scaled = stacked(bench.run(case, tier, few))[0] / bounds(case)
            worst = float(np.max(np.abs(scaled - base / bound)))
            yield Line(f"{tier}: answer / bound changes at A = {size:g} m", f"{worst:.1e}", "<= 0.05", worst <= 0.05)


def ranges(bench: Bench) -> Iterator[Line]:
    """Check that the frequency is within five bounds for 8 to 10,000 samples per period and 1.6 to 1e6 periods."""
    period = 2 * math.pi / 8.3
    few = min(bench.seeds, 20)
    for samples in (8, 20, 1000, 10_000):
        case = Case(seconds=20 * period, rate_hz=samples / period)
        yield from within(bench, case, f"20 periods of {samples} samples", few)
    for periods in (1.6, 2.5, 5.0, 1e3, 1e4, *(() if bench.short else (1e5, 1e6))):
        rate = 100.0 if periods < 1e4 else 12.0 / period
        case = Case(seconds=periods * period, rate_hz=rate, truth={"gamma": 0.2 / (periods * period)})
        yield from within(bench, case, f"{periods:g} periods", few if periods < 1e5 else 2)


def within(bench: Bench, case: Case, what: str, seeds: int) -> Iterator[Line]:
    """Yield whether every record gives an estimate, and whether every frequency is within five bounds."""
    outcomes = bench.run(case, "standard", seeds)
    yield all_found(f"{what}: an estimate", outcomes)
    worst = float(np.max(np.abs(stacked(outcomes)[0][:, 0]))) / bounds(case)[0]
    yield Line(f"{what}: largest error of frequency / bound", f"{worst:.2f}", "<= 5", worst <= 5.0)


CHECKS: dict[str, Callable[[Bench], Iterator[Line]]] = {
    "efficiency": efficiency,
    "damping": damping_bias,
    "laws": laws,
    "echoes": echoes,
    "weak": weak,
    "invariance": invariance,
    "ranges": ranges,
}
