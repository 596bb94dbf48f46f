"""The uncertainty band around the motion of a scene: quantiles of an ensemble drawn from the scene's uncertainties.

Each member is the closed form of the averaged motion, :math:`A(t)\\cos\\varphi(t)`, so that none has to be solved. Only
differences between members count, in which the error of the average is common: the band's width is off by about one
percent (``pytest -m trials tests/trials/test_bands.py``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.bench.disc import effective_mass_kg
from pipeline.bench.scene import Scene
from pipeline.damping.laws.drag import amplitudes
from pipeline.dynamics.equation import Problem
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.track import C16, F8

LEVELS = ("low_95", "low_68", "high_68", "high_95")
SHARES = (0.025, 0.158655, 0.841345, 0.975)  # probabilities below each level
MEMBERS = 2000  # default ensemble size; by chance, the share inside the 95 % band then scatters by half a percent
RADIANS = 0.4  # from one state to the next; between them the band is off by half a percent of its width, as measured
MOST_STATES = 25_000  # maximum number of states of a band
STRETCH = 1000  # number of states in memory at a time
STRONGEST = 0.9  # maximum ratio of decay rate and angular frequency at which a motion is an oscillation
SIGNED = ("start_displacement_m", "start_velocity_m_per_s", "spring_cubic_n_per_m3", "air_temperature_c")
POSITIVE = ("bob_mass_kg", "spring_constant_n_per_m")


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Quantiles (4, n) of an ensemble at :data:`LEVELS`, relative to the motion for the scene's values."""

    quantities: tuple[str, ...]  # the scene's attributes that are uncertain
    members: int
    seed: int
    t: F8
    middle: C16  # A e^(i phi) for the scene's values
    of_log: C16  # (k, n): change of ln A + i phi when each quantity changes by its standard uncertainty
    of_displacement: F8
    of_amplitude: F8
    of_phase: F8

    @property
    def relative_u(self) -> float:
        """Maximum half width of the displacement's 68 % band, relative to the starting amplitude; 0 if that is 0."""
        half, start = 0.5 * float(np.max(self.of_displacement[2] - self.of_displacement[1])), float(abs(self.middle[0]))
        return half / start if start > 0.0 else 0.0

    def displacement_at(self, t: F8) -> F8:
        """Return quantiles (4, k) in m of the displacement minus that for the scene's values, at times t (k,) in s."""
        return self._between(self.of_displacement, t)

    def amplitude_at(self, t: F8) -> tuple[F8, F8]:
        """Return the amplitude for the scene's values (k,) and its quantiles (4, k) in m, at times t (k,) in s."""
        middle = self._between(np.abs(self.middle), t)
        return middle, middle + self._between(self.of_amplitude, t)

    def phase_at(self, t: F8) -> F8:
        """Return quantiles (4, k) in rad of the phase minus that for the scene's values, at times t (k,) in s."""
        return self._between(self.of_phase, t)

    def _between(self, curves: F8, t: F8) -> F8:
        """Interpolate curves by cubic splines, with constant values before the first and after the last time."""
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.t, curves, axis=-1)(np.clip(t, self.t[0], self.t[-1])))


