"""An equation of motion with a start, and what a scene makes of both."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.bench.added_mass import added_mass_kg
from pipeline.bench.scene import Scene
from pipeline.dynamics.equation import Equation, Real, double, shown
from pipeline.errors import DynamicsError, SceneError
from pipeline.numerics.estimate import Estimate

__all__ = ["Problem", "effective_mass_kg"]

_MOST_FRICTION = 1e300


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
            object.__setattr__(self, name, double(getattr(self, name), name))
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
            names = self.equation.__slots__
            *spread, y, v = (np.array(np.broadcast_to(value, shape)) for value in values)
            object.__setattr__(self, "equation", replace(self.equation, **dict(zip(names, spread, strict=True))))
            object.__setattr__(self, "displacement_m", y)
            object.__setattr__(self, "velocity_m_per_s", v)
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
        with np.errstate(over="ignore"):
            size = np.maximum(np.abs(self.displacement_m), np.abs(self.velocity_m_per_s / eq.angular_frequency_per_s))
            unit = np.ldexp(1.0, np.clip(np.frexp(size)[1], -1021, 1022))
            parts = {
                "drag_per_m": np.multiply(eq.drag_per_m, unit),
                # Friction beyond all bounds holds whatever it touches, and a bound that large does too.
                "friction_m_per_s2": np.minimum(np.divide(eq.friction_m_per_s2, unit), _MOST_FRICTION),
                "cubic_per_m2_s2": np.multiply(np.multiply(eq.cubic_per_m2_s2, unit), unit),
            }
        for name, part in parts.items():
            if not np.all(np.isfinite(part)):
                raise DynamicsError(
                    f"{name} {shown(getattr(eq, name))} at an amplitude of {shown(size)} m leaves the range of "
                    "numbers; take a smaller amplitude or coefficient"
                )
        return Problem(replace(eq, **parts), self.displacement_m / unit, self.velocity_m_per_s / unit), unit

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
                f"{shown(self.velocity_m_per_s)} over {shown(omega)}"
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
                f"a softening spring holds its bob within {shown(np.asarray(reach)[loose].flat[0])} m of rest, the "
                f"start at {shown(np.asarray(self.displacement_m)[loose].flat[0])} m is too far or too fast; "
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


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None else estimate.value
