"""Compare: do several runs agree on one spring?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import chi2_quantile
from pipeline.results.derive import Derived

__all__ = ["Comparison", "SpringRun", "compare_springs"]

NEARER = 0.01  # of chi-square: so much less with two runs exchanged is no chance


@dataclass(frozen=True, slots=True)
class SpringRun:
    """What one run says of its spring.

    Parameters
    ----------
    name : str
    angular_frequency : Estimate
        Of the undamped motion, rad/s, from the record's scatter alone: the clock's part is common to runs and stated
        apart.
    mass_kg : Estimate
        What swings in this run alone: bob, disc, air carried along, kg.
    u_clock : float
        Relative standard uncertainty of the clock's rate.
    clock : str
        Runs with one name here share one clock, error and all.
    """

    name: str
    angular_frequency: Estimate
    mass_kg: Estimate
    u_clock: float = 0.0
    clock: str = ""

    @classmethod
    def of(cls, name: str, derived: Derived, *, clock: str = "") -> SpringRun:
        """Take what an analysis derived.

        Raises
        ------
        AnalysisError
            If its scene gave no bob mass.
        """
        if derived.own_mass_kg is None or derived.effective_mass_kg is None:
            raise AnalysisError(f"{name}: a comparison of springs needs [bob] mass_kg in the scene")
        omega = derived.statistical["angular_frequency"]
        parts = derived.budgets["angular_frequency"].contributions
        u_clock = math.hypot(*(c.u for c in parts if c.name == "clock_rate")) / omega.value
        # Of the spring without damping, as the run's own constant has it.
        k = derived.estimates["spring_constant"].value
        natural = math.sqrt(k / derived.effective_mass_kg.value)
        return cls(name, Estimate(natural, omega.u, "rad/s"), derived.own_mass_kg, u_clock, clock)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Whether runs agree on one spring constant.

    Parameters
    ----------
    names : tuple of str
    spring_constant : Estimate
        Generalised mean, N/m, shared errors included.
    each : tuple of Estimate
        Of the runs, shared errors included.
    own_u : tuple of float
        Of the runs, what they do not share, N/m.
    pulls : tuple of float
        Difference of each run to the mean over the difference's own standard uncertainty.
    chi2 : float
        Of the runs about their mean.
    dof : int
    agree : bool
        Whether chi-square lies within its 99.7 % quantile.
    largest_deviation : float
        Greatest difference of two runs over its standard uncertainty, in which shared errors cancel.
    exchanged : tuple of str
        Names of two runs whose masses, or periods, exchanged make all agree where they do not as they stand;
        empty otherwise.
    exchanged_chi2 : float or None
        Of the runs with those two exchanged.
    message : str
    """

    names: tuple[str, ...]
    spring_constant: Estimate
    each: tuple[Estimate, ...]
    own_u: tuple[float, ...]
    pulls: tuple[float, ...]
    chi2: float
    dof: int
    agree: bool
    largest_deviation: float
    exchanged: tuple[str, ...] = ()
    exchanged_chi2: float | None = None
    message: str = ""