def uncertain(scene: Scene, measured: Joint | None) -> Joint:
    """Return the uncertain quantities of a scene that affect its motion; a joint estimate replaces the scene's own."""
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

    The quantities are normally distributed and drawn on a Latin hypercube (M. D. McKay, R. J. Beckman, W. J. Conover,
    Technometrics 21 (1979) 239): each of as many intervals of equal probability as there are members is drawn once, so
    that quantiles scatter less. Negative draws of a quantity that cannot be negative are set to 0.
    """
    from scipy.special import ndtri

    joint = uncertain(scene, measured)
    u = np.sqrt(np.diag(joint.covariance))
    scale = np.outer(u, u) + (u[:, None] * u == 0.0)
    # The root of the correlations exists for a correlation of 1 too, whose singular matrix has no Cholesky factor.
    squares, axes = np.linalg.eigh(joint.covariance / scale)
    # Two lines, as scipy.stats.qmc takes 0.8 s to import.
    shares = np.tile((np.arange(members) + 0.5) / members, (u.size, 1))
    normal = ndtri(np.random.default_rng(seed).permuted(shares, axis=1))
    drawn = joint.values + u * (axes @ (np.sqrt(np.maximum(squares, 0.0))[:, None] * (axes.T @ normal))).T
    return [Problem.from_scene(scene), *(_member(scene, joint, measured, values) for values in drawn.tolist())]


def _member(scene: Scene, joint: Joint, measured: Joint | None, values: list[float]) -> Problem:
    """Return one member with the drawn values of the uncertain quantities.

    A measured spring constant represents a measured frequency: its uncertainty is that from the frequency alone, and
    its value is scaled in proportion to the drawn masses.
    """
    drawn: dict[str, Any] = {}
    for name, value, unit in zip(joint.names, values, joint.units, strict=True):
        if name in POSITIVE and value <= 0.0:
            raise DynamicsError(
                f"the uncertainty of {name}, {joint[name]}, reaches down to 0, where nothing moves",
                "give a smaller one",
            )
        drawn[name] = Estimate(value if name in SIGNED else max(value, 0.0), 0.0, unit)
    member = replace(scene, **drawn)
    if measured is not None and "spring_constant_n_per_m" in measured.names:
        constant = drawn["spring_constant_n_per_m"]
        share = effective_mass_kg(member) / effective_mass_kg(scene)
        member = replace(member, spring_constant_n_per_m=Estimate(constant.value * share, constant.u, constant.unit))
    return Problem.from_scene(member)


def _shifted(scene: Scene, joint: Joint, measured: Joint | None) -> list[Problem]:
    """Return the problems with each uncertain quantity shifted up by its standard uncertainty, then down."""
    shifts = np.concatenate([sign * np.diag(np.sqrt(np.diag(joint.covariance))) for sign in (1.0, -1.0)])
    return [_member(scene, joint, measured, values) for values in (joint.values + shifts).tolist()]


def propagated(scene: Scene, measured: Joint | None, of: Callable[[Problem], Sequence[float]]) -> F8:
    """Return the standard uncertainties (q,) of numbers of a motion, from those of its scene to first order."""
    joint = uncertain(scene, measured)
    u = np.sqrt(np.diag(joint.covariance))
    ahead, behind = np.split(np.array([of(each) for each in _shifted(scene, joint, measured)]), 2)
    slopes = 0.5 * (ahead - behind) / np.where(u > 0.0, u, 1.0)[:, None]
    return np.asarray(np.sqrt(np.maximum(np.einsum("kq,kl,lq->q", slopes, joint.covariance, slopes), 0.0)))


def spread(
    scene: Scene, seconds: float, measured: Joint | None = None, *, members: int = MEMBERS, seed: int = 0
) -> Band:
    """Return the band around the motion of a scene over some seconds, drawn as by :func:`draw`."""
    joint = uncertain(scene, measured)
    ensemble = draw(scene, measured, members=members, seed=seed)
    ensemble += _shifted(scene, joint, measured)
    step_s = RADIANS / ensemble[0].equation.angular_frequency_per_s
    steps = max(1, math.ceil(seconds / step_s))
    if steps > MOST_STATES:
        raise DynamicsError(f"a band of {seconds:g} s is too long", f"ask for at most {MOST_STATES * step_s:.3g} s")
    t = step_s * np.arange(steps + 1.0)
    parts = [_quantiles(*stretch, members) for stretch in _motions(ensemble, t)]
    middle, of_log, displacement, amplitude, phase = (
        np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)
    )
    return Band(
        quantities=joint.names,
        members=members,
        seed=seed,
        t=t,
        middle=middle,
        of_log=of_log,
        of_displacement=displacement,
        of_amplitude=amplitude,
        of_phase=phase,
    )


def _quantiles(y: F8, amplitude: F8, phase: F8, members: int) -> tuple[Any, ...]:
    """Return the middle, the changes with each quantity, and the quantiles of displacement, amplitude and phase.

    The motions (k, n) are that of the scene's values, the members, and those with each quantity shifted up, then down.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(amplitude[members + 1 :] / amplitude[0]) + 1j * (phase[members + 1 :] - phase[0])
    ahead, behind = np.split(np.where(np.isfinite(log), log, 0.0), 2)
    found = [
        np.quantile(each[1 : members + 1], SHARES, axis=0, method="hazen") - each[0] for each in (y, amplitude, phase)
    ]
    return amplitude[0] * np.exp(1j * phase[0]), 0.5 * (ahead - behind), *found


