"""Compare a measured run with the prediction of its scene: missing values, uncertainty and residuals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.analysis import Analysis, Oscillation
from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem
from pipeline.dynamics.band import C16, Band
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.track import F8, UNUSABLE
from springmass.errors import UNREADABLE, ProgramError
from springmass.simulations.simulation import FINE, count_of, solve

WIDER = 1.96  # standard deviations of the noise by which the band is widened, for 95 %
HALF = 0.5
FURTHEST_U = 20.0  # maximum change of an input, in standard uncertainties
LARGEST_RESIDUAL_M = 1e300  # m; residual assigned to a change that gives no finite residual
SCENE_KEYS = {"gamma": "gamma_per_s", "beta": "beta_per_m_s", "mu": "mu_m_per_s"}


@dataclass(frozen=True, slots=True)
class InputShift:
    """The change of one input alone that brings the prediction closest to the run, and the rms that is then left."""

    name: str
    given: float
    value: float
    in_u: float
    rms_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Against:
    """A measured run with a prediction laid over it, at the samples used (n,), in s and m.

    ``free`` has the times since the first sample, the displacements and the fitted velocities without false echoes.
    ``band`` has the quantiles (4, n) of the predicted distance relative to ``predicted``; ``inside`` is the share of
    the samples within its 95 % widened by the noise, and ``leaves_band_s`` the time from which the run leaves it.
    """

    t: F8
    measured: F8
    predicted: F8
    rms_m: float
    noise_m: float
    free: tuple[F8, F8, F8]
    band: F8 | None = None
    inside: float | None = None
    leaves_band_s: float | None = None
    shifts: tuple[InputShift, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Return the comparison as the JSON of ``springmass simulate`` has it."""
        return {
            "rms_m": self.rms_m,
            "noise_m": self.noise_m,
            "inside_95": self.inside,
            "leaves_s": self.leaves_band_s,
            "moves": [
                {"name": shift.name, "from": shift.given, "to": shift.value, "in_u": shift.in_u, "rms_m": shift.rms_m}
                for shift in self.shifts
            ],
        }


def scene_from_run(scene: Scene, analysis: Analysis, *, damping: bool = True) -> tuple[Scene, Joint]:
    """Return a scene completed with values from a run's analysis, and the joint distribution of those values.

    The start is always taken from the run, because nobody releases a bob exactly at the first sample; the damping only
    if ``damping`` is true.

    With :math:`y_0 = A\\cos\\varphi` and :math:`v_0 = -\\omega A\\sin\\varphi`, the start takes its uncertainty from
    amplitude and phase. A spring constant :math:`k = \\omega^2 m` takes only the uncertainty of the frequency, because
    that of the masses is part of the scene. The phase at the first sample comes from the straight line through all
    phases. Its covariance with the frequency is therefore :math:`-\\tau u_\\omega^2`, where :math:`\\tau` is the time
    from the first sample to the middle of the line. Amplitude and coefficients have the covariance of the damping law.
    """
    analysis.track.demand_length("a prediction laid over a run")
    motion = _oscillation(analysis)
    scale = analysis.estimates
    first = int(np.flatnonzero(analysis.conditioned.used)[0])
    displacement = motion.waveform.position[first] - motion.rest.at(analysis.track.t[first : first + 1])[0]
    taken: dict[str, Estimate] = {
        "start_displacement_m": Estimate(float(displacement), 0.0, "m"),
        "start_velocity_m_per_s": Estimate(float(motion.waveform.velocity[first]), 0.0, "m/s"),
    }
    law = motion.damping.best.joint
    omega, amplitude, angle = (scale[name].value for name in ("angular_frequency", "amplitude", "phase"))
    # Rows: the scene's attributes; columns: frequency, phase, then the law's amplitude and coefficients.
    slopes = np.zeros((5 + len(law.names), 2 + len(law.names)))
    cosine, sine = math.cos(angle), math.sin(angle)
    slopes[0, 1:3] = -amplitude * sine, cosine
    slopes[1, 1:3] = -omega * amplitude * cosine, -omega * sine
    if scene.spring_constant_n_per_m is None and "spring_constant" in scale:
        slopes[len(taken), 0] = 2.0 * scale["spring_constant"].value / omega
        taken["spring_constant_n_per_m"] = scale["spring_constant"]
    if damping and all(getattr(scene, name) is None for name in SCENE_KEYS.values()):
        for name, attribute in SCENE_KEYS.items():
            if name in law.names:
                slopes[len(taken), 2 + law.names.index(name)] = 1.0
                taken[attribute] = replace(law[name], value=max(law[name].value, 0.0))
    slopes = slopes[: len(taken)]
    measured = Joint(
        tuple(taken),
        np.array([each.value for each in taken.values()]),
        slopes @ _covariance(motion) @ slopes.T,
        tuple(each.unit for each in taken.values()),
    )
    values: dict[str, Any] = dict(taken)
    return replace(scene, **values), measured


