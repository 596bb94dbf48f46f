"""Halves: whether the first half of a record and the second say the same of its model."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.damping.average import average_over_laws
from pipeline.motion.kinds import Fitted
from pipeline.numerics.quantity import amount
from pipeline.results.checks.finding import Checked, Finding, Misfit
from pipeline.track import F8

__all__ = ["judge_halves"]

CONTRADICTION = 4.0  # standard uncertainties by which the halves differ where the model does not hold
LEAST_WINDOWS = 8  # of a half


def judge_halves(fitted: Fitted, unit: str, fit_whole: Callable[[], Fitted] | None) -> Checked:
    """Return whether the halves of a record contradict each other, and what the estimates are uncertain by then.

    Parameters
    ----------
    fitted : Fitted
    unit : str
        Of the amplitudes.
    fit_whole : callable or None
        Fits the whole waveform; None where that is done, or too much.

    Notes
    -----
    What the law leaves of the amplitudes and the model of the phases, over its standard uncertainty, is fitted by a
    straight line in each half: where the model holds, levels and slopes differ by no more than noise does. Where it
    does not, windows and waveform weigh its failure differently, and nothing says which of them is right: the
    waveform is fitted too, the windows' values stand, and what it differs by is a standard uncertainty of each.
    """
    demodulated, damping, phase = fitted.demodulated, fitted.damping, fitted.phase
    if demodulated.t.size < 2 * LEAST_WINDOWS:
        return Checked()
    fallen = demodulated.amplitude - damping.best.amplitude(demodulated.t - damping.t0)
    turned = demodulated.phase - phase.total(demodulated.t)
    u_phase = np.sqrt(demodulated.covariance[:, 1, 1])
    half = demodulated.t.size // 2
    away = max(_apart(part[:half], part[-half:]) for part in (fallen / damping.scatter.u, turned / u_phase))
    if away <= CONTRADICTION:
        return Checked()
    words = (
        f"the first half of the record and the second differ by {away:.2g} standard uncertainties from the one model "
        "of both: uncertainties are by what it leaves; analyse them with --from and --to"
    )
    whole = None if fit_whole is None else fit_whole()
    if whole is None or whole.full is None or not whole.full.converged:
        return Checked((Finding("halves_differ", "info", words),))
    omega = phase.angular_frequency.value
    size, rate = (other - own for own, other in zip(_at_start(fitted), _at_start(whole), strict=True))
    misfit = Misfit(
        name="choice_of_fit",
        amplitude_m=abs(size),
        offset_m=abs(whole.rest.mean.value - fitted.rest.mean.value),
        phase_rad=abs(math.remainder(whole.phase.phase.value - phase.phase.value, 2.0 * math.pi)),
        damping_rate=abs(rate),
        clock=abs(whole.phase.angular_frequency.value / omega - 1.0),
    )
    more = (
        "; so the whole waveform was fitted too, as --accuracy best does: its amplitude is "
        f"{amount(size, unit, '+.2g')} and its damping rate {rate:+.2g} 1/s off, and the uncertainties hold both"
    )
    return Checked((Finding("halves_differ", "info", words + more),), (misfit,))


def _at_start(fitted: Fitted) -> tuple[float, float]:
    """Amplitude, m, and damping rate, 1/s, at the start, as they are stated: by all laws that weigh."""
    laws = average_over_laws(fitted.damping, math.sqrt(float(np.mean(fitted.demodulated.amplitude**2))))
    return (
        sum(one.weight * float(one.fit.joint.values[0]) for one in laws),
        sum(one.weight * one.fit.rate_at_start() for one in laws),
    )


def _apart(first: F8, second: F8) -> float:
    """How far levels and slopes of two halves of equal length differ, whose points have the uncertainty 1."""
    n = first.size
    x = np.arange(n) - 0.5 * (n - 1)
    other = second - first
    level = abs(float(other.sum())) / math.sqrt(2.0 * n)
    slope = abs(float(x @ other)) / math.sqrt(2.0 * float(x @ x))
    return max(level, slope)
