"""A law made of a function of one's own, without a class.

Kept by hand: nothing else asks of a function whether it can be a law of damping, and in which units.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from pipeline.errors import AnalysisError
from pipeline.numerics.least_squares import central_differences
from pipeline.registry.quantities import QUANTITIES
from pipeline.track import F8

__all__ = ["FunctionLaw", "make_law"]

COEFFICIENTS = frozenset({"gamma", "beta", "mu", "c", "n"})
"""Names of estimates that are coefficients of the laws that ship, and may be those of another law too."""
STEP_S = 1e-3  # over which the rate is a difference: its error is a third of the squared change of the amplitude
AGREE = 1e-5  # relative; to which a law must hold what is asked of it
PROBE_S = np.linspace(0.0, 10.0, 21)


def make_law(
    name: str,
    amplitude: Callable[..., ArrayLike],
    parameters: Mapping[str, str],
    guess: Callable[[F8, F8], ArrayLike],
    *,
    words: str = "",
    cases: tuple[str, ...] = ("none",),
) -> FunctionLaw:
    """Make a damping law of a function, to be tried beside the others.

    Parameters
    ----------
    name : str
        Short, none of those in :data:`pipeline.damping.laws.LAWS`.
    amplitude : callable
        ``amplitude(t, A0, *coefficients)`` gives the amplitude (n,) at times t (n,), s, that was A0 at t = 0. It must
        take any unit of length, and be a function of the amplitude alone: wherever it has got to, it goes on as if
        it had started there.
    parameters : mapping of str to str
        Coefficients with their units of m and s, such as ``{"d": "1/(m^1/2 s)"}``.
    guess : callable
        ``guess(t, amplitude)`` gives start values of A0 and the coefficients from points.
    words : str
        What findings call it; left out, its name.
    cases : tuple of str
        Names of the laws that it becomes for some value of its coefficients.

    Raises
    ------
    AnalysisError
        If the function is no law of damping, does not have the units stated, or has a coefficient with the name of an
        estimate.

    Examples
    --------
    Drag between linear and quadratic, :math:`dA/dt = -d A^{3/2}`:

    >>> def amplitude(t, A0, d):
    ...     return A0 / (1 + d * np.sqrt(A0) * t / 2) ** 2
    >>> def guess(t, amplitude):
    ...     slope, level = np.polyfit(t, 1 / np.sqrt(amplitude), 1)
    ...     return level**-2, 2 * slope
    >>> law = make_law("three-halves", amplitude, {"d": "1/(m^1/2 s)"}, guess)
    >>> print(law.rate(np.array([0.04]), np.array([0.05, 0.5])))
    [0.004]
    """
    if taken := [each for each in parameters if each in QUANTITIES and each not in COEFFICIENTS]:
        raise AnalysisError(f"law {name!r}: coefficient {taken[0]!r} has the name of an estimate; give it another name")
    dimensions = {each: _dimensions(each, unit) for each, unit in parameters.items()}
    law = FunctionLaw(
        name,
        words or name,
        ("A0", *parameters),
        ("m", *parameters.values()),
        cases,
        amplitude,
        guess,
        dimensions,
    )
    _demand_law(law)
    return law


@dataclass(frozen=True, slots=True, eq=False)
class FunctionLaw:
    """A law of damping by its amplitude alone; :func:`make_law` makes one.

    Parameters
    ----------
    name, words, parameters, units, cases
        As in :class:`pipeline.damping.laws.law.Law`.
    function, start : callable
        As ``amplitude`` and ``guess`` of :func:`make_law`.
    dimensions : mapping of str to (float, float)
        Powers of length and of one over time in each coefficient's unit.
    """

    name: str
    words: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    cases: tuple[str, ...]
    function: Callable[..., ArrayLike] = field(repr=False)
    start: Callable[[F8, F8], ArrayLike] = field(repr=False)
    dimensions: Mapping[str, tuple[float, float]] = field(repr=False)

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return what the function gives."""
        with np.errstate(all="ignore"):  # a fit may step where it has no value
            return np.broadcast_to(np.asarray(self.function(t, *theta.tolist()), np.float64), np.shape(t)).copy()

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return central differences."""
        return central_differences(lambda at: self.amplitude(t, at), theta)

    def both(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return amplitude and jacobian."""
        return self.amplitude(t, theta), self.jacobian(t, theta)

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return the slope at t = 0 of a fall that starts at each amplitude: one-sided, of second order."""
        t = STEP_S * np.arange(3.0)
        each = [self.amplitude(t, np.append(start, theta[1:])) @ (3.0, -4.0, 1.0) for start in amplitude.tolist()]
        return np.array(each) / (2.0 * STEP_S)

    def rate_jacobian(self, amplitude: F8, theta: F8) -> F8:
        """Return central differences."""
        return central_differences(lambda at: self.rate(amplitude, at), theta)

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return what ``start`` gives.

        Raises
        ------
        AnalysisError
            If that is not a finite number for each parameter.
        """
        with np.errstate(all="ignore"):
            found = np.array(self.start(t, amplitude), np.float64)
        if found.shape != (len(self.parameters),) or not np.isfinite(found).all():
            demand = f"guess must give finite numbers for {', '.join(self.parameters)}"
            raise AnalysisError(f"law {self.name!r}: {demand}, got {found.tolist()}")
        return found

    def rescaled(self, theta: F8, length_m: float) -> F8:
        """Return the parameters with lengths in units of ``length_m``."""
        return self.in_units(theta, length_m=length_m)

    def in_units(self, theta: F8, *, length_m: float = 1.0, time_s: float = 1.0) -> F8:
        """Return the parameters with lengths and times in other units than m and s."""
        powers = np.array([(1.0, 0.0), *(self.dimensions[name] for name in self.parameters[1:])])
        return np.asarray(theta * length_m ** -powers[:, 0] * time_s ** powers[:, 1])


