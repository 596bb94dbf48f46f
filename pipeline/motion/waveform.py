"""Waveform: the record as rest position, damping law and phase predict it, and the residual."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.motion.phase import PhaseFit
from pipeline.motion.rest import Rest
from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.disturbances import Disturbances
from pipeline.track import F8, UNUSABLE, Track

__all__ = ["Waveform", "reconstruct"]


@dataclass(frozen=True, slots=True, eq=False)
class Waveform:
    """The fitted motion at every sample.

    Parameters
    ----------
    position : (n,) float64, m
        Rest position + A(t) cos(phase(t)).
    velocity : (n,) float64, m/s
        Its derivative.
    residual : (n,) float64, m
        Distance less position; NaN where unmeasured.
    rms_m : float
        Root mean square of the residual over the samples used, m.
    """

    position: F8
    velocity: F8
    residual: F8
    rms_m: float

    def with_disturbances(self, disturbances: Disturbances) -> Waveform:
        """Return the waveform of the whole record, from that of the record without its disturbances."""
        return replace(self, position=self.position + disturbances.position) if disturbances else self


def reconstruct(track: Track, demodulated: Demodulated, phase: PhaseFit, rest: Rest) -> Waveform:
    """Put rest position, amplitude and phase together again.

    Parameters
    ----------
    track : Track
    demodulated : Demodulated
        For its flags.
    phase : PhaseFit
        Carries the damping law.
    rest : Rest

    Returns
    -------
    Waveform
        Its residual holds noise and everything that the model leaves out; compare ``rms_m`` with the noise.
    """
    law = phase.damping.best
    used = (demodulated.flags & UNUSABLE) == 0
    # A law holds where it was fitted: before and after the samples used its last values stand.
    elapsed = np.clip(track.t, phase.t0, float(np.max(track.t[used]))) - phase.t0
    amplitude = law.amplitude(elapsed)
    angle = phase.total(track.t)
    cosine, sine = np.cos(angle), np.sin(angle)
    position = rest.at(track.t) + amplitude * cosine
    velocity = -law.law.rate(amplitude, law.joint.values) * cosine - amplitude * phase.rate(track.t) * sine
    residual = track.y - position
    return Waveform(position, velocity, residual, float(np.sqrt(np.mean(residual[used] ** 2))))
