"""Many runs of a course: whether they agree on spring and disc, and which runs are far from the others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.robust import mad_sigma

FAR = 5.0  # distance from the median, in standard deviations, above which a run is suspect: none of 200 good runs
FEW = 4  # minimum number of runs in a group for a median


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseRun:
    """One run: runs with the same spring, disc or bench have the same label.

    The uncertainty of the spring constant includes only errors that the run does not share with others. The drag
    coefficient is that in the middle of the amplitudes of the run.
    """

    name: str
    spring: str = ""
    disc: str = ""
    bench: str = ""
    spring_constant: Estimate | None = None
    drag: Estimate | None = None


@dataclass(frozen=True, slots=True)
class Suspect:
    """A run that is far from the others with the same spring or disc."""

    name: str
    message: str


@dataclass(frozen=True, slots=True)
class Agreement:
    """The agreement of many runs on one quantity."""

    # quantity, group: names of the quantity and of the group of runs.
    quantity: str
    group: str
    mean: Estimate  # mean over benches; its uncertainty includes the scatter between them
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


def agreement(quantity: str, group: str, values: Sequence[Estimate], benches: Sequence[str]) -> Agreement:
    """Return how far runs of several benches agree on one quantity.

    The model is the one-way layout with random effects :math:`x_{ij} = \\mu + b_j + e_{ij}`, fitted by its moments
    [1]_. The variance within benches is the pooled variance of runs about the mean of their bench. The variance between
    benches is the variance of the means less the part from scatter within benches, by the moments of DerSimonian and
    Laird. The uncertainty of a bench's mean uses the larger of the scatter within benches and the stated uncertainty of
    the runs.

    .. [1] R. DerSimonian, N. Laird, Controlled Clinical Trials 7 (1986) 177.

    >>> runs = [Estimate(x, 0.01, "N/m") for x in (14.00, 14.02, 14.10, 14.12)]
    >>> found = agreement("spring_constant", "A", runs, ["1", "1", "2", "2"])
    >>> print(found.mean, f"{found.within:.3f} {found.between:.3f}")
    14.060 +- 0.050 N/m 0.014 0.070
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
    if dof:
        middle = float(weights @ means / weights.sum())
        chi2 = float(weights @ (means - middle) ** 2)
        excess = (chi2 - dof) / float(weights.sum() - (weights @ weights) / weights.sum())
        between = math.sqrt(max(excess, 0.0))
        weights = 1.0 / np.maximum(variances + between**2, 1e-300)
    mean = Estimate(float(weights @ means / weights.sum()), float(weights.sum() ** -0.5), values[0].unit)
    return Agreement(quantity, group, mean, within, between, stated, x.size, len(parts), chi2, dof)


def suspects(runs: Sequence[CourseRun]) -> tuple[Suspect, ...]:
    """Return the runs whose spring constant or drag coefficient is far from those of the same spring or disc.

    A value is compared with the median of its group, in units of the scatter from the median absolute deviation and of
    its own uncertainty, both of the logarithms.
    """
    found: dict[str, Suspect] = {}
    for quantity, label, least, words, advice in (
        ("spring_constant", "spring", 2e-4, "spring constant", "look at its mass and its spring"),
        ("drag", "disc", 0.02, "drag coefficient", "look at its disc and its mass"),
    ):
        groups: dict[str, list[tuple[str, Estimate]]] = {}
        for run in runs:
            value: Estimate | None = getattr(run, quantity)
            if value is not None and value.value > 0.0:
                groups.setdefault(getattr(run, label), []).append((run.name, value))
        for group in groups.values():
            logs = np.log([value.value for _, value in group])
            middle = float(np.median(logs))
            scatter = max(mad_sigma(logs - middle), least)
            for (name, value), log in zip(group, logs.tolist(), strict=True):
                away = (log - middle) / math.hypot(scatter, value.u / value.value)
                if len(group) >= FEW and abs(away) > FAR:
                    off = 100.0 * math.expm1(log - middle)
                    message = f"its {words} is {off:+.3g} % off that of the others of its {label}: {advice}"
                    found.setdefault(name, Suspect(name, message))
    return tuple(found[run.name] for run in runs if run.name in found)
