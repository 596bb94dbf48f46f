"""Many runs of a course: whether they agree on spring and disc, and which runs are far from the others."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_LINE, FEWEST_FOR_MEDIAN, NEGLIGIBLE, OUTLIER, coverage_factor
from pipeline.numerics.robust import mad_sigma
from pipeline.several.compare import Comparison, SpringRun, compare_springs

# Maximum number of runs compared as those of one bench, which takes 0.3 s as measured if they disagree; of a larger
# group only far runs are named.
LARGEST_BENCH = 50
# Relative difference up to which no run is blamed and no exchange looked for: twice the quarter of a percent by which,
# as measured, one bench's own runs differ.
LITTLE = 0.005
EXCHANGES = ("recordings", "masses")


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
    partner: str = ""  # the run that it was exchanged with


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
    within: float = math.nan
    between: float = math.nan
    stated: float = math.nan  # root mean square of the standard uncertainties of the runs
    # runs, benches: numbers of runs and benches.
    runs: int = 0
    benches: int = 0
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
    suspect. Runs of two benches that disagree are exchanged in pairs; the other runs of each bench are the test, so
    springs of one box may differ. The runs of one spring at one bench are compared as in file mode, which names two
    that were exchanged; a run without which the others agree is suspect too.
    """
    plausible = [run for run in runs if not run.implausible]
    found = {run.name: Suspect(run.name, run.implausible) for run in runs if run.implausible} | _far(plausible)
    benches: dict[tuple[str, str], list[CourseRun]] = {}
    for run in plausible:
        if run.on_spring is not None:
            benches.setdefault((run.bench, run.spring), []).append(run)
    apart = [every for every in benches.values() if (test := _compared(every)) is None or not test.agree]
    found |= _between_benches(_displaced(apart, found, [run for every in benches.values() for run in every]), found)
    disagreements = []
    for every in apart:
        verdict = _of_bench(every, found)
        if isinstance(verdict, Disagreement):
            disagreements.append(verdict)
        else:
            found |= verdict
    return tuple(found[run.name] for run in runs if run.name in found), tuple(disagreements)


def _of_bench(every: Sequence[CourseRun], found: Mapping[str, Suspect]) -> Disagreement | dict[str, Suspect]:
    """Return how the runs of one spring at one bench disagree, or those that are exchanged or alone do not fit.

    An exchange is sought among all but those that ``found`` has exchanged with another bench.
    """
    comparison = _compared([run for run in every if run.name not in found or not found[run.name].partner])
    if comparison is not None and comparison.exchanged:
        others = "the runs of their bench" if len(every) > 2 else "each other"
        one, two = comparison.exchanged
        return _exchange(one, two, "masses (or the periods)", others)
    runs = [run for run in every if run.name not in found]
    comparison = _compared(runs)
    if comparison is None or comparison.agree:
        return {}
    constants = [k.value for k in comparison.each]
    low, high = min(constants), max(constants)
    spread = high / low - 1.0
    if spread > LITTLE and (odd := _odd_one(runs)) is not None:
        others = f"without it, the other {len(runs) - 1} runs of its bench and spring agree"
        return {odd.name: Suspect(odd.name, f"{others}: look at its mass and its spring")}
    message = (
        f"the {len(constants)} runs of its bench and spring disagree by {100.0 * spread:.2g} %, "
        f"{comparison.largest_deviation:.3g} standard uncertainties ({low:.5g} to {high:.5g} N/m): "
        "check masses and spring"
    )
    return Disagreement(runs[0].bench, runs[0].spring, comparison.names, spread, message)


@dataclass(frozen=True, slots=True)
class _Displaced:
    """A run that is off the others of its bench, or off those of its spring if its bench has no other run.

    ``near`` is the largest relative difference from them at which an exchange may have put it right.
    """

    run: CourseRun
    spring: SpringRun
    constant: float
    others: Sequence[CourseRun]
    middle: float
    near: float
    alone: bool

    def after(self, other: _Displaced, exchanged: str) -> SpringRun | None:
        """Return this run with the recording or the mass of another, if that brings it near its others.

        With :math:`R = \\omega_j^2/\\omega_i^2`, its constant is then :math:`k_i R` or :math:`k_j/R`.
        """
        ratio = (other.spring.angular_frequency.value / self.spring.angular_frequency.value) ** 2
        constant = self.constant * ratio if exchanged == EXCHANGES[0] else other.constant / ratio
        if abs(math.log(constant / self.middle)) > self.near:
            return None
        if exchanged == EXCHANGES[1]:
            return replace(self.spring, mass_kg=other.spring.mass_kg)
        return replace(other.spring, mass_kg=self.spring.mass_kg)

    def tension(self, spring: SpringRun) -> float:
        """Return the tension after an exchange; infinite if this run then neither agrees nor comes far nearer."""
        others = self.others[:FEWEST_FOR_LINE]
        before, after = (_compared([replace(self.run, on_spring=x), *others]) for x in (self.spring, spring))
        limit = 1.0 if before is None else before.nearer
        return math.inf if after is None or after.tension > limit else after.tension


