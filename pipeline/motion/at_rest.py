"""A recording without a motion to fit: its mean and its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.motion.fitted import ClosedMotion
from pipeline.notice import Refusal
from pipeline.numerics.estimate import Joint
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import COARSE, Samples, coarsest_step


@dataclass(frozen=True, slots=True, eq=False)
class Rest(ClosedMotion):
    """A bob at rest, or a recording whose motion is none that can be fitted."""

    why: Refusal


def rest_of(samples: Samples, why: Refusal) -> Rest:
    """Return mean and noise of the samples used.

    The uncertainty of the mean includes the correlation of neighbours, as of a distance that steps or creeps.
    """
    used = samples.used
    y, unit, noise = samples.track.y[used], samples.track.unit, samples.noise_estimate
    if not y.size:
        raise AnalysisError("no usable sample is left", "see the counts of flagged samples")
    mean, independent = float(np.mean(y)), y.size / correlation_length(y)
    u = float(np.std(y)) / math.sqrt(independent)
    # A sensor with coarse steps gives nearly all distances alike at rest; the few others were flagged as false echoes.
    every = samples.track.y[np.isfinite(samples.track.y)]
    if (quantum := coarsest_step(np.sort(every), samples.quantum) or 0.0) > COARSE * noise.value:
        u = math.hypot(u, quantum / math.sqrt(12.0))  # rounding error, which noise does not average out
    first_s = float(samples.track.t[used][0])
    joint = Joint(("rest",), np.array([mean]), np.array([[u**2]]), (unit,))
    return Rest(
        joint=joint,
        dof=max(independent - 1.0, 1.0),
        noise=noise,
        start_s=first_s,
        residual=samples.track.y - mean,
        flags=samples.flags,
        why=why,
    )
