"""Many runs of a course: whether they agree on spring and disc, and which runs are far from the others."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_MEDIAN, NEGLIGIBLE, OUTLIER, coverage_factor
from pipeline.numerics.robust import mad_sigma
from pipeline.several.compare import Comparison, SpringRun, compare_springs

# Maximum number of runs compared as those of one bench, which takes 0.3 s as measured if they disagree; of a larger
# group only far runs are named.
LARGEST_BENCH = 50
LITTLE = 0.005  # relative spread of one bench's constants up to which no run is blamed: springs are not ideal


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseRun:
    """One run: runs with the same spring, disc or bench have the same label.

    The uncertainty of the spring constant includes only errors that the run does not share with others. The drag
    coefficient is that in the middle of the amplitudes of the run, ``on_spring`` is the run as file mode compares it,
    and ``implausible`` says what cannot be true of its mass.
    """

    name: str
    spring: str = ""
    disc: str = ""
    bench: str = ""
    spring_constant: Estimate | None = None
    drag: Estimate | None = None
    amplitude: Estimate | None = None
    unit: str = ""
    on_spring: SpringRun | None = None
    spring_mass_kg: Estimate | None = None
    implausible: str = ""


@dataclass(frozen=True, slots=True)
class Suspect:
    """A run with an implausible mass, or one that does not fit the others with its spring or disc."""

    name: str
    message: str


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Runs of one spring at one bench that disagree; ``spread`` is their largest constant over the least, less 1."""

    bench: str
    spring: str
    names: tuple[str, ...]
    spread: float
    message: str


@dataclass(frozen=True, slots=True)
class Agreement:
    """The agreement of many runs on one quantity."""

    # quantity, group: names of the quantity and of the group of runs.
    quantity: str
    group: str
    mean: Estimate | None  # over benches, with the scatter between them in its uncertainty; None: no common value
    # within, between: standard deviation of runs at one bench, and additional standard deviation between benches.
    # ``within`` is NaN if no bench has two runs, and ``between`` is NaN if there is only one bench.
    within: float
    between: float
    stated: float  # root mean square of the standard uncertainties of the runs
    # runs, benches: numbers of runs and benches.
    runs: int
    benches: int
    # chi2, dof: chi-square and degrees of freedom of the means of the benches, with the scatter within benches.
    chi2: float = math.nan
    dof: int = 0
    why: str = ""  # why there is no mean


def agreement(quantity: str, group: str, values: Sequence[Estimate], benches: Sequence[str]) -> Agreement:
    """Return how far runs of several benches agree on one quantity.

    The model is the one-way layout with random effects :math:`x_{ij} = \\mu + b_j + e_{ij}`, fitted by its moments
    [1]_. The variance within benches is the pooled variance of runs about the mean of their bench. The variance between
    benches is the variance of the means less the part from scatter within benches, by the moments of DerSimonian and
    Laird. The uncertainty of a bench's mean uses the larger of the scatter within benches and the stated uncertainty of
    the runs. That of the common mean is from the scatter of the benches about it, by Hartung and Knapp [2]_: half of
    what Student's t expands it to, so that two of it cover the truth however few benches there are. It is never below
    that of benches which do not differ.

    .. [1] R. DerSimonian, N. Laird, Controlled Clinical Trials 7 (1986) 177.
    .. [2] J. Hartung, G. Knapp, Statistics in Medicine 20 (2001) 3875.

    >>> runs = [Estimate(x, 0.01, "N/m") for x in (14.00, 14.02, 14.10, 14.12)]
    >>> found = agreement("spring_constant", "A", runs, ["1", "1", "2", "2"])
    >>> print(found.mean, f"{found.within:.3f} {found.between:.3f}")
    14.06 +- 0.35 N/m 0.014 0.070
    """
    if not values:
        raise AnalysisError(f"{quantity} of {group}: expected a run that gives it, got none")
    x = np.array([value.value for value in values])
    stated = math.sqrt(float(np.mean([value.u**2 for value in values])))
    names = list(dict.fromkeys(benches))
    parts = [x[[bench == name for bench in benches]] for name in names]
    free = x.size - len(parts)
    within = math.sqrt(sum(float(np.sum((part - part.mean()) ** 2)) for part in parts) / free) if free else math.nan
    scatter = stated if math.isnan(within) else max(within, stated)
    means = np.array([part.mean() for part in parts])
    variances = np.array([scatter**2 / part.size for part in parts])
    between, chi2, dof = math.nan, math.nan, len(parts) - 1
    weights = 1.0 / np.maximum(variances, 1e-300)
    u = float(weights.sum() ** -0.5)
    if dof:
        middle = float(weights @ means / weights.sum())
        chi2 = float(weights @ (means - middle) ** 2)
        excess = (chi2 - dof) / float(weights.sum() - (weights @ weights) / weights.sum())
        between = math.sqrt(max(excess, 0.0))
        weights = 1.0 / np.maximum(variances + between**2, 1e-300)
    middle = float(weights @ means / weights.sum())
    if dof:
        apart = math.sqrt(float(weights @ (means - middle) ** 2) / dof / weights.sum())
        u = max(u, coverage_factor(dof) / coverage_factor(math.inf) * apart)
    mean = Estimate(middle, u, values[0].unit)
    return Agreement(
        quantity=quantity,
        group=group,
        mean=mean,
        within=within,
        between=between,
        stated=stated,
        runs=x.size,
        benches=len(parts),
        chi2=chi2,
        dof=dof,
    )


