"""Halves: whether the first half of a record and the second say the same of its model."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.damping.select import Damping
from pipeline.motion.phase import PhaseFit
from pipeline.oscillation.demodulate import Demodulated
from pipeline.results.checks.finding import Finding
from pipeline.track import F8

__all__ = ["judge_halves"]

CONTRADICTION = 4.0  # standard uncertainties by which the halves differ where the model does not hold
LEAST_WINDOWS = 8  # of a half


def judge_halves(demodulated: Demodulated, damping: Damping, phase: PhaseFit, *, whole: bool) -> Iterator[Finding]:
    """Yield whether the halves of a record contradict each other.

    Parameters
    ----------
    demodulated, damping, phase
        Outputs of the stages of those names.
    whole : bool
        Whether the whole waveform was fitted already.

    Notes
    -----
    What the law leaves of the amplitudes and the model of the phases, over its standard uncertainty, is fitted by a
    straight line in each half: where the model holds, levels and slopes differ by no more than noise does.
    """
    count = demodulated.t.size
    if count < 2 * LEAST_WINDOWS:
        return
    fallen = demodulated.amplitude - damping.best.amplitude(demodulated.t - damping.t0)
    turned = demodulated.phase - phase.total(demodulated.t)
    u_phase = np.sqrt(demodulated.covariance[:, 1, 1])
    half = count // 2
    away = max(_apart(part[:half], part[-half:]) for part in (fallen / damping.scatter.u, turned / u_phase))
    if away > CONTRADICTION:
        yield Finding(
            "halves_differ",
            "info",
            f"the first half of the record and the second differ by {away:.2g} standard uncertainties from the one "
            "model of both: uncertainties are by what it leaves; analyse them with --from and --to"
            + ("" if whole else ", or try --accuracy best, which fits the whole waveform"),
        )


def _apart(first: F8, second: F8) -> float:
    """How far levels and slopes of two halves of equal length differ, whose points have the uncertainty 1."""
    n = first.size
    x = np.arange(n) - 0.5 * (n - 1)
    other = second - first
    level = abs(float(other.sum())) / math.sqrt(2.0 * n)
    slope = abs(float(x @ other)) / math.sqrt(2.0 * float(x @ x))
    return max(level, slope)
