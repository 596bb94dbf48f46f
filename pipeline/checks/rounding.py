"""Rounding to steps that are larger than the noise: what it adds to the uncertainties of a run."""

from __future__ import annotations

import math

import numpy as np

from pipeline.checks.residual import Misfit
from pipeline.motion.fitted import Oscillation
from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.samples.condition import Samples
from pipeline.windows.rounding import rounding_errors


def rounding(samples: Samples, fitted: Oscillation) -> Misfit | None:
    """Return what rounding adds to the uncertainties; None if it is negligible.

    The rest position lies at the same place between two steps in all windows, so the errors of their amplitudes are one
    function of the amplitude, and a least-squares fit of the law makes of them errors of its parameters. A law with one
    coefficient follows them less than one with two, which may be the true one; the larger errors count.
    """
    damping, windows = fitted.damping, fitted.windows
    elapsed, best = windows.t - damping.t0, damping.best
    errors = rounding_errors(best.amplitude(elapsed), samples.quantum, windows.noise)
    if float(np.max(np.abs(errors))) <= NEGLIGIBLE * best.joint["A0"].u:
        return None
    u_amplitude, u_rate = 0.0, 0.0
    for fit in (best, damping.of_powers(1, 2) or best):
        _, by = fit.law.curve(elapsed, fit.joint.values)
        if not np.isfinite(by).all():  # the law is infinite within the record, and no result is an average over it
            continue
        moved = np.linalg.lstsq(by, errors, rcond=None)[0]  # half of the errors of the amplitude
        u_amplitude = max(u_amplitude, float(abs(moved[0])))
        u_rate = max(u_rate, float(abs(fit.slopes_of_rate() @ moved)))
    if u_amplitude <= NEGLIGIBLE * best.joint["A0"].u and u_rate <= NEGLIGIBLE * best.damping_rate().u:
        return None
    # The windows' uncertainties include it too: only what exceeds that of their mean is added.
    u_rest = math.sqrt(max(0.25 * float(abs(errors.mean())) ** 2 - fitted.rest.mean.u**2, 0.0))
    return Misfit("rounding", {"amplitude": u_amplitude, "offset": u_rest, "damping_rate": u_rate})
