"""Damping laws from user-defined functions, without a class.

This is written by hand because no library tests whether a function can be a damping law, and in which units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from pipeline.damping.laws.drag import DRAGS
from pipeline.damping.laws.law import Law
from pipeline.damping.laws.power import Power
from pipeline.errors import AnalysisError
from pipeline.numerics.least_squares import central_differences
from pipeline.quantities import QUANTITIES
from pipeline.track import F8
from pipeline.units import Unit

# Step of the difference for the rate, s; the error by Taylor's theorem is that of Press et al. (2007), section 5.7.
STEP_S = 1e-3


def make_law(
    name: str,
    amplitude: Callable[..., ArrayLike],
    parameters: Mapping[str, tuple[float, float]],
    guess: Callable[[F8, F8], ArrayLike],
    *,
    words: str = "",
    cases: tuple[str, ...] = ("none",),
) -> FunctionLaw:
    """Make a damping law from a function, to be tried with the other laws.

    Parameters
    ----------
    name : str
        Short name that is not in :data:`springmass.LAWS`.
    amplitude : callable
        ``amplitude(t, A0, *coefficients)`` returns the amplitudes (n,) at times t (n,) in s, for the amplitude A0 at
        t = 0. It must work in any unit of length. Its rate must depend only on the amplitude: from any later
        amplitude, the motion must continue as if it had started there.
    parameters : mapping of str to (float, float)
        Coefficients with the exponents of metre and second in their units: ``{"d": (-1 / 2, -1)}`` for
        :math:`1/(\\mathrm{m}^{1/2}\\,\\mathrm{s})`.
    guess : callable
        ``guess(t, amplitude)`` returns start values of A0 and the coefficients for a fit to points.
    words : str
        The name of the law in findings; by default its short name.
    cases : tuple of str
        Names of the laws that are special cases of this law, for some values of its coefficients.

    Raises
    ------
    AnalysisError
        If a unit is no pair of exponents, or if a coefficient has the name of an estimate.

    Examples
    --------
    Drag between linear and quadratic, :math:`dA/dt = -d A^{3/2}`:

    >>> def amplitude(t, A0, d):
    ...     return A0 / (1 + d * np.sqrt(A0) * t / 2) ** 2
    >>> def guess(t, amplitude):
    ...     slope, level = np.polyfit(t, 1 / np.sqrt(amplitude), 1)
    ...     return level**-2, 2 * slope
    >>> law = make_law("three-halves", amplitude, {"d": (-1 / 2, -1)}, guess)
    >>> print(law.parameters["d"], law.rate(np.array([0.04]), np.array([0.05, 0.5])))
    1/(m^1/2 s) [-0.004]
    """
    laws: tuple[Law, ...] = (*DRAGS, Power())
    ours = {coefficient for law in laws for coefficient in law.parameters}
    if taken := [each for each in parameters if each in QUANTITIES and each not in ours]:
        raise AnalysisError(
            f"law {name!r}: coefficient {taken[0]!r} has the name of an estimate", "give it another name"
        )
    units = {"A0": Unit(1)}
    for each, exponents in parameters.items():
        if not (isinstance(exponents, tuple) and len(exponents) == 2 and all(isinstance(e, Real) for e in exponents)):
            expected = "its unit must be a pair, the exponents of metre and second, as in (-1/2, -1)"
            raise AnalysisError(f"law {name!r}: coefficient {each!r}: {expected}, got {exponents!r}")
        units[each] = Unit(*exponents)
    return FunctionLaw(name, words or name, units, cases, amplitude, guess)


@dataclass(frozen=True, slots=True, eq=False)
class FunctionLaw:
    """A damping law from a user-defined function; :func:`make_law` makes one."""

    # name, parameters, cases: as in :class:`pipeline.damping.laws.law.Law`.
    name: str
    words: str  # the name of the law in findings
    parameters: Mapping[str, Unit]
    cases: tuple[str, ...]
    # function, start: the parameters ``amplitude`` and ``guess`` of :func:`make_law`.
    function: Callable[..., ArrayLike] = field(repr=False)
    start: Callable[[F8, F8], ArrayLike] = field(repr=False)

    def curve(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return the values of the function and their derivatives by central differences."""
        return self._amplitude(t, theta), central_differences(lambda at: self._amplitude(t, at), theta)

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return the slope at t = 0 of a decay from each amplitude, by a one-sided difference of second order."""
        t = STEP_S * np.arange(3.0)
        each = [self._amplitude(t, np.append(start, theta[1:])) @ (-3.0, 4.0, -1.0) for start in amplitude.tolist()]
        return np.array(each) / (2.0 * STEP_S)

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return the start values (p,) that ``start`` gives for points."""
        with np.errstate(all="ignore"):
            found = np.array(self.start(t, amplitude), np.float64)
        if found.shape != (len(self.parameters),) or not np.isfinite(found).all():
            demand = f"guess must give finite numbers for {', '.join(self.parameters)}"
            raise AnalysisError(f"law {self.name!r}: {demand}, got {found.tolist()}")
        return found

    def _amplitude(self, t: F8, theta: F8) -> F8:
        with np.errstate(all="ignore"):  # a fit may try parameters for which the function has no value
            return np.broadcast_to(np.asarray(self.function(t, *theta.tolist()), np.float64), np.shape(t)).copy()
