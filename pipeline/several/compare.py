"""Compare: do several runs agree on one spring?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.bench.spring import HEAVIEST_SHARE, oscillating_mass_kg, unstated_spring_kg
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import central_differences, minimise
from pipeline.numerics.levels import FALSE_ALARM, NEGLIGIBLE
from pipeline.numerics.regression import chi2_quantile
from pipeline.numerics.threads import one_thread
from pipeline.results.derive import Derived
from pipeline.track import F8

# Maximum uncertainty of the spring's mass, over its prior uncertainty, for which the runs determine it: it is chosen,
# and weighs the runs three times as much as the prior.
SOLVED = 0.5
SUSPECTS = 8  # maximum number of runs exchanged pair by pair, those farthest from the mean: it is chosen, for 28 fits


@dataclass(frozen=True, slots=True)
class SpringRun:
    """The result of one run for its spring."""

    name: str
    # Angular frequency of the undamped motion, rad/s. Its uncertainty is that from scatter of the record and from a
    # frequency that changes during it; that of the clock may be common to several runs and is separate.
    angular_frequency: Estimate
    mass_kg: Estimate  # oscillating mass without the spring: bob, disc and air carried along
    u_clock: float = 0.0  # relative standard uncertainty of the clock's rate
    clock: str = ""  # runs with the same name share the clock and its error

    @classmethod
    def of(cls, name: str, derived: Derived, *, clock: str = "") -> SpringRun:
        """Make a run from the results of an analysis."""
        if derived.own_mass_kg is None or derived.effective_mass_kg is None:
            raise AnalysisError(f"{name}: a comparison of springs needs [bob] mass_kg in the scene")
        if "spring_constant" not in derived.estimates:
            raise AnalysisError(f"{name}: an angle gives a spring constant only with [spring] mass_kg in the scene")
        omega = derived.statistical["angular_frequency"]
        parts = derived.budgets["angular_frequency"].contributions
        u_clock = math.hypot(*(c.u for c in parts if c.name == "clock_rate")) / omega.value
        # The frequency without damping, from the run's own spring constant.
        k = derived.estimates["spring_constant"].value
        natural = math.sqrt(k / derived.effective_mass_kg.value)
        # A frequency that changes during the run makes k uncertain too, by its difference to the mean.
        changing = [c.u for c in derived.budgets["spring_constant"].contributions if c.name == "mean_frequency"]
        u = math.hypot(omega.u, *(0.5 * natural * each / k for each in changing))
        return cls(name, Estimate(natural, u, "rad/s"), derived.own_mass_kg, u_clock, clock)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Whether runs agree on one spring: the fit of one constant and one mass of the spring to all of them."""

    names: tuple[str, ...]
    spring_constant: Estimate  # generalised mean, N/m, including shared errors
    # Mass of the spring, kg: the stated mass combined with the runs, or the mass that the runs determine.
    spring_mass: Estimate
    # Whether the mass of the spring was stated. If it was not, the runs may determine it together with the constant.
    spring_mass_stated: bool
    solved: bool  # whether the runs determine a mass of the spring that was not stated
    each: tuple[Estimate, ...]  # spring constant of each run, N/m, including shared errors
    own_u: tuple[float, ...]  # part of the standard uncertainty of each run that it does not share with the others, N/m
    # Difference between each run and the mean, over the standard uncertainty of this difference.
    pulls: tuple[float, ...]
    chi2: float  # chi-square of the runs about their mean, and of the spring's mass about the stated value
    # Number of runs less one for the constant, and less one more if they determine the spring's mass; 0 if nothing is
    # tested.
    dof: int
    # Chi-square over its quantile, or the same of a mass of the spring that the runs determine: at most 1 is agreement.
    tension: float
    # Largest difference between two runs over its standard uncertainty, in which shared errors cancel.
    largest_deviation: float
    # Names of two runs, if all runs agree, or agree far better, after the masses (or the periods) of these two are
    # exchanged; otherwise empty.
    exchanged: tuple[str, ...] = ()
    exchanged_chi2: float | None = None  # chi-square of the runs after this exchange
    message: str = ""  # the result in words

    @property
    def agree(self) -> bool:
        """Whether all runs agree on one constant and a plausible mass of the spring."""
        return self.tension <= 1.0

    @property
    def nearer(self) -> float:
        """The tension up to which an exchange explains this one: the runs agree, or deviate by a tenth as much."""
        return max(NEGLIGIBLE**2 * self.tension, 1.0)