def compare_springs(
    runs: Sequence[SpringRun],
    *,
    shared_mass_kg: Estimate | None = None,
    mass_correlation: float = 0.0,
    probability: float = 0.997,
) -> Comparison:
    """Test whether runs made with one spring give one spring constant.

    Parameters
    ----------
    runs : sequence of SpringRun
        Two at least.
    shared_mass_kg : Estimate, optional
        What swings in every run: a third of the spring's mass, kg. Its error is the same in all of them.
    mass_correlation : float
        Of the errors of any two runs' own masses, 0 to 1: 1 where one balance's calibration is all that is uncertain.
    probability : float
        Of the chi-square quantile that still counts as agreement.

    Raises
    ------
    ValueError
        If fewer than two runs are given, or the correlation lies outside 0 to 1.
    AnalysisError
        If a mass or a frequency is not positive, or an uncertainty negative or no number.

    Notes
    -----
    Generalised least squares for one constant. Errors that the runs share, of the clock, of the spring's mass and of
    the balance, fill the covariance off its diagonal:
    :math:`V_{ij} = \\delta_{ij} u_i^2 + \\omega_i^2\\omega_j^2 u^2(m_s/3) + 4 u_{c,i} u_{c,j} k^2
    + r\\,\\omega_i^2\\omega_j^2 u(m_i) u(m_j)`, the clock's term where two runs share it.
    They move all constants together, so they count in the mean's uncertainty and hardly in the test. The distances'
    scale is in no spring constant.

    Where the runs disagree every pair is exchanged in turn, and the pair is named that brings all runs into agreement,
    or a hundred times nearer to it: exchanged records need not agree to the last digit.

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
    if not 0.0 <= mass_correlation <= 1.0:
        raise ValueError(f"mass_correlation must lie in 0 to 1, got {mass_correlation}")
    shared = shared_mass_kg or Estimate(0.0, 0.0, "kg")
    _check(runs, shared)
    masses = [run.mass_kg for run in runs]
    limit = chi2_quantile(probability, len(runs) - 1)
    found = _common_constant(runs, masses, shared, mass_correlation, limit)
    if not found.agree:
        nearest = max(limit, NEARER * found.chi2)
        for i, j in itertools.combinations(range(len(runs)), 2):
            trial = masses.copy()
            trial[i], trial[j] = trial[j], trial[i]
            chi2 = _common_constant(runs, trial, shared, mass_correlation, limit).chi2
            if chi2 <= nearest:
                nearest = chi2
                found = replace(found, exchanged=(runs[i].name, runs[j].name), exchanged_chi2=chi2)
    return replace(found, message=_message(found, limit))


def _check(runs: Sequence[SpringRun], shared: Estimate) -> None:
    for run in runs:
        for what, x in (("angular frequency", run.angular_frequency), ("mass", run.mass_kg)):
            if not (math.isfinite(x.value) and x.value > 0):
                raise AnalysisError(f"{run.name}: its {what} must be positive, got {x.value:g} {x.unit}".rstrip())
            if not (math.isfinite(x.u) and x.u >= 0):
                raise AnalysisError(f"{run.name}: the uncertainty of its {what} must not be negative, got {x.u:g}")
        if not (math.isfinite(run.u_clock) and run.u_clock >= 0):
            raise AnalysisError(f"{run.name}: the clock's uncertainty must not be negative, got {run.u_clock:g}")
    if not all(math.isfinite(x) and x >= 0 for x in (shared.value, shared.u)):
        raise AnalysisError(f"the spring's share must not be negative, nor its uncertainty, got {shared}")


def _common_constant(
    runs: Sequence[SpringRun], masses: Sequence[Estimate], shared: Estimate, mass_correlation: float, limit: float
) -> Comparison:
    """Compare the runs with these masses, as they stand; they agree up to a limit of chi-square."""
    squared = np.array([run.angular_frequency.value**2 for run in runs])
    k = squared * np.array([mass.value + shared.value for mass in masses])
    of_omega = 2.0 * k * np.array([run.angular_frequency.u / run.angular_frequency.value for run in runs])
    of_mass = squared * np.array([mass.u for mass in masses])
    own = np.hypot(of_omega, of_mass * math.sqrt(1.0 - mass_correlation))
    own = np.maximum(own, 1e-15 * k)
    # Shared relative errors at the common value: taken at each value they would favour the smallest.
    of_clock = 2.0 * float(np.mean(k)) * np.array([run.u_clock for run in runs])
    one_clock = np.array([[a.clock == b.clock for b in runs] for a in runs])
    common = shared.u**2 * np.outer(squared, squared) + np.where(one_clock, np.outer(of_clock, of_clock), 0.0)
    common += mass_correlation * np.outer(of_mass, of_mass)
    covariance = np.diag(own**2) + common
    inverse = np.linalg.inv(covariance)
    weight = float(np.sum(inverse))
    mean = float(np.sum(inverse @ k) / weight)
    residual = k - mean
    # The mean holds each run: the difference to it is known better than the run itself.
    u_residual = np.sqrt(np.maximum(np.diag(covariance) - 1.0 / weight, np.finfo(float).tiny))
    deviations = [
        abs(k[i] - k[j]) / math.sqrt(covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j])
        for i, j in itertools.combinations(range(len(runs)), 2)
    ]
    each = tuple(Estimate(float(x), math.sqrt(v), "N/m") for x, v in zip(k, np.diag(covariance), strict=True))
    chi2 = float(residual @ inverse @ residual)
    return Comparison(
        tuple(run.name for run in runs),
        Estimate(mean, weight**-0.5, "N/m"),
        each,
        tuple(map(float, own)),
        tuple(map(float, residual / u_residual)),
        chi2,
        len(runs) - 1,
        chi2 <= limit,
        float(max(deviations)),
    )


def _message(found: Comparison, limit: float) -> str:
    together = ", ".join(found.names)
    if found.agree:
        return (
            f"One spring: {together} agree on k = {found.spring_constant} "
            f"(largest difference {found.largest_deviation:.1f} standard uncertainties)."
        )
    text = f"Not one spring as recorded: {together} differ by {found.largest_deviation:.1f} standard uncertainties."
    if found.exchanged_chi2 is not None:
        text += (
            f" With the masses (or the periods) of {' and '.join(found.exchanged)} exchanged they "
            f"{'agree' if found.exchanged_chi2 <= limit else 'come together'}: check which record belongs to which bob."
        )
    return text