def _dimensions(name: str, unit: str) -> tuple[float, float]:
    """Return the powers of length and of one over time in a unit such as 1/(m^1/2 s)."""
    length, per_time = 0.0, 0.0
    above, _, below = re.sub(r"/(?=[a-z(])", "|", unit.strip()).partition("|")
    for part, sign in ((above, 1.0), (below, -1.0)):
        for symbol in part.strip("() ").split():
            found = re.fullmatch(r"(m|s|1)(?:\^(-?[\d.]+)(?:/(\d+))?)?", symbol)
            if found is None:
                demand = 'its unit must be made of m and s, as in "1/(m^1/2 s)"'
                raise AnalysisError(f"coefficient {name!r}: {demand}, got {unit!r}")
            power = sign * float(found[2] or 1.0) / float(found[3] or 1.0)
            length += power if found[1] == "m" else 0.0
            per_time -= power if found[1] == "s" else 0.0
    return length, per_time


def _demand_law(law: FunctionLaw) -> None:
    """Try the function on a typical fall: what it must do whatever its coefficients are."""
    theta = law.guess(PROBE_S, 0.05 * np.exp(-0.05 * PROBE_S))
    fall = law.amplitude(PROBE_S, theta)
    if not (np.isfinite(fall).all() and np.ptp(fall) > 0.0):
        values = ", ".join(f"{name} = {value:g}" for name, value in zip(law.parameters, theta, strict=True))
        demand = f"an amplitude that changes within {PROBE_S[-1]:g} s was demanded of {values}"
        raise AnalysisError(f"law {law.name!r}: {demand}, got {fall[0]:g} to {fall[-1]:g} m; check function and guess")
    half = PROBE_S.size // 2
    onwards = law.amplitude(PROBE_S[: half + 1], np.append(fall[half], theta[1:]))
    alike = {
        "A0 must be its amplitude at t = 0": (fall[:1], theta[:1]),
        "it must depend on the amplitude alone, and go on from any as if it had started there": (fall[half:], onwards),
        "its units of length do not fit the function": (
            fall,
            10.0 * law.amplitude(PROBE_S, law.in_units(theta, length_m=10.0)),
        ),
        "its units of time do not fit the function": (
            fall,
            law.amplitude(PROBE_S / 10.0, law.in_units(theta, time_s=10.0)),
        ),
    }
    for words, (one, other) in alike.items():
        if not np.allclose(one, other, rtol=AGREE, atol=0.0):
            stated = ", ".join(f"{name} in {unit}" for name, unit in zip(law.parameters, law.units, strict=True))
            raise AnalysisError(f"law {law.name!r} is no law of damping with {stated}: {words}")
