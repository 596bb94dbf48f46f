"""The interface of every damping law, and functions that use the units of its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np

from pipeline.track import F8
from pipeline.units import Unit


@runtime_checkable
class Law(Protocol):
    """A damping law; ``theta`` lists its parameters in the order of ``parameters``."""

    @property
    def name(self) -> str:
        """Short name, the key in ``LAWS``."""
        ...

    @property
    def parameters(self) -> Mapping[str, Unit]:
        """The names and units of the parameters: first "A0", the amplitude at t = 0 in m, then the coefficients."""
        ...

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of the laws that are special cases of this one: its best fit is never worse than theirs."""
        ...

    def curve(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return the amplitude (n,) in m at times t (n,) in s, and its derivatives (n, p) by the parameters."""
        ...

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return dA/dt (n,) in m/s at amplitudes (n,) in m; it does not depend on A0."""
        ...

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return start values (p,) for a fit to one or more points in the order of time."""
        ...


def units_of(law: Law, unit: str = "m") -> tuple[str, ...]:
    """Return the units of a law's parameters as they are printed for a recording in a unit."""
    return tuple(each.of(unit) for each in law.parameters.values())


def words_of(law: Law) -> str:
    """Return the name of a law in a sentence: its ``words`` if it has any, or its short name."""
    return str(getattr(law, "words", law.name))


def free_power(law: Law) -> str | None:
    """Return the name of a law's free power of the amplitude, on which another unit depends; None if it has none."""
    return next((unit.less for unit in law.parameters.values() if unit.less), None)


def in_units(law: Law, theta: F8, *, length_m: float = 1.0, time_s: float = 1.0) -> F8:
    """Return the parameters (p,) of the same decay with other units of length and time than m and s.

    A parameter of unit :math:`\\mathrm{m}^a\\mathrm{s}^b` is divided by :math:`L^a T^b`.
    """
    values = dict(zip(law.parameters, theta.tolist(), strict=True))
    metres = np.array([unit.metre - (values[unit.less] if unit.less else 0.0) for unit in law.parameters.values()])
    seconds = np.array([unit.second for unit in law.parameters.values()])
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(theta * length_m**-metres * time_s**-seconds)