def judged(runs: Sequence[CourseRun]) -> tuple[tuple[Suspect, ...], tuple[Disagreement, ...]]:
    """Return the runs that are suspect, and the benches whose other runs disagree on their spring.

    A run with an implausible mass takes no part in the rest. Runs far from the median of their spring or disc are
    suspect. The runs of one spring at one bench are compared as in file mode, which names two that were exchanged; a
    run without which the others agree is suspect too. Then far runs of two benches are exchanged in pairs, next to good
    runs.
    """
    plausible = [run for run in runs if not run.implausible]
    found = {run.name: Suspect(run.name, run.implausible) for run in runs if run.implausible} | _far(plausible)
    on_spring = [run for run in plausible if run.on_spring is not None]
    benches: dict[tuple[str, str], list[CourseRun]] = {}
    for run in on_spring:
        benches.setdefault((run.bench, run.spring), []).append(run)
    disagreements, exchanged = [], dict[str, Suspect]()
    for every in benches.values():
        verdict = _of_bench(every, [run for run in every if run.name not in found])
        if isinstance(verdict, Disagreement):
            disagreements.append(verdict)
        else:
            found |= verdict
            exchanged |= verdict if len(verdict) == 2 else {}
    found |= _between_benches(on_spring, found, exchanged)
    return tuple(found[run.name] for run in runs if run.name in found), tuple(disagreements)


def _of_bench(every: Sequence[CourseRun], rest: Sequence[CourseRun]) -> Disagreement | dict[str, Suspect]:
    """Return how the runs of one spring at one bench disagree, or those that are exchanged or alone do not fit."""
    comparison = _compared(every)
    if comparison is not None and not comparison.agree and not comparison.exchanged:
        comparison = _compared(rest)
    if comparison is None or comparison.agree:
        return {}
    if comparison.exchanged:
        a, b = comparison.exchanged
        return _exchange(a, b, "the runs of their bench" if len(every) > 2 else "each other")
    constants = [k.value for k in comparison.each]
    low, high = min(constants), max(constants)
    spread = high / low - 1.0
    if spread > LITTLE and (odd := _odd_one(rest)) is not None:
        others = f"without it, the other {len(rest) - 1} runs of its bench and spring agree"
        return {odd.name: Suspect(odd.name, f"{others}: look at its mass and its spring")}
    message = (
        f"the {len(constants)} runs of its bench and spring disagree by {100.0 * spread:.2g} %, "
        f"{comparison.largest_deviation:.3g} standard uncertainties ({low:.5g} to {high:.5g} N/m): "
        "check masses and spring"
    )
    return Disagreement(every[0].bench, every[0].spring, comparison.names, spread, message)


