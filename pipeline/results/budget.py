"""Uncertainty budgets: which input contributes what share of a result's variance.

Inputs become variables of the ``uncertainties`` package, each marked with its name, so that a result made of them by
ordinary arithmetic knows what it came from, correlations included.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate, Joint

__all__ = [
    "Budget",
    "Budgets",
    "Contribution",
    "Inputs",
    "Kind",
    "added",
    "estimate_of",
    "function",
    "linear",
    "product",
]

Kind = Literal["A", "B"]

ROOT_OF_ROUNDING = math.sqrt(sys.float_info.epsilon)


@dataclass(frozen=True, slots=True)
class Contribution:
    """One line of a budget.

    Parameters
    ----------
    name : str
        Of the input.
    kind : {"A", "B"}
        "A" from the record's own scatter, which a longer record averages away; "B" from anything else.
    input : Estimate or None
        Value and standard uncertainty of the input; None for a group of correlated parameters.
    sensitivity : float or None
        Derivative of the result by the input; None for a group.
    u : float
        What the input contributes to the result's standard uncertainty, in the result's unit.
    share : float
        Of the result's variance; the shares of a budget add up to 1.
    """

    name: str
    kind: Kind
    input: Estimate | None
    sensitivity: float | None
    u: float
    share: float


@dataclass(frozen=True, slots=True)
class Budget:
    """The uncertainty of one result, input by input.

    Parameters
    ----------
    quantity : str
    estimate : Estimate
    contributions : tuple of Contribution
        The greatest share first; empty for an exact result.
    """

    quantity: str
    estimate: Estimate
    contributions: tuple[Contribution, ...]

    def u_of(self, kind: Kind) -> float:
        """Return the part of the standard uncertainty that inputs of one kind contribute, in the result's unit."""
        return math.hypot(*(c.u for c in self.contributions if c.kind == kind))