def compare_with_run(
    analysis: Analysis,
    problem: Problem,
    method: str,
    step_s: float,
    tolerance: float | None,
    band: Band | None,
    values: Mapping[str, Estimate] | None = None,
) -> Against:
    """Lay a prediction over a measured run from its first used sample on; ``problem`` is of the completed scene.

    The step of ``auto`` is short enough for interpolation. ``values`` are the inputs of the band by name, for which
    the best-fitting values are sought.
    """
    motion = _oscillation(analysis)
    used = analysis.conditioned.used
    t, measured = analysis.track.t[used], analysis.track.y[used]
    if method == "auto":
        step_s = min(step_s, 1.0 / (FINE * problem.equation.angular_frequency_per_s))
    count = count_of(step_s * max(1, math.ceil(duration_s(analysis) / step_s)), step_s)
    trajectory = solve(problem, method, step_s, count, tolerance).trajectory
    rest, good = motion.rest.at(t), (analysis.flags[used] & UNUSABLE) == 0
    free = tuple(each[good] for each in (t - t[0], measured - rest, motion.waveform.velocity[used]))
    predicted: F8 = rest + trajectory.at(t - t[0])
    rms = float(np.sqrt(np.mean((measured - predicted) ** 2)))
    noise = analysis.estimates["noise"].value
    if band is None:
        return Against(t, measured, predicted, rms, noise, free)
    around = band.displacement_at(t - t[0])
    left = measured - predicted
    outside = (left < around[0] - WIDER * noise) | (left > around[3] + WIDER * noise)
    shifts = _shifts(band, t - t[0], left, values or {})
    inside = 1.0 - float(np.mean(outside))
    leaves_band_s = _leaves(t, outside, problem)
    return Against(t, measured, predicted, rms, noise, free, around, inside, leaves_band_s, shifts)


def _leaves(t: F8, outside: NDArray[np.bool_], problem: Problem) -> float | None:
    """Return the time from which more than half the samples of a period lie outside the band; None if they never do."""
    period_s = 2.0 * math.pi / problem.equation.angular_frequency_per_s
    # Number of samples outside the band in the period that starts at each sample; the record may have gaps.
    total = np.concatenate([[0], np.cumsum(outside)])
    ends = np.searchsorted(t, t + period_s, side="right")
    share = (total[ends] - total[:-1]) / (ends - np.arange(t.size))
    whole = t + period_s <= t[-1]
    beginnings = np.flatnonzero(whole & (share > HALF))
    return float(t[beginnings[0]]) if beginnings.size else None


def _shifts(band: Band, since: F8, left: F8, values: Mapping[str, Estimate]) -> tuple[InputShift, ...]:
    """Return the least-squares change of each input alone that brings the prediction closest to the record."""
    from scipy.optimize import minimize_scalar

    shifts = []
    # Evaluated at the times of the band, whose states are two fifths of a radian apart.
    rows = np.unique(np.searchsorted(band.t, since).clip(max=band.t.size - 1))
    at = np.interp(band.t[rows], since, left)
    middle = band.middle[rows]
    for name, log in zip(band.quantities, band.of_log, strict=True):
        if name not in values or values[name].u <= 0.0:
            continue

        def rms(shift: float, of: C16 = log[rows]) -> float:
            with np.errstate(over="ignore", invalid="ignore"):
                moved = (middle * np.expm1(shift * of)).real
                size = float(np.sqrt(np.mean((at - moved) ** 2)))
            return size if math.isfinite(size) else LARGEST_RESIDUAL_M

        grid = np.linspace(-FURTHEST_U, FURTHEST_U, 401)
        best = float(grid[int(np.argmin([rms(each) for each in grid]))])
        step = float(grid[1] - grid[0])
        shift = float(minimize_scalar(rms, bounds=(best - step, best + step), method="bounded").x)
        given = values[name]
        shifts.append(InputShift(name, given.value, given.value + shift * given.u, shift, rms(shift)))
    return tuple(sorted(shifts, key=lambda shift: shift.rms_m))


def deviation_text(against: Against) -> list[str]:
    """Return lines that state where the record leaves the band, and which changes of an input would explain it."""
    if against.inside is None:
        return []
    lines = [f"in the band      {against.inside:.1%} of the samples lie within 95 % and the noise"]
    if against.leaves_band_s is None:
        lines.append("                 the record never leaves it for half a period")
        return lines
    lines.append(
        f"leaves the band  from {against.leaves_band_s:.3g} s on more than half of a period's samples are outside"
    )
    for shift in against.shifts[:3]:
        far = abs(shift.in_u) > 0.99 * FURTHEST_U
        lines.append(
            f"                 {shift.name} alone would have to be {shift.value:.6g}, not {shift.given:.6g} "
            f"({'more than ' if far else ''}{shift.in_u:+.1f} u): rms {shift.rms_m * 1e3:.3g} mm would be left"
        )
    return lines


def duration_s(analysis: Analysis) -> float:
    """Return the time from the first to the last used sample, s."""
    t = analysis.track.t[analysis.conditioned.used]
    return float(t[-1] - t[0])


def _oscillation(analysis: Analysis) -> Oscillation:
    if not isinstance(analysis.motion, Oscillation):
        raise ProgramError(
            f"{analysis.motion.why}: nothing to lay a prediction over; name a run that oscillates", UNREADABLE
        )
    return analysis.motion


def _covariance(motion: Oscillation) -> F8:
    """Return the covariance of frequency, phase, and the damping law's amplitude and coefficients."""
    phase, law = motion.phase, motion.damping.best.joint
    covariance = np.zeros((2 + len(law.names), 2 + len(law.names)))
    covariance[2:, 2:] = law.covariance
    u_omega, u_phase = phase.angular_frequency.u, phase.phase.u
    covariance[0, 0], covariance[1, 1] = u_omega**2, u_phase**2
    between = (phase.t0 - phase.middle) * u_omega**2
    covariance[0, 1] = covariance[1, 0] = math.copysign(min(abs(between), u_omega * u_phase), between)
    return covariance
