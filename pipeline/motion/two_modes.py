"""Two modes of similar strength: a motion that consists of two oscillations, both of which can be measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.motion.lines import WEAKER, Scaled
from pipeline.notice import Refusal
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.levels import FEWEST_FOR_MEDIAN, NEGLIGIBLE
from pipeline.samples.condition import Samples
from pipeline.track import F8, U8

# Minimum number of beats in the record; with fewer, two modes cannot be distinguished from one that changes:
BEATS = 0.8  # those of tests/properties/test_no_oscillation.py at a ratio of 1.02 beat less than once


@dataclass(frozen=True, slots=True, eq=False)
class TwoModes:
    """Two oscillations, the stronger ("first") and the other one, neither of which is the main one."""

    # The rest position, then the cosine and sine amplitudes at ``start_s``, angular frequency and decay rate of each
    # mode, in the record's times and values.
    joint: Joint
    dof: float  # number of independent samples less that of the parameters
    noise: Estimate  # of one sample
    start_s: float
    residual: F8  # (n,)
    flags: U8  # (n,)


MODE_PARAMETERS = (
    "rest",
    *(f"{mode}_{name}" for mode in ("first", "second") for name in ("cosine", "sine", "omega", "decay")),
)


def find_two_modes(samples: Samples) -> TwoModes | Refusal:
    """Return the two modes that a record consists of, or refuse them if they do not describe it.

    :math:`o + \\sum_i e^{-g_i t}(a_i\\cos\\omega_i t + b_i\\sin\\omega_i t)` is fitted to all samples used, started
    from the strongest line of the spectrum and the strongest line of the residual of the first. Covariances are scaled
    by the residuals, including their correlation.
    """
    if (record := Scaled.of(samples)) is None:
        return Refusal("no_two_modes")
    first = record.strongest(record.values)
    second = record.strongest(record.less(record.linear((first, 0.0))))
    lines = record.fitted(record.linear((first, 0.0), (second, 0.0)))
    if lines is None or not lines.left < NEGLIGIBLE:
        return Refusal("no_two_modes")
    strong, weak = np.argsort(-lines.sizes).tolist()
    omegas, sizes = lines.omegas, lines.sizes
    beats = abs(omegas[0] - omegas[1]) * record.seconds / (2.0 * math.pi)
    slow, fast = float(np.min(omegas)), float(np.max(omegas))
    few = slow * record.seconds < 2.0 * math.pi * FEWEST_FOR_MEDIAN or beats < BEATS
    if few or sizes[weak] < WEAKER * sizes[strong]:
        return Refusal("no_two_modes")
    # A component at a multiple of the slower frequency is not a second mode but a harmonic, as of a square wave.
    if round(fast / slow) > 1 and abs(fast - round(fast / slow) * slow) * record.seconds < math.pi:
        return Refusal("no_two_modes")
    order = [0, *(k for i in (strong, weak) for k in range(1 + 4 * i, 5 + 4 * i))]
    # Back to the unit of the record; the rest position was measured from the mean.
    scale, unit = record.scale, samples.track.unit
    turn = np.array([scale, *(2 * (scale, scale, 1.0, 1.0))])
    level = np.array([record.level, *(8 * (0.0,))])
    units = (unit, *(2 * (unit, unit, "rad/s", "1/s")))
    covariance = lines.covariance[np.ix_(order, order)] * np.outer(turn, turn)
    joint = Joint(MODE_PARAMETERS, lines.values[order] * turn + level, covariance, units)
    residual = np.full(len(samples.track), np.nan)
    residual[record.used] = scale * lines.residual
    return TwoModes(joint, lines.dof, samples.noise_estimate, record.start_s, residual, samples.flags)