class Inputs:
    """Input quantities by name, as variables to calculate with.

    Examples
    --------
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
        self._kinds: dict[str, Kind] = {}
        self._groups: set[str] = set()

    def add(self, name: str, estimate: Estimate, kind: Kind) -> Any:
        """Return an input as a variable; a plain number where it is exact.

        Parameters
        ----------
        name : str
            Unique.
        estimate : Estimate
        kind : {"A", "B"}

        Raises
        ------
        ValueError
            If the name was used before.
        AnalysisError
            If the uncertainty is negative or no number.
        """
        self._register(name, kind)
        if not (math.isfinite(estimate.u) and estimate.u >= 0):
            raise AnalysisError(
                f"{name}: a standard uncertainty must be finite and not negative, got {estimate.u:g}; check the input"
            )
        if not estimate.u > 0:
            return estimate.value
        return _variable()(estimate.value, estimate.u, (name, estimate.unit))

    def add_joint(self, name: str, joint: Joint, kind: Kind) -> list[Any]:
        """Return parameters estimated together as correlated variables; they are one line in every budget.

        Parameters
        ----------
        name : str
            Of the group.
        joint : Joint
        kind : {"A", "B"}
        """
        self._register(name, kind)
        self._groups.add(name)
        root = _root(joint.covariance.tolist())
        independent = [_variable()(0.0, 1.0, (name, "")) for _ in root]
        return [
            linear(value, zip(row, independent, strict=False))
            for value, row in zip(joint.values.tolist(), root, strict=True)
        ]

    def add_alternatives(self, name: str, weights: Mapping[str, float], kind: Kind) -> dict[str, Any]:
        """Return a variable of mean 0 and variance w for each alternative; they are one line in every budget.

        A result x that would be x_i under the alternative i is x + sum_i (x_i - x) z_i, whose variance holds
        sum_i w_i (x_i - x)^2, with the same sign for all results that an alternative moves together.
        """
        self._register(name, kind)
        self._groups.add(name)
        variable = _variable()
        return {key: variable(0.0, math.sqrt(w), (name, "")) if w > 0 else 0.0 for key, w in weights.items()}

    def budget(self, quantity: str, x: Any, unit: str) -> Budget:
        """Return the budget of a result made of these inputs.

        Parameters
        ----------
        quantity : str
        x : number or variable
        unit : str
        """
        total = estimate_of(x, unit)
        if total.u == 0:
            return Budget(quantity, total, ())
        variances: dict[str, float] = {}
        single: dict[str, tuple[Estimate | None, float | None]] = {}
        # Ordered by name: sums of floats depend on their order, and a mapping's order on addresses.
        parts = sorted(x.error_components().items(), key=lambda part: (part[0].tag, part[0].nominal_value, part[1]))
        for variable, error in parts:
            name, input_unit = variable.tag
            variances[name] = variances.get(name, 0.0) + float(error) ** 2
            if name not in self._groups:
                given = Estimate(float(variable.nominal_value), float(variable.std_dev), input_unit)
                single[name] = (given, float(x.derivatives[variable]))
        whole = sum(variances.values())
        lines = []
        for name, variance in sorted(variances.items(), key=lambda item: (-item[1], item[0])):
            if variance > 1e-12 * whole:  # less is rounding where a dependence cancels
                alone = single.get(name, (None, None))
                lines.append(Contribution(name, self._kinds[name], *alone, math.sqrt(variance), variance / whole))
        return Budget(quantity, total, tuple(lines))

    def _register(self, name: str, kind: Kind) -> None:
        if name in self._kinds:
            raise ValueError(f"an input {name!r} is there already")
        self._kinds[name] = kind


class Budgets(Mapping[str, Budget]):
    """Budgets of several results, each worked out when it is asked for.

    Parameters
    ----------
    inputs : Inputs
    results : mapping of str to (variable, str)
        Made of the inputs, with units.
    """

    def __init__(self, inputs: Inputs, results: Mapping[str, tuple[Any, str]]) -> None:
        self._inputs, self._results = inputs, results
        self._known: dict[str, Budget] = {}

    def __getitem__(self, quantity: str) -> Budget:
        if quantity not in self._known:
            self._known[quantity] = self._inputs.budget(quantity, *self._results[quantity])
        return self._known[quantity]

    def __iter__(self) -> Iterator[str]:
        return iter(self._results)

    def __len__(self) -> int:
        return len(self._results)


def estimate_of(x: Any, unit: str) -> Estimate:
    """Return value and standard uncertainty of a variable, or of an exact number."""
    if isinstance(x, _library().AffineScalarFunc):
        # As the package's std_dev, without the dictionary of components.
        variance = sum((slope * variable.std_dev) ** 2 for variable, slope in x.derivatives.items())
        return Estimate(x.nominal_value, math.sqrt(variance), unit)
    return Estimate(float(x), 0.0, unit)


def linear(value: float, terms: Iterable[tuple[float, Any]]) -> Any:
    """Return a variable of that value which varies as the sum of slopes times variables, built in one go.

    Parameters
    ----------
    value : float
    terms : iterable of (float, variable or number)
        Slope and what it belongs to; plain numbers are exact and add nothing.

    Examples
    --------
    >>> from uncertainties import ufloat
    >>> print(linear(7.0, [(3.0, ufloat(1.0, 0.1)), (4.0, ufloat(5.0, 0.1)), (1.0, 2.0)]))
    7.0+/-0.5
    """
    library = _library()
    slopes: dict[Any, float] = {}
    for slope, x in terms:
        if slope and isinstance(x, library.AffineScalarFunc):
            for variable, own in x.derivatives.items():
                slopes[variable] = slopes.get(variable, 0.0) + float(slope) * own
    return library.AffineScalarFunc(value, library.LinearCombination(slopes))


def added(*xs: Any) -> Any:
    """Return the sum of variables and numbers, built in one go; a number where all are exact.

    Examples
    --------
    >>> from uncertainties import ufloat
    >>> print(added(ufloat(1.0, 0.3), 2.0, ufloat(3.0, 0.4)))
    6.0+/-0.5
    """
    variable = _library().AffineScalarFunc
    if not any(isinstance(x, variable) for x in xs):
        return sum(xs)
    value = sum(x.nominal_value if isinstance(x, variable) else x for x in xs)
    return linear(value, [(1.0, x) for x in xs])


def function(f: Callable[..., float], *xs: Any) -> Any:
    """Return a smooth function of variables and numbers as a variable, built in one go; a number where all are exact.

    Parameters
    ----------
    f : callable
        Of as many numbers as are given.
    *xs : variable or number

    Notes
    -----
    Central differences over the root of the rounding, relative, as the package's ``wrap`` takes them.

    Examples
    --------
    >>> from uncertainties import ufloat
    >>> print(function(math.hypot, ufloat(3.0, 0.05), 4.0))
    5.000+/-0.030
    """
    variable = _library().AffineScalarFunc
    numbers = [x.nominal_value if isinstance(x, variable) else x for x in xs]
    terms = []
    for i, x in enumerate(xs):
        if isinstance(x, variable):
            step = ROOT_OF_ROUNDING * (abs(numbers[i]) or 1.0)
            above = f(*numbers[:i], numbers[i] + step, *numbers[i + 1 :])
            below = f(*numbers[:i], numbers[i] - step, *numbers[i + 1 :])
            terms.append(((above - below) / (2.0 * step), x))
    return linear(f(*numbers), terms) if terms else f(*numbers)


def product(factor: float, *powers: tuple[Any, int]) -> Any:
    """Return a factor times powers of variables as one variable, built in one go; a number where all are exact.

    Parameters
    ----------
    factor : float
    *powers : (variable or number, int)
        What to multiply by, and its exponent.

    Examples
    --------
    >>> from uncertainties import ufloat
    >>> print(product(2.0, (ufloat(3.0, 0.1), 2), (ufloat(4.0, 0.1), -1), (2.0, 1)))
    9.0+/-0.6
    """
    library = _library()
    value, uncertain = factor, []
    for x, power in powers:
        if isinstance(x, library.AffineScalarFunc):
            number = x.nominal_value
            uncertain.append((x.derivatives, number, power))
        else:
            number = x
        value *= number**power
    if not uncertain:
        return value
    slopes: dict[Any, float] = {}
    for i, (derivatives, number, power) in enumerate(uncertain):
        if number:
            slope = value * power / number
        else:
            others = math.prod(n**p for j, (_, n, p) in enumerate(uncertain) if j != i)
            slope = factor * others * power * number ** (power - 1)
        for variable, own in derivatives.items():
            slopes[variable] = slopes.get(variable, 0.0) + slope * own
    return library.AffineScalarFunc(value, library.LinearCombination(slopes))


def _root(covariance: list[list[float]]) -> list[list[float]]:
    """Lower triangle L, row by row, with L L^T the covariance (p, p); a parameter that others determine adds nothing.

    Cholesky's, whose error is the rounding of each parameter's own variance, whatever units the parameters have.
    """
    root: list[list[float]] = []
    for i, row in enumerate(covariance):
        mine: list[float] = []
        for j, other in enumerate(root):
            rest = row[j] - sum(a * b for a, b in zip(mine, other, strict=False))
            mine.append(rest / other[j] if other[j] > 0.0 else 0.0)
        mine.append(math.sqrt(max(row[i] - sum(a * a for a in mine), 0.0)))
        root.append(mine)
    return root


@cache
def _library() -> Any:
    """The package's core, imported when it is first needed."""
    from uncertainties import core

    return core


@cache
def _variable() -> Any:
    """The package's variable with the hash of any object: its own, the same in effect, is the dearest part of a sum."""
    return type("Variable", (_library().Variable,), {"__slots__": (), "__hash__": object.__hash__})
