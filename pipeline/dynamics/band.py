"""The band that a scene's uncertainties make around its motion: an ensemble drawn from them, solved, and its quantiles.

An ensemble, as no derivative holds far enough: after a hundred periods an uncertain frequency turns the phase by more
than a radian, and friction stops each bob elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.problem import Problem, effective_mass_kg
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.track import F8

__all__ = ["LEVELS", "Band", "draw", "spread", "uncertain"]

LEVELS = ("low_95", "low_68", "high_68", "high_95")
SHARES = (0.025, 0.158655, 0.841345, 0.975)  # of the members below each
MEMBERS = 300  # the edges of 68 % then scatter by a fifteenth of sigma, those of 95 % by a seventh
RADIANS = 0.2  # a step of Strang splitting: its error is that of all members alike, and leaves their differences
STRETCH = 2000  # steps held in memory
MOST_STEPS = 50_000
TURNS_COST = 5  # times as long a step takes where friction asks for every turning point
SIGNED = ("start_displacement_m", "start_velocity_m_per_s", "spring_cubic_n_per_m3", "air_temperature_c")
POSITIVE = ("bob_mass_kg", "spring_constant_n_per_m")


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Quantiles of an ensemble about the motion that the scene's values give.

    Parameters
    ----------
    quantities : tuple of str
        The scene's attributes that are uncertain.
    members, seed : int
        Of the ensemble.
    t : (n,) float64, s
    amplitude : (n,) float64, m
        :math:`\\sqrt{y^2 + (v/\\omega_0)^2}` of the scene's values.
    of_displacement, of_amplitude : (4, n) float64, m
        The quantiles of :data:`LEVELS` less what the scene's values give.
    """

    quantities: tuple[str, ...]
    members: int
    seed: int
    t: F8
    amplitude: F8
    of_displacement: F8
    of_amplitude: F8

    def displacement_at(self, t: F8) -> F8:
        """Return the quantiles (4, k) of the displacement less that of the scene's values, m, at times (k,), s."""
        return np.array([np.interp(t, self.t, each) for each in self.of_displacement])

    def amplitude_at(self, t: F8) -> tuple[F8, F8]:
        """Return the amplitude (k,) of the scene's values and its quantiles (4, k), m, at times (k,), s."""
        middle: F8 = np.interp(t, self.t, self.amplitude)
        return middle, middle + np.array([np.interp(t, self.t, each) for each in self.of_amplitude])


def uncertain(scene: Scene, measured: Joint | None = None) -> Joint:
    """Return what of a scene has an uncertainty and moves its bob.

    Parameters
    ----------
    scene : Scene
        Its quantities are taken as independent.
    measured : Joint, optional
        Of some of the scene's attributes together, in place of the scene's own uncertainties.
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
    """Return an ensemble of problems: that of the scene's values, then members drawn from its uncertainties.

    Parameters
    ----------
    scene, measured
        As in :func:`uncertain`. A measured spring constant stands for a measured frequency: its uncertainty is what the
        frequency adds, and it goes with the drawn masses.
    members, seed : int

    Raises
    ------
    SceneError
        If the scene lacks what a motion needs.
    DynamicsError
        If mass or spring constant may as well be 0, or a member cannot move.

    Notes
    -----
    Normal distributions on a Latin hypercube [1]_: each quantity falls once into each of as many shares of equal
    probability as there are members, which leaves quantiles less to chance than independent draws. Below 0, where a
    quantity cannot be, it is drawn as 0.

    References
    ----------
    .. [1] M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239, doi:10.1080/00401706.1979.10489755.
    """
    from scipy.special import ndtri

    joint = uncertain(scene, measured)
    u = np.sqrt(np.diag(joint.covariance))
    safe = np.where(u > 0.0, u, 1.0)
    # A correlation of 1 is as good as its square root without rounding.
    correlation = joint.covariance / np.outer(safe, safe) + 1e-12 * np.eye(u.size)
    correlation[u == 0.0, u == 0.0] = 1.0
    shares = np.tile((np.arange(members) + 0.5) / members, (u.size, 1))
    normal = ndtri(np.random.default_rng(seed).permuted(shares, axis=1))
    drawn = joint.values + (u[:, None] * (np.linalg.cholesky(correlation) @ normal)).T
    with_mass = measured is not None and "spring_constant_n_per_m" in measured.names
    problems = [Problem.from_scene(scene)]
    for values in drawn.tolist():
        member = replace(scene, **_limited(joint, values))
        if with_mass:
            constant = member.spring_constant_n_per_m
            assert constant is not None
            share = effective_mass_kg(member) / effective_mass_kg(scene)
            member = replace(member, spring_constant_n_per_m=replace(constant, value=constant.value * share))
        problems.append(Problem.from_scene(member))
    return problems


def spread(
    scene: Scene, seconds: float, measured: Joint | None = None, *, members: int = MEMBERS, seed: int = 0
) -> Band:
    """Return the band around the motion of a scene.

    Parameters
    ----------
    scene, measured, members, seed
        As in :func:`draw`.
    seconds : float
        How long, s.

    Raises
    ------
    SceneError, DynamicsError
        As :func:`draw`; and if the run is longer than 50,000 steps of a fifth of a radian, with friction 10,000.
    """
    ensemble = draw(scene, measured, members=members, seed=seed)
    omegas = np.array([one.equation.angular_frequency_per_s for one in ensemble])
    step_s = RADIANS / float(omegas[0])
    steps = max(1, math.ceil(seconds / step_s))
    most = MOST_STEPS // TURNS_COST if any(one.equation.friction_m_per_s2 for one in ensemble) else MOST_STEPS
    if steps > most:
        raise DynamicsError(
            f"a band of {seconds:g} s takes {steps} steps, more than {most}; ask for at most {most * step_s:.3g} s"
        )
    parts = []
    for start in range(0, steps, STRETCH):
        runs = [STRANG.run(one, step_s, min(STRETCH, steps - start)) for one in ensemble]
        rows = slice(0 if start == 0 else 1, None)  # a stretch begins where the last one ended
        y, v = (np.array([getattr(run, name)[rows] for run in runs]) for name in ("y", "v"))
        amplitude = np.hypot(y, v / omegas[:, None])
        parts.append([amplitude[:1], _quantiles(y), _quantiles(amplitude)])
        ensemble = [Problem(run.problem.equation, run.y[-1], run.v[-1]) for run in runs]
    middle, of_displacement, of_amplitude = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
    names = uncertain(scene, measured).names
    return Band(names, members, seed, step_s * np.arange(steps + 1.0), middle[0], of_displacement, of_amplitude)


def _quantiles(states: F8) -> F8:
    """Quantiles (4, n) of all members but the first, less the first; the hypercube's shares begin as Hazen's do."""
    return np.asarray(np.quantile(states[1:], SHARES, axis=0, method="hazen") - states[0])


def _limited(joint: Joint, values: list[float]) -> dict[str, Any]:
    """What is drawn, by the scene's attributes, within what it can be."""
    found = {}
    for name, value, unit in zip(joint.names, values, joint.units, strict=True):
        if name in POSITIVE and value <= 0.0:
            raise DynamicsError(
                f"the uncertainty of {name}, {joint[name]}, reaches down to 0, where nothing moves; give a smaller one"
            )
        found[name] = Estimate(value if name in SIGNED else max(value, 0.0), 0.0, unit)
    return found
