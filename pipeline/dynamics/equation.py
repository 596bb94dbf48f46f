"""The equation of motion that every integrator solves.

.. math:: \\ddot y = -\\omega_0^2 y - 2\\gamma\\dot y - b|\\dot y|\\dot y - f\\,\\mathrm{sign}(\\dot y) - c y^3

Friction holds a bob that rests where the spring pulls with less than f.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import DynamicsError

__all__ = ["Equation", "Real", "double", "shown"]

Real = Any
"""A float, or an array of such, one for each member of an ensemble or for each of several steps."""

_AMPLITUDE_TO_DRAG = 3.0 * math.pi / 4.0  # b = (3 pi / 4) beta / omega, from energy lost per cycle
_LARGEST, _SMALLEST = 1e100, 1e-100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Equation:
    """The coefficients, one each or one per member of an ensemble.

    Parameters
    ----------
    angular_frequency_per_s : float or (m,) float64, 1/s
        Of the undamped, infinitely small motion; positive.
    gamma_per_s : float or (m,) float64, 1/s
        Half the viscous force per mass and speed; 0 or more.
    drag_per_m : float or (m,) float64, 1/m
        The quadratic force per mass and squared speed; 0 or more.
    friction_m_per_s2 : float or (m,) float64, m/s^2
        The friction force per mass; 0 or more.
    cubic_per_m2_s2 : float or (m,) float64, 1/(m^2 s^2)
        The spring's hardening (positive) or softening (negative).
    """

    angular_frequency_per_s: Real
    gamma_per_s: Real = 0.0
    drag_per_m: Real = 0.0
    friction_m_per_s2: Real = 0.0
    cubic_per_m2_s2: Real = 0.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            object.__setattr__(self, name, double(getattr(self, name), name))
        omega = self.angular_frequency_per_s
        if not np.all((omega > _SMALLEST) & (omega < _LARGEST)):
            raise DynamicsError(
                f"angular_frequency_per_s must be between {_SMALLEST:g} and {_LARGEST:g}, got {shown(omega)}"
            )
        for name in ("gamma_per_s", "drag_per_m", "friction_m_per_s2"):
            if np.any(getattr(self, name) < 0):
                raise DynamicsError(f"{name} must be 0 or more, got {shown(getattr(self, name))}")

    @property
    def is_linear(self) -> bool:
        """Whether spring and viscous drag are all there is, for every member."""
        return not any(map(_any, (self.drag_per_m, self.friction_m_per_s2, self.cubic_per_m2_s2)))

    @property
    def has_friction(self) -> bool:
        """Whether any member has friction."""
        return _any(self.friction_m_per_s2)

    def spring(self, y: Real) -> Real:
        """Return the spring's pull per mass at displacement y, m/s^2, positive towards positive y."""
        pull = self.angular_frequency_per_s**2 * y
        return pull + self.cubic_per_m2_s2 * y * y * y if _any(self.cubic_per_m2_s2) else pull

    def direction(self, y: float, v: float) -> int:
        """Return which way a single bob moves, or would from rest: 1, -1, or 0 where friction holds it."""
        if v:
            return 1 if v > 0 else -1
        pull = self.spring(y)
        return 0 if abs(pull) <= self.friction_m_per_s2 else -1 if pull > 0 else 1

    def laws(self) -> tuple[Real, Real, Real]:
        """Return gamma (1/s), beta (1/(m s)) and mu (m/s) of the averaged dA/dt = -(mu + gamma A + beta A^2).

        One that is too large for a number is inf.
        """
        omega = self.angular_frequency_per_s
        with np.errstate(over="ignore"):
            return (
                self.gamma_per_s,
                self.drag_per_m * omega / _AMPLITUDE_TO_DRAG,
                2.0 * self.friction_m_per_s2 / (math.pi * omega),
            )

    @classmethod
    def from_laws(
        cls,
        angular_frequency_per_s: Real,
        *,
        gamma_per_s: Real = 0.0,
        beta_per_m_s: Real = 0.0,
        mu_m_per_s: Real = 0.0,
        cubic_per_m2_s2: Real = 0.0,
    ) -> Equation:
        """Return the equation whose average is dA/dt = -(mu + gamma A + beta A^2).

        Notes
        -----
        A force F per mass takes :math:`\\oint F\\,dy` from the energy :math:`\\omega^2A^2/2` in a cycle. For
        :math:`2\\gamma\\dot y`, :math:`b\\dot y^2` and :math:`f` that makes
        :math:`\\dot A = -(2f/\\pi\\omega + \\gamma A + (4\\omega/3\\pi)\\,b A^2)` [1]_.

        References
        ----------
        .. [1] K. Lelas, R. Pezer, arXiv:2502.07458.

        Examples
        --------
        >>> round(Equation.from_laws(8.66, beta_per_m_s=0.235).laws()[1], 12)
        0.235
        """
        return cls(
            angular_frequency_per_s=angular_frequency_per_s,
            gamma_per_s=gamma_per_s,
            drag_per_m=_AMPLITUDE_TO_DRAG * beta_per_m_s / angular_frequency_per_s,
            friction_m_per_s2=0.5 * math.pi * angular_frequency_per_s * mu_m_per_s,
            cubic_per_m2_s2=cubic_per_m2_s2,
        )


def _any(value: Real) -> bool:
    return value != 0.0 if type(value) is float else bool(np.any(value))


def double(given: Any, name: str) -> Real:
    """Return a float or a float64 array of finite numbers; narrower floats are refused, as their rounding shows.

    Raises
    ------
    DynamicsError
        For what is no number, not finite, or of less than double precision; the message begins with ``name``.
    """
    if type(given) is float and math.isfinite(given):
        return given
    array = np.asarray(given)
    if array.dtype.kind == "f" and array.dtype.itemsize < 8:
        raise DynamicsError(
            f"{name} must be of double precision, got {array.dtype}: over 1e7 steps its rounding takes 40 % of the "
            "energy; convert to float64"
        )
    if array.dtype.kind not in "fiu" or array.dtype.itemsize > 8:
        raise DynamicsError(f"{name} must be a number of double precision or an array of such, got {given!r:.80}")
    array = array.astype(np.float64)
    if not np.all(np.isfinite(array)):
        raise DynamicsError(f"{name} must be finite, got {shown(array)}")
    return array if array.ndim else float(array)


def shown(value: Real) -> str:
    """Return a number, or the first and last of many, as an error prints them."""
    return f"{value:g}" if np.ndim(value) == 0 else np.array2string(np.asarray(value), threshold=4)
