"""Compare: do several runs agree on one spring?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimate import Estimate
from pipeline.regression import chi2_quantile

__all__ = ["Comparison", "SpringRun", "compare_springs"]


@dataclass(frozen=True, slots=True)
class SpringRun:
    """What one run says of its spring.

    Parameters
    ----------
    name : str
    angular_frequency : Estimate
        rad/s, from the record's scatter alone: the clock's part is common to all runs and stated apart.
    mass_kg : Estimate
        Effective mass, kg.
    """

    name: str
    angular_frequency: Estimate
    mass_kg: Estimate

    def spring_constant(self, mass_kg: Estimate | None = None) -> Estimate:
        """Return omega^2 m, N/m, without the clock's uncertainty; with another mass where one is given."""
        mass = mass_kg or self.mass_kg
        value = self.angular_frequency.value**2 * mass.value
        relative = math.hypot(
            2.0 * self.angular_frequency.u / self.angular_frequency.value, mass.u / mass.value
        )
        return Estimate(value, value * relative, "N/m")


@dataclass(frozen=True, slots=True)
class Comparison:
    """Whether runs agree on one spring constant.

    Parameters
    ----------
    spring_constant : Estimate
        Weighted mean, N/m, the common clock included.
    each : tuple of Estimate
        Of the runs, the common clock left out.
    chi2 : float
        Of the runs about their mean.
    dof : int
    agree : bool
        Whether chi-square lies within its 99.7 % quantile.
    largest_deviation : float
        Greatest difference of two runs over its standard uncertainty.
    exchanged : tuple of str
        Names of two runs whose masses, or periods, exchanged make all agree where they do not as they stand;
        empty otherwise.
    message : str
    """

    spring_constant: Estimate
    each: tuple[Estimate, ...]
    chi2: float
    dof: int
    agree: bool
    largest_deviation: float
    exchanged: tuple[str, ...]
    message: str


def compare_springs(runs: Sequence[SpringRun], *, u_clock: float = 0.0, probability: float = 0.997) -> Comparison:
    """Test whether runs made with one spring give one spring constant.

    Parameters
    ----------
    runs : sequence of SpringRun
        Two at least.
    u_clock : float
        Relative standard uncertainty of the clock that all runs share; it shifts all constants alike, so it enters
        the mean and not the test.
    probability : float
        Of the chi-square quantile that still counts as agreement.

    Raises
    ------
    ValueError
        If fewer than two runs are given.

    Examples
    --------
    The report's own numbers, with its two periods exchanged as printed:

    >>> bare = SpringRun("undamped", Estimate(8.3458, 0.0158), Estimate(0.2007, 5e-5))
    >>> disc = SpringRun("damped", Estimate(8.6580, 0.0170), Estimate(0.2176, 5e-5))
    >>> result = compare_springs([bare, disc])
    >>> result.agree, result.exchanged
    (False, ('undamped', 'damped'))
    """
    if len(runs) < 2:
        raise ValueError(f"a comparison needs two runs at least, got {len(runs)}")
    each = tuple(run.spring_constant() for run in runs)
    mean, chi2 = _weighted_mean(each)
    dof = len(runs) - 1
    limit = chi2_quantile(probability, dof)
    agree = chi2 <= limit
    pairs = list(itertools.combinations(range(len(runs)), 2))
    deviations = [abs(each[i].value - each[j].value) / max(math.hypot(each[i].u, each[j].u), 1e-300) for i, j in pairs]
    exchanged: tuple[str, ...] = ()
    if not agree:
        for i, j in pairs:
            masses = [run.mass_kg for run in runs]
            masses[i], masses[j] = masses[j], masses[i]
            swapped = [run.spring_constant(mass) for run, mass in zip(runs, masses, strict=True)]
            # Exchanged records need not agree to the last digit: they must be a hundred times nearer to it.
            swapped_chi2 = _weighted_mean(swapped)[1]
            if swapped_chi2 <= max(limit, 0.01 * chi2):
                exchanged = (runs[i].name, runs[j].name)
    total = Estimate(mean.value, math.hypot(mean.u, 2.0 * u_clock * mean.value), "N/m")
    return Comparison(
        total, each, chi2, dof, agree, max(deviations), exchanged, _message(runs, total, agree, max(deviations), exchanged)
    )


def _weighted_mean(each: Sequence[Estimate]) -> tuple[Estimate, float]:
    values = np.array([k.value for k in each])
    weights = np.array([1.0 / max(k.u, 1e-300) ** 2 for k in each])
    mean = float(np.sum(weights * values) / np.sum(weights))
    return Estimate(mean, float(np.sum(weights) ** -0.5), "N/m"), float(np.sum(weights * (values - mean) ** 2))


def _message(
    runs: Sequence[SpringRun], mean: Estimate, agree: bool, deviation: float, exchanged: tuple[str, ...]
) -> str:
    names = ", ".join(run.name for run in runs)
    if agree:
        return f"One spring: {names} agree on k = {mean} (largest difference {deviation:.1f} standard uncertainties)."
    text = f"Not one spring as recorded: {names} differ by {deviation:.1f} standard uncertainties."
    if exchanged:
        text += (
            f" With the masses (or the periods) of {exchanged[0]} and {exchanged[1]} exchanged they come together: "
            "check which record belongs to which bob."
        )
    return text