def _motions(problems: Sequence[Problem], t: F8) -> Iterator[tuple[F8, F8, F8]]:
    """Yield displacements, amplitudes and phases (k, n) of the averaged motions of k problems, stretch by stretch.

    The amplitude is that of :math:`y = A\\cos\\varphi` with :math:`A\\sin\\varphi = -(v + \\lambda y)/\\omega_d`,
    :math:`\\lambda = \\gamma + \\beta A + \\mu/A` and :math:`\\omega_d^2 = \\omega^2 - \\lambda^2` at the start. It
    falls by :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)`. The phase turns by :math:`\\sqrt{\\omega^2-\\gamma^2}`
    :math:`+ 3cA^2/8\\omega`. Friction holds the bob from the first turning point within :math:`\\pi\\mu/2\\omega`.
    """
    omega = np.array([each.equation.angular_frequency_per_s for each in problems])
    gamma, beta, mu = np.array([each.equation.laws() for each in problems]).T
    y, v = np.array([(each.displacement_m, each.velocity_m_per_s) for each in problems]).T
    start = np.maximum(np.hypot(y, v / omega), np.finfo(np.float64).tiny)
    rate = gamma + beta * start + np.where(mu < start * omega, mu / start, 0.0)
    if np.max(rate / omega) > STRONGEST:
        raise DynamicsError("a band is that of an oscillation, and this drag is too strong for one")
    side = -(v + rate * y) / np.sqrt(omega**2 - rate**2)
    laws, phase = np.stack([np.hypot(y, side), mu, gamma, beta], axis=1), np.arctan2(side, y)[:, None]
    phase -= 2.0 * np.pi * np.round((phase - phase[0]) / (2.0 * np.pi))
    speed, stuck = np.sqrt(omega**2 - gamma**2)[:, None], (0.5 * math.pi * mu / omega)[:, None]
    bend = (0.375 / omega * [each.equation.cubic_per_m2_s2 for each in problems])[:, None]
    stop, rest = np.full_like(phase, np.inf), np.zeros_like(phase)
    passed = np.diff(t, prepend=0.0)
    for row in range(0, t.size, STRETCH):
        rows = slice(row, row + STRETCH)
        amplitude = amplitudes(t[rows], laws)
        phase = phase[:, -1:] + np.cumsum((speed + bend * amplitude**2) * passed[rows], axis=1)
        near = amplitude <= stuck
        first = np.argmax(near, axis=1)[:, None]
        stops = near.any(axis=1, keepdims=True) & (mu[:, None] > 0.0) & np.isinf(stop)
        at = np.take_along_axis(phase, first, axis=1)
        turn = np.pi * np.ceil(at / np.pi)
        stop = np.where(stops, turn, stop)
        # Within half a turn the amplitude would fall by twice the distance within which friction holds.
        rest = np.where(stops, stuck * np.cos(turn) * (1.0 - 2.0 * (turn - at) / np.pi), rest)
        held = phase >= stop
        amplitude, phase = np.where(held, np.abs(rest), amplitude), np.minimum(phase, stop)
        yield np.where(held, rest, amplitude * np.cos(phase)), amplitude, phase
