"""The uncertainty band around the motion of a scene: quantiles of an ensemble drawn from the scene's uncertainties.

If amplitude and phase change in proportion to each input, the members follow from linear propagation. Otherwise, for
example if friction stops each bob at a different place, every member is solved.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.dynamics.problem import Problem, effective_mass_kg
from pipeline.dynamics.sensitivity import STRETCH, Sensitivity, sensitivity, solved
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.track import F8

__all__ = ["LEVELS", "Band", "draw", "spread", "uncertain"]

LEVELS = ("low_95", "low_68", "high_68", "high_95")
SHARES = (0.025, 0.158655, 0.841345, 0.975)  # share of the members below each level
MEMBERS = 800  # default ensemble size; the share beyond an edge of the 95 % band then scatters by half a percent
RADIANS = 0.2  # step of Strang splitting in rad; its error is common to all members and cancels in differences
MOST_STEPS = 50_000  # maximum number of steps of a band
MEMBERS_MOVED = 2500  # minimum ensemble size with linear propagation, which costs less
REACH = 4.0  # minimum ratio of a nonnegative quantity to its uncertainty for linear propagation
TURNS_COST = 5  # ratio of the times of a step with friction, which locates turning points, and without
SIGNED = ("start_displacement_m", "start_velocity_m_per_s", "spring_cubic_n_per_m3", "air_temperature_c")
POSITIVE = ("bob_mass_kg", "spring_constant_n_per_m")


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Quantiles of an ensemble, relative to the motion for the scene's values.

    Parameters
    ----------
    quantities : tuple of str
        The scene's attributes that are uncertain.
    members, seed : int
        Number of members and random seed of the ensemble.
    t : (n,) float64, s
    amplitude : (n,) float64, m
        :math:`\\sqrt{y^2 + (v/\\omega_0)^2}` for the scene's values.
    of_displacement, of_amplitude, of_phase : (4, n) float64, m, m and rad
        The quantiles at :data:`LEVELS` minus the result for the scene's values.
    sensitivity : Sensitivity
        Contribution of each quantity.
    linear : bool
        Whether the members follow from these sensitivities; otherwise each member was solved.
    """

    quantities: tuple[str, ...]
    members: int
    seed: int
    t: F8
    amplitude: F8
    of_displacement: F8
    of_amplitude: F8
    of_phase: F8
    sensitivity: Sensitivity
    linear: bool

    @property
    def relative_u(self) -> float:
        """Maximum half width of the displacement's 68 % band, relative to the starting amplitude; 0 if that is 0."""
        half = 0.5 * float(np.max(self.of_displacement[2] - self.of_displacement[1]))
        return half / float(self.amplitude[0]) if self.amplitude[0] > 0.0 else 0.0

    @property
    def words(self) -> str:
        """Description of the method and of the uncertain quantities."""
        how = "by linear propagation of" if self.linear else f"{self.members} motions drawn from"
        return f"{how} the uncertainties of {', '.join(self.quantities)}"

    def displacement_at(self, t: F8) -> F8:
        """Return quantiles (4, k) in m of the displacement minus that for the scene's values, at times t (k,) in s."""
        return self._between(self.of_displacement, t)

    def amplitude_at(self, t: F8) -> tuple[F8, F8]:
        """Return the amplitude for the scene's values (k,) and its quantiles (4, k) in m, at times t (k,) in s."""
        middle = self._between(self.amplitude, t)
        return middle, middle + self._between(self.of_amplitude, t)

    def phase_at(self, t: F8) -> F8:
        """Return quantiles (4, k) in rad of the phase minus that for the scene's values, at times t (k,) in s."""
        return self._between(self.of_phase, t)

    def _between(self, curves: F8, t: F8) -> F8:
        """Interpolate curves by cubic splines, with constant values before the first and after the last time.

        If friction holds many bobs, linear interpolation would leave 2 % of them out of the band.
        """
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.t, curves, axis=-1)(np.clip(t, self.t[0], self.t[-1])))


