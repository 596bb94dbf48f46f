"""A measured run under the prediction of its scene: what the scene leaves out, how sure that is, what is left."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem
from pipeline.dynamics.band import Band
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.track import F8
from springmass.errors import UNREADABLE, ProgramError
from springmass.runs.simulation import Against, count_of, plan

__all__ = ["completed", "duration_s", "lay_over"]

FINE = 24.0  # states a radian between which an interpolation errs by 1e-8 of the amplitude
COEFFICIENTS = {"gamma": "gamma_per_s", "beta": "beta_per_m_s", "mu": "mu_m_per_s"}


def completed(scene: Scene, analysis: Analysis) -> tuple[Scene, Joint]:
    """Return a scene in which a run's analysis stands for what is left out, and what it stands for.

    The start is always the run's: nobody releases a bob at the first sample.

    Returns
    -------
    Scene
    Joint
        Of the scene's attributes that are the run's: amplitude, phase, frequency and damping with their covariance.

    Raises
    ------
    ProgramError
        With exit code 3 if the run does not oscillate.
    TrackError
        If it is no length.

    Notes
    -----
    With :math:`y_0 = A\\cos\\varphi` and :math:`v_0 = -\\omega A\\sin\\varphi` the start takes its uncertainty from
    amplitude and phase, a spring constant :math:`k = \\omega^2 m` that of the frequency, as the masses' is the scene's.
    The phase at the first sample comes from the straight line through all phases, so its covariance with the frequency
    is :math:`-\\tau u_\\omega^2`, where the line's middle is :math:`\\tau` later. Amplitude and coefficients have the
    covariance of the damping law.
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
    if all(getattr(scene, name) is None for name in COEFFICIENTS.values()):
        for name, attribute in COEFFICIENTS.items():
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
    known: dict[str, Any] = dict(taken)
    return replace(scene, **known), measured


def lay_over(
    analysis: Analysis, problem: Problem, method: str, step_s: float, tolerance: float | None, band: Band | None
) -> Against:
    """Lay a prediction over a measured run, from the run's first sample on.

    Parameters
    ----------
    analysis : Analysis
        Of the run.
    problem : Problem
        As the scene that :func:`completed` returned states it.
    method, step_s, tolerance
        As in :func:`springmass.runs.simulation.plan`; the step of ``auto`` is one that can be interpolated between.
    band : Band or None
        Around the prediction.

    Raises
    ------
    DynamicsError
        If the method cannot solve this, or the numbers ran away.
    """
    motion = _oscillation(analysis)
    used = analysis.conditioned.used
    t, measured = analysis.track.t[used], analysis.track.y[used]
    if method == "auto":
        step_s = min(step_s, 1.0 / (FINE * problem.equation.angular_frequency_per_s))
    count = count_of(step_s * max(1, math.ceil(duration_s(analysis) / step_s)), step_s)
    trajectory = plan(problem, method, step_s, count, tolerance).run(count)
    predicted: F8 = motion.rest.at(t) + trajectory.at(t - t[0])
    rms = float(np.sqrt(np.mean((measured - predicted) ** 2)))
    around = None if band is None else band.displacement_at(t - t[0])
    return Against(t, measured, predicted, rms, analysis.estimates["noise"].value, around)


def duration_s(analysis: Analysis) -> float:
    """Return the time from the first sample used to the last, s."""
    t = analysis.track.t[analysis.conditioned.used]
    return float(t[-1] - t[0])


def _oscillation(analysis: Analysis) -> Oscillation:
    if not isinstance(analysis.motion, Oscillation):
        raise ProgramError(
            f"{analysis.motion.why}: nothing to lay a prediction over; name a run that oscillates", UNREADABLE
        )
    return analysis.motion


def _covariance(motion: Oscillation) -> F8:
    """Covariance of frequency, phase, and the damping law's amplitude and coefficients."""
    phase, law = motion.phase, motion.damping.best.joint
    found = np.zeros((2 + len(law.names), 2 + len(law.names)))
    found[2:, 2:] = law.covariance
    u_omega, u_phase = phase.angular_frequency.u, phase.phase.u
    found[0, 0], found[1, 1] = u_omega**2, u_phase**2
    between = (phase.t0 - phase.middle) * u_omega**2
    found[0, 1] = found[1, 0] = math.copysign(min(abs(between), u_omega * u_phase), between)
    return found
