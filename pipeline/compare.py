"""Compare: do several runs agree on one spring?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.derive import Derived
from pipeline.errors import AnalysisError
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
        What swings in this run alone: bob, disc, air carried along, kg.
    """

    name: str
    angular_frequency: Estimate
    mass_kg: Estimate

    @classmethod
    def of(cls, name: str, derived: Derived) -> SpringRun:
        """Take what an analysis derived.

        Raises
        ------
        AnalysisError
            If its scene gave no bob mass.
        """
        if derived.own_mass_kg is None:
            raise AnalysisError(f"{name}: a comparison of springs needs [bob] mass_kg in the scene")
        return cls(name, derived.statistical["angular_frequency"], derived.own_mass_kg)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Whether runs agree on one spring constant.

    Parameters
    ----------
    spring_constant : Estimate
        Generalised mean, N/m, shared errors included.
    each : tuple of Estimate
        Of the runs, shared errors included.
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


def compare_springs(
    runs: Sequence[SpringRun],
    *,
    shared_mass_kg: Estimate | None = None,
    u_clock: float = 0.0,
    probability: float = 0.997,
) -> Comparison:
    """Test whether runs made with one spring give one spring constant.

    Parameters
    ----------
    runs : sequence of SpringRun
        Two at least.
    shared_mass_kg : Estimate, optional
        What swings in every run: a third of the spring's mass, kg. Its error is the same in all of them.
    u_clock : float
        Relative standard uncertainty of the clock that all runs share.
    probability : float
        Of the chi-square quantile that still counts as agreement.

    Raises
    ------
    ValueError
        If fewer than two runs are given.

    Notes
    -----
    Generalised least squares for one constant. Errors that the runs share, of the clock and of the spring's mass, fill
    the covariance off its diagonal:
    :math:`V_{ij} = \\delta_{ij} u_i^2 + \\omega_i^2\\omega_j^2 u^2(m_s/3) + 4 u_c^2 k^2`.
    They move all constants together, so they count in the mean's uncertainty and hardly in the test.

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
    shared = shared_mass_kg or Estimate(0.0, 0.0, "kg")
    masses = [run.mass_kg for run in runs]
    fit = _common_constant(runs, masses, shared, u_clock)
    dof = len(runs) - 1
    limit = chi2_quantile(probability, dof)
    agree = fit.chi2 <= limit
    exchanged: tuple[str, ...] = ()
    if not agree:
        for i, j in itertools.combinations(range(len(runs)), 2):
            trial = masses.copy()
            trial[i], trial[j] = trial[j], trial[i]
            # Exchanged records need not agree to the last digit: they must come a hundred times nearer to it.
            if _common_constant(runs, trial, shared, u_clock).chi2 <= max(limit, 0.01 * fit.chi2):
                exchanged = (runs[i].name, runs[j].name)
    message = _message(runs, fit.mean, agree, fit.deviation, exchanged)
    return Comparison(fit.mean, fit.each, fit.chi2, dof, agree, fit.deviation, exchanged, message)


@dataclass(frozen=True, slots=True)
class _Common:
    mean: Estimate
    each: tuple[Estimate, ...]
    chi2: float
    deviation: float


def _common_constant(
    runs: Sequence[SpringRun], masses: Sequence[Estimate], shared: Estimate, u_clock: float
) -> _Common:
    squared = np.array([run.angular_frequency.value**2 for run in runs])
    k = squared * np.array([mass.value + shared.value for mass in masses])
    of_omega = 2.0 * k * np.array([run.angular_frequency.u / run.angular_frequency.value for run in runs])
    own = np.hypot(of_omega, squared * np.array([mass.u for mass in masses]))
    own = np.maximum(own, 1e-15 * k)
    # Shared relative errors at the common value: taken at each value they would favour the smallest.
    centre = float(np.mean(k))
    common = shared.u**2 * np.outer(squared, squared) + (2.0 * u_clock * centre) ** 2
    covariance = np.diag(own**2) + common
    inverse = np.linalg.inv(covariance)
    mean = float(np.sum(inverse @ k) / np.sum(inverse))
    residual = k - mean
    deviations = [
        abs(k[i] - k[j]) / math.sqrt(covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j])
        for i, j in itertools.combinations(range(len(runs)), 2)
    ]
    each = tuple(Estimate(float(x), math.sqrt(v), "N/m") for x, v in zip(k, np.diag(covariance), strict=True))
    total = Estimate(mean, float(np.sum(inverse)) ** -0.5, "N/m")
    return _Common(total, each, float(residual @ inverse @ residual), float(max(deviations)))


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