def uncertain(scene: Scene, measured: Joint | None = None) -> Joint:
    """Return the quantities of a scene that are uncertain and affect the motion of its bob.

    Parameters
    ----------
    scene : Scene
        The scene; its quantities are assumed to be independent.
    measured : Joint, optional
        Joint estimate of some of the scene's attributes, which replaces the scene's own values and uncertainties.
    """
    together = measured or Joint((), np.empty(0), np.empty((0, 0)), ())
    alone: dict[str, Estimate] = {}
    for name in (field.name for field in fields(scene)):
        known = getattr(scene, name)
        idle = name.startswith("sensor_") or (name.startswith("air_") and scene.disc_diameter_m is None)
        if isinstance(known, Estimate) and known.u > 0.0 and not idle and name not in together.names:
            alone[name] = known
    size = len(together.names)
    covariance = np.diag([*np.zeros(size), *(each.u**2 for each in alone.values())])
    covariance[:size, :size] = together.covariance
    return Joint(
        (*together.names, *alone),
        np.array([*together.values, *(each.value for each in alone.values())]),
        covariance,
        (*together.units, *(each.unit for each in alone.values())),
    )


def draw(scene: Scene, measured: Joint | None = None, *, members: int = MEMBERS, seed: int = 0) -> list[Problem]:
    """Return an ensemble of problems: first that of the scene's values, then members drawn from its uncertainties.

    Parameters
    ----------
    scene, measured
        As in :func:`uncertain`. A measured spring constant represents a measured frequency: its uncertainty is that
        from the frequency alone, and its value is scaled in proportion to the drawn masses.
    members, seed : int
        Number of members and random seed.

    Raises
    ------
    SceneError
        If the scene lacks a value that a motion requires.
    DynamicsError
        If a mass or spring constant is drawn as 0 or less, or a member gives no valid problem.

    Notes
    -----
    The quantities are normally distributed and drawn on a Latin hypercube [1]_. The range of each quantity is divided
    into as many intervals of equal probability as there are members, and each interval is drawn once. Quantiles then
    scatter less than with independent draws. Negative draws of a quantity that cannot be negative are set to 0.

    References
    ----------
    .. [1] M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239, doi:10.1080/00401706.1979.10489755.
    """
    joint = uncertain(scene, measured)
    u = np.sqrt(np.diag(joint.covariance))
    drawn = joint.values + u * _normal(joint, members, seed)
    return [Problem.from_scene(scene), *(_member(scene, joint, measured, values) for values in drawn.tolist())]


def _normal(joint: Joint, members: int, seed: int) -> F8:
    """Return standard normal numbers (members, k) with the correlations of a joint estimate, on a Latin hypercube."""
    from scipy.special import ndtri

    u = np.sqrt(np.diag(joint.covariance))
    correlation = _correlation(joint) + 1e-12 * np.eye(
        u.size
    )  # required for a correlation of 1, whose singular matrix has no Cholesky factor
    shares = np.tile((np.arange(members) + 0.5) / members, (u.size, 1))
    normal = ndtri(np.random.default_rng(seed).permuted(shares, axis=1))
    return np.asarray((np.linalg.cholesky(correlation) @ normal).T)


def _correlation(joint: Joint) -> F8:
    u = np.sqrt(np.diag(joint.covariance))
    safe = np.where(u > 0.0, u, 1.0)
    correlation = joint.covariance / np.outer(safe, safe)
    correlation[u == 0.0, u == 0.0] = 1.0
    return np.asarray(correlation)


def _member(scene: Scene, joint: Joint, measured: Joint | None, values: list[float]) -> Problem:
    """Return one member with the drawn values of the uncertain quantities."""
    member = replace(scene, **_limited(joint, values))
    if measured is not None and "spring_constant_n_per_m" in measured.names:
        constant = member.spring_constant_n_per_m
        assert constant is not None
        share = effective_mass_kg(member) / effective_mass_kg(scene)
        member = replace(member, spring_constant_n_per_m=replace(constant, value=constant.value * share))
    return Problem.from_scene(member)