def _displaced(
    apart: Sequence[Sequence[CourseRun]], found: Mapping[str, Suspect], runs: Sequence[CourseRun]
) -> list[_Displaced]:
    """Return the runs of benches that disagree, and far runs of benches too small or too large for a comparison."""
    good: dict[str, list[CourseRun]] = {}
    for run in runs:
        if run.name not in found:
            good.setdefault(run.spring, []).append(run)
    displaced = []
    for every in apart:
        for run in every if 1 < len(every) <= LARGEST_BENCH else [run for run in every if run.name in found]:
            mates = [mate for mate in every if mate is not run]
            others = [mate for mate in mates if mate.name not in found] or mates or good.get(run.spring, [])
            values = np.log([x.spring_constant.value for x in others if x.spring_constant is not None])
            if run.spring_constant is None or run.on_spring is None or not values.size:
                continue
            middle, constant = float(np.median(values)), run.spring_constant.value
            off = abs(math.log(constant) - middle)
            if off > LITTLE:
                near = max(NEGLIGIBLE * off, 0.0 if mates else OUTLIER * mad_sigma(values - middle))
                displaced.append(
                    _Displaced(run, run.on_spring, constant, others, math.exp(middle), near, alone=not mates)
                )
    return displaced


def _between_benches(runs: Sequence[_Displaced], found: Mapping[str, Suspect]) -> dict[str, Suspect]:
    """Return the runs of two benches that come together with the others if recordings or masses are exchanged.

    Where a bench has no other run and the springs of the others scatter too much to decide, the finding on a far run
    names the exchange that would explain it.
    """
    sure: list[tuple[float, str, _Displaced, _Displaced]] = []
    perhaps: dict[str, Suspect] = {}
    for one, two in itertools.combinations(runs, 2):
        names = (one.run.name, two.run.name)
        for exchanged in EXCHANGES if one.run.bench != two.run.bench else ():
            moved, other = one.after(two, exchanged), two.after(one, exchanged)
            if moved is None or other is None:
                continue
            tension = one.tension(moved) + two.tension(other)
            if math.isfinite(tension):
                sure.append((tension, exchanged, one, two))
            elif (one.alone or two.alone) and set(names) <= found.keys():
                for name, partner in (names, names[::-1]):
                    also = f"and whether it was exchanged with {partner} (a second run of its bench would tell)"
                    perhaps.setdefault(name, Suspect(name, f"{found[name].message}, {also}"))
    pairs, solved = dict[str, Suspect](), set[str]()
    for _, exchanged, one, two in sorted(sure, key=lambda each: each[0]):
        names = (one.run.name, two.run.name)
        if not solved & {*names}:
            alike = abs(math.log(one.middle / two.middle)) < LITTLE  # one spring, or two that might be one
            what = "masses (or the periods)" if alike else exchanged
            alone = one.alone and two.alone
            pairs |= _exchange(*names, what, "the others" if alone else "the other runs of their benches")
            # With the exchange, the only other run of a bench is in order too.
            solved |= {*names, *(each.others[0].name for each in (one, two) if len(each.others) == 1)}
    return perhaps | pairs


def _exchange(a: str, b: str, what: str, others: str) -> dict[str, Suspect]:
    message = (
        f"with the {what} of {a} and {b} exchanged, they come together with {others}: check which record belongs "
        "to which bob"
    )
    return {a: Suspect(a, message, b), b: Suspect(b, message, a)}


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


def _far(runs: Sequence[CourseRun]) -> dict[str, Suspect]:
    """Return the runs whose spring constant, drag coefficient or amplitude is far from those of their group.

    A value is compared with the median of its group, in units of the scatter from the median absolute deviation and of
    its own uncertainty, both of the logarithms. Amplitudes differ by a factor of twenty only with a wrong unit.
    """
    found: dict[str, Suspect] = {}
    for quantity, label, least, others in (
        ("spring_constant", "spring", 2e-4, "the others of its spring"),
        ("amplitude", "unit", 0.6, "the others"),  # before the drag coefficient, which depends on it
        ("drag", "disc", 0.02, "the others of its disc"),
    ):
        groups: dict[str, list[tuple[CourseRun, Estimate]]] = {}
        for run in runs:
            value: Estimate | None = getattr(run, quantity)
            if value is not None and value.value > 0.0:
                groups.setdefault(getattr(run, label), []).append((run, value))
        words = {"spring_constant": "spring constant", "drag": "drag coefficient"}.get(quantity, quantity)
        for group in groups.values():
            logs = np.log([value.value for _, value in group])
            middle = float(np.median(logs))
            scatter = max(mad_sigma(logs - middle), least)
            for (run, value), log in zip(group, logs.tolist(), strict=True):
                away = (log - middle) / math.hypot(scatter, value.u / value.value)
                if len(group) > FEWEST_FOR_MEDIAN and abs(away) > OUTLIER:
                    ratio = math.exp(log - middle)
                    off = f"{ratio:.3g} times" if abs(log - middle) > 1.0 else f"{100.0 * (ratio - 1.0):+.3g} % off"
                    text = f"its {words} is {off} that of {others}: {_look(quantity, ratio, disc=bool(run.disc))}"
                    found.setdefault(run.name, Suspect(run.name, text))
    return found


def _look(quantity: str, ratio: float, *, disc: bool) -> str:
    """Return what to check where a value is so many times that of the others."""
    if quantity == "amplitude":
        return "look at the unit of its distances"
    if quantity == "drag":
        return "look at its disc and its mass"
    # The constant is proportional to the square of the frequency, so to that of the rate of the times.
    for factor, words in ((4.0, "half"), (0.25, "twice")):
        if abs(ratio / factor - 1.0) < NEGLIGIBLE:
            return f"look at its sampling rate, which is perhaps {words} what its times state"
    return f"look at its mass{', its disc' if disc else ''} and its spring"