def _between_benches(
    runs: Sequence[CourseRun], found: Mapping[str, Suspect], exchanged: Mapping[str, Suspect]
) -> dict[str, Suspect]:
    """Return the far runs of two benches that come together with good runs if they are exchanged."""
    good, pairs = [run for run in runs if run.name not in found], dict[str, Suspect]()
    far = [run for run in runs if run.name in found.keys() - exchanged.keys()]
    for one, two in itertools.combinations(far, 2):
        alike = one.spring == two.spring and _alike_exchanged(one.on_spring, two.on_spring)
        if alike and not {one.name, two.name} & pairs.keys():
            # Runs of the two benches come first.
            mates = sorted(
                (run for run in good if run.spring == one.spring),
                key=lambda run: run.bench not in (one.bench, two.bench),
            )
            comparison = _compared([one, two, *mates[: FEWEST_FOR_MEDIAN + 1]])
            if comparison is not None and set(comparison.exchanged) == {one.name, two.name}:
                pairs |= _exchange(one.name, two.name, "the others")
    return pairs


def _exchange(a: str, b: str, others: str) -> dict[str, Suspect]:
    message = (
        f"with the masses (or the periods) of {a} and {b} exchanged, they come together with {others}: "
        "check which record belongs to which bob"
    )
    return {name: Suspect(name, message) for name in (a, b)}


def _compared(runs: Sequence[CourseRun]) -> Comparison | None:
    """Compare runs of one spring as file mode does; None if there are too few or too many."""
    on_spring = [run.on_spring for run in runs if run.on_spring is not None]
    if not 2 <= len(on_spring) <= LARGEST_BENCH:
        return None
    stated = next((run.spring_mass_kg for run in runs if run.spring_mass_kg is not None), None)
    return compare_springs(on_spring, spring_mass_kg=stated)


def _odd_one(runs: Sequence[CourseRun]) -> CourseRun | None:
    """Return the only run without which the others, three or more, agree."""
    without = (
        [_compared([other for other in runs if other is not run]) for run in runs]
        if len(runs) > FEWEST_FOR_MEDIAN
        else []
    )
    odd = [run for run, others in zip(runs, without, strict=False) if others is not None and others.agree]
    return odd[0] if len(odd) == 1 else None


def _alike_exchanged(a: SpringRun | None, b: SpringRun | None) -> bool:
    """Return whether two runs give nearly one constant if each has the other's mass: a quick look before the test."""
    if a is None or b is None:
        return False
    k_a, k_b = (x.angular_frequency.value**2 * y.mass_kg.value for x, y in ((a, b), (b, a)))
    return abs(math.log(k_a / k_b)) < NEGLIGIBLE


def _far(runs: Sequence[CourseRun]) -> dict[str, Suspect]:
    """Return the runs whose spring constant, drag coefficient or amplitude is far from those of their group.

    A value is compared with the median of its group, in units of the scatter from the median absolute deviation and of
    its own uncertainty, both of the logarithms. Amplitudes differ by a factor of twenty only with a wrong unit.
    """
    found: dict[str, Suspect] = {}
    for quantity, label, least, others, advice in (
        ("spring_constant", "spring", 2e-4, "the others of its spring", "look at its mass and its spring"),
        ("drag", "disc", 0.02, "the others of its disc", "look at its disc and its mass"),
        ("amplitude", "unit", 0.6, "the others", "look at the unit of its distances"),
    ):
        groups: dict[str, list[tuple[str, Estimate]]] = {}
        for run in runs:
            value: Estimate | None = getattr(run, quantity)
            if value is not None and value.value > 0.0:
                groups.setdefault(getattr(run, label), []).append((run.name, value))
        words = {"spring_constant": "spring constant", "drag": "drag coefficient"}.get(quantity, quantity)
        for group in groups.values():
            logs = np.log([value.value for _, value in group])
            middle = float(np.median(logs))
            scatter = max(mad_sigma(logs - middle), least)
            for (name, value), log in zip(group, logs.tolist(), strict=True):
                away = (log - middle) / math.hypot(scatter, value.u / value.value)
                if len(group) > FEWEST_FOR_MEDIAN and abs(away) > OUTLIER:
                    ratio = math.exp(log - middle)
                    off = f"{ratio:.3g} times" if abs(log - middle) > 1.0 else f"{100.0 * (ratio - 1.0):+.3g} % off"
                    found.setdefault(name, Suspect(name, f"its {words} is {off} that of {others}: {advice}"))
    return found
