"""Complete a scene from a measured run: its start, spring constant and damping, with their joint uncertainties."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.track import F8
from springmass.errors import UNREADABLE, ProgramError

SCENE_KEYS = {"gamma": "gamma_per_s", "beta": "beta_per_m_s", "mu": "mu_m_per_s"}


def scene_from_run(scene: Scene, analysis: Analysis, *, damping: bool) -> tuple[Scene, Joint]:
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
    motion = oscillation_of(analysis)
    scale = analysis.estimates
    first = int(np.flatnonzero(analysis.samples.used)[0])
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
                found = law[name]
                taken[attribute] = Estimate(max(found.value, 0.0), found.u, found.unit)
    slopes = slopes[: len(taken)]
    measured = Joint(
        tuple(taken),
        np.array([each.value for each in taken.values()]),
        slopes @ _covariance(motion) @ slopes.T,
        tuple(each.unit for each in taken.values()),
    )
    values: dict[str, Any] = dict(taken)
    return replace(scene, **values), measured


def oscillation_of(analysis: Analysis) -> Oscillation:
    """Return the oscillation of a run; refuse a run without one."""
    if (motion := analysis.oscillation) is None:
        raise ProgramError(
            f"{analysis.why}: nothing to lay a prediction over", "name a run that oscillates", UNREADABLE
        )
    return motion


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