def spread(
    scene: Scene,
    seconds: float,
    measured: Joint | None = None,
    *,
    members: int = MEMBERS,
    seed: int = 0,
    ensemble: bool = False,
) -> Band:
    """Return the band around the motion of a scene.

    Parameters
    ----------
    scene, measured, members, seed
        As in :func:`draw`.
    seconds : float
        Duration, s.
    ensemble : bool
        Solve every member even if linear propagation is valid.

    Raises
    ------
    SceneError, DynamicsError
        As in :func:`draw`, and if the run exceeds 50,000 steps of 0.2 rad (10,000 steps with friction).
    """
    joint = uncertain(scene, measured)
    middle = Problem.from_scene(scene)
    step_s = RADIANS / middle.equation.angular_frequency_per_s
    steps = max(1, math.ceil(seconds / step_s))
    most = MOST_STEPS // TURNS_COST if middle.equation.friction_m_per_s2 else MOST_STEPS
    if steps > most:
        raise DynamicsError(
            f"a band of {seconds:g} s takes {steps} steps, more than {most}; ask for at most {most * step_s:.3g} s"
        )
    found = sensitivity(joint.names, middle, _shifted(scene, joint, measured), step_s, steps)
    linear = found.holds and not ensemble and not _reaches_zero(joint)
    if linear:
        members = max(members, MEMBERS_MOVED)
        parts = list(_moved(found, _correlation(joint), _normal(joint, members, seed)))
    else:
        parts = list(_solved(draw(scene, measured, members=members, seed=seed), step_s, steps))
    of_displacement, of_amplitude, of_phase = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
    amplitude = np.abs(found.middle)
    return Band(joint.names, members, seed, found.t, amplitude, of_displacement, of_amplitude, of_phase, found, linear)


def _shifted(scene: Scene, joint: Joint, measured: Joint | None) -> list[Problem]:
    """Return two problems per quantity: with the quantity alone increased, then decreased, by its uncertainty."""
    found = []
    for row, u in enumerate(np.sqrt(np.diag(joint.covariance)).tolist()):
        for sign in (1.0, -1.0):
            values = joint.values.copy()
            values[row] += sign * u
            found.append(_member(scene, joint, measured, values.tolist()))
    return found


def _reaches_zero(joint: Joint) -> bool:
    """Return whether a quantity that cannot be negative is near enough to 0 for some draws to be set to 0."""
    u = np.sqrt(np.diag(joint.covariance))
    return any(
        name not in SIGNED and value < REACH * each
        for name, value, each in zip(joint.names, joint.values, u, strict=True)
    )


def _moved(found: Sensitivity, correlation: F8, normal: F8) -> Iterator[tuple[F8, F8, F8]]:
    """Yield the quantiles from linear propagation for successive blocks of steps.

    The quantiles of the displacement are those of members computed with the sensitivities. Phase and logarithm of the
    amplitude are sums of normal inputs, so that their quantiles follow in closed form.
    """
    from scipy.special import ndtri

    edges = ndtri(SHARES)[:, None]
    for start in range(0, found.t.size, STRETCH):
        columns = slice(start, start + STRETCH)
        middle, of_log = found.middle[columns], found.of_log[:, columns]
        grown, turned = (np.sqrt(np.sum(part * (correlation @ part), axis=0)) for part in (of_log.real, of_log.imag))
        amplitude = np.abs(middle)
        members = amplitude * np.exp(normal @ of_log.real) * np.cos(np.angle(middle) + normal @ of_log.imag)
        yield _quantiles(members, middle.real), amplitude * np.expm1(edges * grown), edges * turned


def _solved(ensemble: list[Problem], step_s: float, steps: int) -> Iterator[tuple[F8, F8, F8]]:
    """Yield the quantiles of solved members for successive blocks of steps."""
    last: F8 = np.zeros((len(ensemble) - 1, 1))
    for states in solved(ensemble, step_s, steps):
        turned = np.angle(states[1:] * np.conj(states[0]))
        phase = np.unwrap(np.concatenate([last, turned], axis=1), axis=1)[:, 1:]
        last = phase[:, -1:]
        yield (
            _quantiles(states[1:].real, states[0].real),
            _quantiles(np.abs(states[1:]), np.abs(states[0])),
            _quantiles(phase, np.zeros(states.shape[1])),
        )


def _quantiles(members: F8, middle: F8) -> F8:
    """Return the quantiles (4, n) of members minus the middle, by Hazen's method, which matches the hypercube."""
    return np.asarray(np.quantile(members, SHARES, axis=0, method="hazen") - middle)


def _limited(joint: Joint, values: list[float]) -> dict[str, Any]:
    """Return the drawn values by attribute of the scene, with negative values set to 0 where they are impossible."""
    found = {}
    for name, value, unit in zip(joint.names, values, joint.units, strict=True):
        if name in POSITIVE and value <= 0.0:
            raise DynamicsError(
                f"the uncertainty of {name}, {joint[name]}, reaches down to 0, where nothing moves; give a smaller one"
            )
        found[name] = Estimate(value if name in SIGNED else max(value, 0.0), 0.0, unit)
    return found
