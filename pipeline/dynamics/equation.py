"""The equation of motion, as a scene requires it, and the start: what every integrator solves.

.. math:: \\ddot y = -\\omega_0^2 y - 2\\gamma\\dot y - b|\\dot y|\\dot y - f\\,\\mathrm{sign}(\\dot y) - c y^3

Friction holds a bob that rests where the spring pulls with less than f.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.bench.added_mass import added_mass_kg
from pipeline.bench.scene import Scene
from pipeline.errors import DynamicsError, SceneError
from pipeline.numerics.estimate import Estimate
from pipeline.track import F8

__all__ = ["Equation", "Problem", "Real", "effective_mass_kg"]

Real = Any
"""A float, or an ensemble's (m,) float64: an integrator's step is written once for both."""

_AMPLITUDE_TO_DRAG = 3.0 * math.pi / 4.0  # b = (3 pi / 4) beta / omega, from energy lost per cycle
_LARGEST, _SMALLEST = 1e100, 1e-100
_MOST_FRICTION = 1e300


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
            object.__setattr__(self, name, _double(getattr(self, name), name))
        omega = self.angular_frequency_per_s
        if not np.all((omega > _SMALLEST) & (omega < _LARGEST)):
            raise DynamicsError(
                f"angular_frequency_per_s must be between {_SMALLEST:g} and {_LARGEST:g}, got {_shown(omega)}"
            )
        for name in ("gamma_per_s", "drag_per_m", "friction_m_per_s2"):
            if np.any(getattr(self, name) < 0):
                raise DynamicsError(f"{name} must be 0 or more, got {_shown(getattr(self, name))}")

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


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """An equation of motion and a start, for one trajectory or for an ensemble.

    Parameters
    ----------
    equation : Equation
    displacement_m : float or (m,) float64, m
        At t = 0.
    velocity_m_per_s : float or (m,) float64, m/s

    Raises
    ------
    DynamicsError
        For a start that is not finite or not of double precision, shapes that do not fit, or a softening spring
        that is stretched beyond the point where it would pull back.

    Examples
    --------
    >>> Problem(Equation(angular_frequency_per_s=8.66), 0.05).size
    1
    >>> Problem(Equation(angular_frequency_per_s=np.array([8.0, 9.0])), 0.05).size
    2
    """

    equation: Equation
    displacement_m: Real
    velocity_m_per_s: Real = 0.0

    def __post_init__(self) -> None:
        for name in ("displacement_m", "velocity_m_per_s"):
            object.__setattr__(self, name, _double(getattr(self, name), name))
        values = [getattr(self.equation, n) for n in self.equation.__slots__]
        values += [self.displacement_m, self.velocity_m_per_s]
        try:
            shape = np.broadcast_shapes(*(np.shape(value) for value in values))
        except ValueError:
            shapes = ", ".join(str(np.shape(value)) for value in values)
            raise DynamicsError(f"the members of an ensemble must be of one number, got shapes {shapes}") from None
        if len(shape) > 1:
            raise DynamicsError(f"an ensemble has one dimension, got shape {shape}")
        if shape:
            spread = {n: _broadcast(getattr(self.equation, n), shape) for n in self.equation.__slots__}
            object.__setattr__(self, "equation", replace(self.equation, **spread))
            object.__setattr__(self, "displacement_m", _broadcast(self.displacement_m, shape))
            object.__setattr__(self, "velocity_m_per_s", _broadcast(self.velocity_m_per_s, shape))
        self._demand_amplitude()
        self._demand_bound()

    @property
    def is_ensemble(self) -> bool:
        """Whether there is more than a single trajectory, or an array of one."""
        return np.ndim(self.displacement_m) == 1

    @property
    def size(self) -> int:
        """Number of trajectories."""
        return int(np.size(self.displacement_m))

    def members(self) -> list[Problem]:
        """Return each trajectory's own problem."""
        if not self.is_ensemble:
            return [self]
        names = self.equation.__slots__
        return [
            Problem(
                Equation(**{n: float(getattr(self.equation, n)[i]) for n in names}),
                float(self.displacement_m[i]),
                float(self.velocity_m_per_s[i]),
            )
            for i in range(self.size)
        ]

    def amplitude_m(self) -> Real:
        """Return the amplitude with which an undamped oscillation would start, m."""
        start = np.hypot(self.displacement_m, self.velocity_m_per_s / self.equation.angular_frequency_per_s)
        return start if self.is_ensemble else float(start)

    def scaled(self) -> tuple[Problem, Real]:
        """Return the same motion in units of a length near its amplitude, and that length, m.

        The length is a power of two, so that nothing is rounded; squares then neither overflow nor vanish.
        """
        eq = self.equation
        if self.is_ensemble:
            size = np.maximum(np.abs(self.displacement_m), np.abs(self.velocity_m_per_s / eq.angular_frequency_per_s))
            unit = np.ldexp(1.0, np.clip(np.frexp(size)[1], -1021, 1022))
        else:  # asked often, so without numpy
            size = max(abs(self.displacement_m), abs(self.velocity_m_per_s / eq.angular_frequency_per_s))
            unit = math.ldexp(1.0, min(max(math.frexp(size)[1], -1021), 1022))
            if unit == 1.0 and eq.friction_m_per_s2 <= _MOST_FRICTION:
                return self, unit
        if eq.is_linear:
            return self._replaced(eq, unit), unit
        with np.errstate(over="ignore"):
            drag = np.multiply(eq.drag_per_m, unit)
            # Friction beyond all bounds holds whatever it touches, and a bound that large does too.
            friction = np.minimum(np.divide(eq.friction_m_per_s2, unit), _MOST_FRICTION)
            cubic = np.multiply(np.multiply(eq.cubic_per_m2_s2, unit), unit)
        for name, part in (("drag_per_m", drag), ("cubic_per_m2_s2", cubic)):
            if not np.all(np.isfinite(part)):
                raise DynamicsError(
                    f"{name} {_shown(getattr(eq, name))} at an amplitude of {_shown(size)} m leaves the range of "
                    "numbers; take a smaller amplitude or coefficient"
                )
        parts = {"drag_per_m": drag, "friction_m_per_s2": friction, "cubic_per_m2_s2": cubic}
        if not self.is_ensemble:
            parts = {name: float(part) for name, part in parts.items()}
        return self._replaced(replace(eq, **parts), unit), unit

    def _replaced(self, equation: Equation, unit: Real) -> Problem:
        """The same with another equation and unit of length; it was checked before."""
        other = object.__new__(Problem)
        object.__setattr__(other, "equation", equation)
        object.__setattr__(other, "displacement_m", self.displacement_m / unit)
        object.__setattr__(other, "velocity_m_per_s", self.velocity_m_per_s / unit)
        return other

    @classmethod
    def from_scene(cls, scene: Scene, *, where: str = "scene") -> Problem:
        """Return the problem that a scene states.

        Parameters
        ----------
        scene : Scene
            Bob mass, spring constant and starting displacement are needed; what else is left out is zero.
        where : str
            Named in errors.

        Raises
        ------
        SceneError
            If something needed is left out; the message names it.

        Notes
        -----
        :math:`\\omega_0^2 = k/(m + m_s/3 + m_a)` with the spring's mass and the air that the disc carries along. The
        coefficients of ``[damping]`` are those of the amplitude; see :meth:`Equation.from_laws`.

        Examples
        --------
        >>> scene = Scene.from_mapping({"bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0},
        ...                             "start": {"displacement_m": 0.05}})
        >>> Problem.from_scene(scene).equation.angular_frequency_per_s
        10.0
        """
        needed = {
            "[bob] mass_kg": scene.bob_mass_kg,
            "[spring] constant_n_per_m": scene.spring_constant_n_per_m,
            "[start] displacement_m": scene.start_displacement_m,
        }
        missing = [name for name, value in needed.items() if value is None]
        if missing:
            raise SceneError(f"{where}: a simulation needs {', '.join(missing)}; add it to the scene")
        mass = effective_mass_kg(scene)
        try:
            equation = Equation.from_laws(
                math.sqrt(_value(scene.spring_constant_n_per_m) / mass),
                gamma_per_s=_value(scene.gamma_per_s),
                beta_per_m_s=_value(scene.beta_per_m_s),
                mu_m_per_s=_value(scene.mu_m_per_s),
                cubic_per_m2_s2=_value(scene.spring_cubic_n_per_m3) / mass,
            )
            return cls(equation, _value(scene.start_displacement_m), _value(scene.start_velocity_m_per_s))
        except DynamicsError as error:
            raise DynamicsError(f"{where}: {error}") from error

    def _demand_amplitude(self) -> None:
        """A start of finite displacement and velocity still has no amplitude where the frequency is next to none."""
        omega = self.equation.angular_frequency_per_s
        with np.errstate(over="ignore"):
            amplitude = np.hypot(self.displacement_m, np.divide(self.velocity_m_per_s, omega))
        if not np.all(np.isfinite(amplitude)):
            raise DynamicsError(
                f"velocity_m_per_s over angular_frequency_per_s must be a length that a number holds, got "
                f"{_shown(self.velocity_m_per_s)} over {_shown(omega)}"
            )

    def _demand_bound(self) -> None:
        """A softening spring pulls back only up to omega / sqrt(-c), and only below the energy at that point."""
        eq = self.equation
        if not np.any(eq.cubic_per_m2_s2 < 0):
            return
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            reach = eq.angular_frequency_per_s / np.sqrt(np.maximum(-eq.cubic_per_m2_s2, 0.0))
            y = np.abs(self.displacement_m) / reach
            v = np.abs(self.velocity_m_per_s) / (eq.angular_frequency_per_s * reach)
            loose = (eq.cubic_per_m2_s2 < 0) & ~((y < 1.0) & (v * v + y * y * (1.0 - 0.5 * y * y) < 0.5))
        if np.any(loose):
            raise DynamicsError(
                f"a softening spring holds its bob within {_shown(np.asarray(reach)[loose].flat[0])} m of rest, the "
                f"start at {_shown(np.asarray(self.displacement_m)[loose].flat[0])} m is too far or too fast; "
                "start nearer, or take a smaller cubic term"
            )


def effective_mass_kg(scene: Scene) -> float:
    """Return bob, a third of the spring, and the air that the disc carries along, kg.

    Raises
    ------
    SceneError
        If the scene gives no bob mass.
    """
    if scene.bob_mass_kg is None:
        raise SceneError("scene: a mass that oscillates needs [bob] mass_kg; add it to the scene")
    return scene.bob_mass_kg.value + _value(scene.spring_mass_kg) / 3.0 + added_mass_kg(scene)


def _any(value: Real) -> bool:
    return value != 0.0 if type(value) is float else bool(np.any(value))


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None else estimate.value


def _double(given: Any, name: str) -> Real:
    """A float or a float64 array of finite numbers; narrower floats are refused, as their rounding shows."""
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
        raise DynamicsError(f"{name} must be finite, got {_shown(array)}")
    return array if array.ndim else float(array)


def _broadcast(value: Real, shape: tuple[int, ...]) -> F8:
    return np.array(np.broadcast_to(value, shape), np.float64)


def _shown(value: Real) -> str:
    return f"{value:g}" if np.ndim(value) == 0 else np.array2string(np.asarray(value), threshold=4)
