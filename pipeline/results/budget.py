"""Uncertainty budgets: the share of each input in the variance of a result.

Inputs become variables of the ``uncertainties`` package, tagged with their names. So a result calculated from them by
ordinary arithmetic contains its dependence on each input, including correlations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from uncertainties import UFloat, correlated_values, ufloat

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.levels import coverage_factor

Evaluation = Literal["A", "B"]


@dataclass(frozen=True, slots=True)
class Contribution:
    """One line of a budget."""

    name: str  # name of the input
    kind: Evaluation  # "A" for scatter of the record, which a longer record reduces by averaging; "B" for other sources
    input: Estimate | None  # value and standard uncertainty of the input; None for a group of correlated parameters
    sensitivity: float | None  # derivative of the result by the input; None for a group
    u: float  # contribution of the input to the standard uncertainty of the result, in the result's unit
    share: float  # share of the input in the variance of the result; the shares of a budget add up to 1
    dof: float = math.inf  # degrees of freedom of u; infinite if u was not estimated from scatter


@dataclass(frozen=True, slots=True)
class Budget:
    """The uncertainty of one result, with the contribution of each input."""

    quantity: str  # name of the result
    estimate: Estimate  # value and standard uncertainty of the result
    # Contributions in descending order of their shares; empty for an exact result.
    contributions: tuple[Contribution, ...]

    def u_of(self, kind: Evaluation) -> float:
        """Return the part of the standard uncertainty from inputs of one kind, in the result's unit."""
        return math.hypot(*(c.u for c in self.contributions if c.kind == kind))

    @property
    def dof(self) -> float:
        """Effective degrees of freedom, :math:`\\nu = u^4 / \\sum_i u_i^4/\\nu_i` (JCGM 100:2008, G.4.1)."""
        below = sum(c.share**2 / c.dof for c in self.contributions)
        return 1.0 / below if below > 0.0 else math.inf

    @property
    def coverage_factor(self) -> float:
        """Coverage factor k on u: quantile of Student's t for :attr:`dof` (EA-4/02 M:2022, appendix E)."""
        return coverage_factor(self.dof)

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U = k u, in the result's unit."""
        return self.coverage_factor * self.estimate.u


class Inputs:
    """Input quantities by name, as variables to calculate with.

    k = omega^2 m, with u(k)^2 = (2 omega m u(omega))^2 + (omega^2 u(m))^2 = 0.0256^2 + 0.0064^2:

    >>> inputs = Inputs()
    >>> omega = inputs.add("angular_frequency", Estimate(8.0, 0.008, "rad/s"), "A")
    >>> mass = inputs.add("bob_mass", Estimate(0.2, 1e-4, "kg"), "B")
    >>> budget = inputs.budget("spring_constant", omega**2 * mass, "N/m")
    >>> for c in budget.contributions:
    ...     print(c.name, c.kind, f"{c.sensitivity:.1f} {c.u:.4f} {c.share:.3f}")
    angular_frequency A 3.2 0.0256 0.941
    bob_mass B 64.0 0.0064 0.059
    """

    def __init__(self) -> None:
        # The kind of every input, its degrees of freedom, and its estimate if it is a single one.
        self._inputs: dict[str, tuple[Evaluation, float, Estimate | None]] = {}

    def add(self, name: str, estimate: Estimate, kind: Evaluation, dof: float = math.inf) -> Any:
        """Return an input as a variable, or as a plain number if it is exact."""
        self._register(name, kind, dof, estimate)
        if not (math.isfinite(estimate.u) and estimate.u >= 0):
            raise AnalysisError(
                f"{name}: a standard uncertainty must be finite and not negative, got {estimate.u:g}", "check the input"
            )
        return ufloat(estimate.value, estimate.u, name) if estimate.u > 0 else estimate.value

    def add_joint(self, name: str, joint: Joint, dof: float = math.inf) -> list[Any]:
        """Return what a fit of the record gives together as correlated variables, one line in every budget."""
        self._register(name, "A", dof)
        return list(correlated_values(joint.values.tolist(), joint.covariance, [name] * joint.values.size))

    def add_errors(self, name: str, sizes: Mapping[str, float]) -> dict[str, Any]:
        """Return a variable of mean 0 for each standard uncertainty; they are one line in every budget."""
        self._register(name, "B")
        return {key: ufloat(0.0, u, name) if u > 0 else 0.0 for key, u in sizes.items()}

    def budget(self, quantity: str, x: Any, unit: str) -> Budget:
        """Return the budget of a result calculated from these inputs."""
        # Sorted by name, because sums of floats depend on their order, and the order of the mapping on addresses.
        by_input = x.derivatives if isinstance(x, UFloat) else {}
        parts = sorted((of.tag, abs(float(slope) * of.std_dev), float(slope)) for of, slope in by_input.items())
        if not any(error for _, error, _ in parts):
            return Budget(quantity, Estimate.of_variable(x, unit), ())
        variances: dict[str, float] = {}
        slopes: dict[str, float] = {}
        for name, error, derivative in parts:
            variances[name] = variances.get(name, 0.0) + error**2
            slopes[name] = derivative
        whole = sum(variances.values())
        lines = []
        for name, variance in sorted(variances.items(), key=lambda item: (-item[1], item[0])):
            if variance > 1e-12 * whole:  # smaller values are rounding errors of dependences that cancel
                kind, dof, given = self._inputs[name]
                slope = None if given is None else slopes[name]
                lines.append(Contribution(name, kind, given, slope, math.sqrt(variance), variance / whole, dof))
        return Budget(quantity, Estimate.of_variable(x, unit, math.sqrt(whole)), tuple(lines))

    def _register(self, name: str, kind: Evaluation, dof: float = math.inf, estimate: Estimate | None = None) -> None:
        if name in self._inputs:
            raise ValueError(f"an input {name!r} is there already")
        self._inputs[name] = kind, max(dof, 1.0), estimate


def joint_of(estimates: Mapping[str, Estimate]) -> Joint:
    """Return estimates with their covariance, from the inputs that they were calculated from.

    >>> period = Estimate(0.8, 0.001, "s")
    >>> both = joint_of({"period": period, "frequency": Estimate.of_variable(1 / period, "Hz")})
    >>> both.correlation.round(6).tolist()
    [[1.0, -1.0], [-1.0, 1.0]]
    """
    each = list(estimates.values())
    # One row for each estimate and one column for each variable; the package's own function is slower, because it loops
    # over all pairs of variables of all pairs of estimates. Exact estimates depend on no variable.
    components = [estimate.ufloat.derivatives if estimate.u > 0 else {} for estimate in each]
    column = {variable: k for k, variable in enumerate(dict.fromkeys(v for slopes in components for v in slopes))}
    parts = np.zeros((len(each), len(column)))
    for row, slopes in zip(parts, components, strict=True):
        for variable, slope in slopes.items():
            row[column[variable]] = slope * variable.std_dev
    covariance = parts @ parts.T
    values = np.array([estimate.value for estimate in each])
    return Joint(tuple(estimates), values, covariance, tuple(estimate.unit for estimate in each))