@one_thread
def compare_springs(
    runs: Sequence[SpringRun], *, spring_mass_kg: Estimate | None = None, mass_correlation: float = 0.0
) -> Comparison:
    """Test whether runs made with one spring give one spring constant.

    The constant k and the mass s of the spring are fitted by generalised least squares to :math:`k = \\omega_i^2 M(s,
    m_i)`, where M is the oscillating mass (:func:`pipeline.bench.spring.oscillating_mass_kg`). The covariance of the
    right-hand sides is :math:`V_{ij} = \\delta_{ij} u_i^2 + 4 u_{c,i} u_{c,j} k^2 + r\\,\\omega_i^2\\omega_j^2 u(m_i)
    u(m_j)`. The clock's term applies only to runs with the same clock. Errors that runs share change all constants
    together and so hardly affect the test. A stated mass of the spring is one more observation; if it is not stated,
    the observation is :func:`pipeline.bench.spring.unstated_spring_kg` for the lightest bob, so uncertain that runs
    with different masses outweigh it. The mass then takes one degree of freedom, so two runs determine it but do not
    test it.

    If the runs disagree, the eight runs farthest from the mean are exchanged pair by pair. A pair is reported if its
    exchange makes all runs agree, or reduces their tension to a hundredth.

    The numbers of the report, with its two periods exchanged as printed:

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
    masses = [run.mass_kg for run in runs]
    fit = _fit(runs, masses, spring_mass_kg, mass_correlation)
    best, exchanged = fit, tuple[str, ...]()
    if not fit.agree:
        farthest = sorted(np.argsort(-np.abs(fit.pulls), kind="stable")[:SUSPECTS].tolist())
        for i, j in itertools.combinations(farthest, 2):
            trial = masses.copy()
            trial[i], trial[j] = trial[j], trial[i]
            other = _fit(runs, trial, spring_mass_kg, mass_correlation)
            if other.tension <= fit.nearer and (not exchanged or other.tension < best.tension):
                best, exchanged = other, (runs[i].name, runs[j].name)
    message = _message(fit, exchanged, best)
    return replace(fit, exchanged=exchanged, exchanged_chi2=best.chi2 if exchanged else None, message=message)


def _fit(
    runs: Sequence[SpringRun], masses: Sequence[Estimate], stated: Estimate | None, mass_correlation: float
) -> Comparison:
    loads = np.array([mass.value for mass in masses])
    spring = stated or unstated_spring_kg(float(loads.min()))
    squared = np.array([run.angular_frequency.value**2 for run in runs])
    covariance, own = shared_covariance(runs, masses, squared * _oscillating(spring.value, loads), mass_correlation)
    line = spring_line(squared, loads, covariance, spring)
    solved = stated is None and line.spring.u < SOLVED * spring.u
    constant, found = line.constant, line.spring
    if stated is None and not solved:
        # If the bobs are too similar, the prior mass of the spring is used, and its uncertainty enters that of k.
        of_spring = float(np.mean(line.slope)) * spring.u
        line = spring_line(squared, loads, covariance, Estimate(spring.value, 0.0, "kg"))
        constant = Estimate(line.constant.value, math.hypot(line.constant.u, of_spring), "N/m")
        found = spring
    chi2 = float(line.residual @ np.linalg.solve(covariance, line.residual))
    dof = len(runs) - (2 if solved else 1)
    if stated is not None and stated.u > 0:
        chi2 += ((line.spring.value - stated.value) / stated.u) ** 2
    tension = chi2 / chi2_quantile(1.0 - FALSE_ALARM, dof) if dof else 0.0
    if solved:
        # The mass of a spring cannot be negative, and a heavy spring would have been weighed.
        heaviest = 2.0 * HEAVIEST_SHARE * float(loads.min())
        away = max(-found.value, found.value - heaviest, 0.0) / max(found.u, 1e-12 * heaviest)
        tension = max(tension, away**2 / chi2_quantile(1.0 - FALSE_ALARM, 1))
    # With a stated spring, each constant is that of the run's own analysis. Without a usable mass it excludes the
    # spring.
    shown = stated or (found if solved and tension <= 1.0 else Estimate(0.0, 0.0, "kg"))
    each = squared * _oscillating(shown.value, loads)
    whole = covariance + shown.u**2 * np.outer(line.slope, line.slope)
    variances = np.diag(whole)
    i, j = np.triu_indices(len(runs), 1)
    deviations = np.abs(each[i] - each[j]) / np.sqrt(variances[i] + variances[j] - 2.0 * whole[i, j])
    return Comparison(
        names=tuple(run.name for run in runs),
        spring_constant=constant,
        spring_mass=found,
        spring_mass_stated=stated is not None,
        solved=solved,
        each=tuple(Estimate(float(value), math.sqrt(v), "N/m") for value, v in zip(each, variances, strict=True)),
        own_u=tuple(map(float, own)),
        pulls=tuple(map(float, line.residual / line.u_residual)),
        chi2=chi2,
        dof=dof,
        tension=tension,
        largest_deviation=float(deviations.max()),
    )


@dataclass(frozen=True, slots=True)
class SpringLine:
    """The weighted line through the runs: constant, mass of the spring, and the residual of each run, N/m."""

    constant: Estimate
    spring: Estimate
    slope: F8  # derivative of each run's constant by the spring's mass, N/(m kg); 0 if that mass is exact
    residual: F8
    u_residual: F8


def spring_line(squared: F8, loads: F8, covariance: F8, spring: Estimate) -> SpringLine:
    """Fit constant and mass of the spring by least squares, with the prior mass as one observation."""
    factor, prior = np.linalg.cholesky(covariance), np.array([spring.value])

    def constants(spring_kg: F8) -> F8:
        return squared * _oscillating(spring_kg[0], loads)

    def residuals(theta: F8) -> F8:
        apart = np.linalg.solve(factor, constants(theta[1:] if theta.size > 1 else prior) - theta[0])
        return np.append(apart, (theta[1:] - spring.value) / spring.u)

    start = np.append(np.mean(constants(prior)), prior if spring.u > 0 else [])
    fit = minimise(residuals, start, precision=1e-6)
    mass = fit.values[1:] if spring.u > 0 else prior
    slope = central_differences(constants, mass)[:, 0] if spring.u > 0 else np.zeros_like(squared)
    design = np.column_stack([np.ones_like(squared), -slope])[:, : start.size]
    u = np.sqrt(np.diag(fit.covariance)).tolist()
    of_residual = np.diag(covariance - design @ fit.covariance @ design.T)
    return SpringLine(
        Estimate(float(fit.values[0]), u[0], "N/m"),
        Estimate(float(mass[0]), u[1] if spring.u > 0 else 0.0, "kg"),
        slope,
        constants(mass) - fit.values[0],
        np.sqrt(np.maximum(of_residual, 1e-24 * np.diag(covariance))),
    )


def _oscillating(spring_kg: float, loads: F8) -> F8:
    return np.array([oscillating_mass_kg(spring_kg, float(load)) for load in loads])


def shared_covariance(
    runs: Sequence[SpringRun], masses: Sequence[Estimate], each: F8, mass_correlation: float
) -> tuple[F8, F8]:
    """Return the covariance (n, n) of the runs' constants, and the standard uncertainties (n,) that are not shared."""
    squared = np.array([run.angular_frequency.value**2 for run in runs])
    of_omega = 2.0 * each * np.array([run.angular_frequency.u / run.angular_frequency.value for run in runs])
    of_mass = squared * np.array([mass.u for mass in masses])
    own = np.hypot(of_omega, of_mass * math.sqrt(1.0 - mass_correlation))
    own = np.maximum(own, 1e-15 * each)
    # Shared relative errors are multiplied by the mean value: with each run's own, small values would get more weight.
    of_clock = 2.0 * float(np.mean(each)) * np.array([run.u_clock for run in runs])
    one_clock = np.array([[a.clock == b.clock for b in runs] for a in runs])
    common = np.where(one_clock, np.outer(of_clock, of_clock), 0.0) + mass_correlation * np.outer(of_mass, of_mass)
    return np.diag(own**2) + common, own


def _message(fit: Comparison, exchanged: tuple[str, ...], best: Comparison) -> str:
    together, difference = ", ".join(fit.names), f"{fit.largest_deviation:.1f} standard uncertainties"
    if not fit.agree:
        text = f"Not one spring as recorded: {together} differ by {difference}."
    elif fit.dof:
        text = f"One spring: {together} agree on k = {fit.spring_constant} (largest difference {difference})."
    else:
        text = f"Two runs determine k = {fit.spring_constant} and the spring's mass without a test: add a third bob."
    if fit.agree and fit.solved:
        grams = Estimate(1e3 * fit.spring_mass.value, 1e3 * fit.spring_mass.u, "g")
        text += f" The spring then weighs {grams}, which the scene does not state."
    if exchanged:
        text += (
            f" With the masses (or the periods) of {exchanged[0]} and {exchanged[1]} exchanged they "
            f"{'agree' if best.agree else 'come together'}: check which record belongs to which bob."
        )
    return text
