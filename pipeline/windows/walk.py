"""Walk: whether amplitude and phase wander at random, as of a structure that wind or traffic shakes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_CURVE, OUTLIER, ROUNDS
from pipeline.windows.demodulate import Windows

# How far the innovations may differ from those of a resonance in noise: of 40 records of 30 s, of one to seven
# correlation times, 39 lie within, as measured by `python -m tests.trials.grades kinds --only ambient --seeds 40`.
TYPICAL, ISOTROPIC = (0.6, 1.35), 2.2
# Correlation of the innovations of neighbouring means of integrated white noise, as windows are: it follows from their
# variance of 2/3 and covariance of 1/6.
SMOOTH = 0.25
# Mean squared wander over the record, rad^2, from which the phase is no straight line. Without it, 3 of 80 oscillations
# that wander by less lose their damping rate, as measured with random walks of amplitude and phase.
LEAST_WANDER = 0.5


@dataclass(frozen=True, slots=True)
class Walk:
    """A resonance that noise drives."""

    angular_frequency: Estimate
    wander: float  # root mean square of the wander of the phase over the record, rad
    amplitude: float  # root mean square
    spread: float  # standard deviation of the amplitude


def walk_of(windows: Windows) -> Walk | None:
    """Return the walk of amplitude and phase if they wander at random; None if they do not.

    The phasors z of a resonance that white noise drives follow :math:`z_{j+1} = \\rho z_j + e_j`. Its frequency is
    the argument of :math:`\\sum\\bar z_j z_{j+1}` with the variance :math:`\\overline{|e|^2}/2\\sum|z|^2`. For a free
    oscillation e is noise of the samples, a jump for a touch, and turns evenly beside a second line. So e must be far
    above the noise of the windows, typical in size, as large along z as across it, uncorrelated with its neighbours,
    and keep the amplitude up.
    """
    t, n = windows.t, windows.t.size - 1
    if n < 3 * FEWEST_FOR_CURVE or float(np.ptp(np.diff(t))) > 0.5 * float(np.mean(np.diff(t))):
        return None
    z = windows.amplitude * np.exp(1j * (windows.phase - windows.angular_frequency * (t - t[0])))
    before, after = z[:-1], z[1:]
    power = float(np.vdot(before, before).real)
    rho = complex(np.vdot(before, after)) / power
    e = after - rho * before
    along = e * np.exp(-1j * np.angle(before))
    squares, noise = np.abs(e) ** 2, windows.covariance[:, 0, 0] + windows.amplitude**2 * windows.covariance[:, 1, 1]
    mean = float(squares.mean())
    wander = 0.5 * n**2 * mean / power
    typical = float(np.median(squares)) / (math.log(2.0) * mean)
    ratio = float(np.mean(along.real**2) / max(float(np.mean(along.imag**2)), 1e-300))
    lag = complex(np.vdot(e[:-1], e[1:])) / max(n * mean, 1e-300)
    kept_up = n * mean / power / max(1.0 - abs(rho) ** 2, 1e-300)
    at_random = (
        abs(rho) > math.exp(-1.0 / ROUNDS)
        and mean > OUTLIER**2 * float(np.mean(noise)) * (1.0 + abs(rho) ** 2)
        and wander > LEAST_WANDER
        and TYPICAL[0] < typical < TYPICAL[1]
        and 1.0 / ISOTROPIC < ratio < ISOTROPIC
        and abs(lag) < SMOOTH + 2.0 / math.sqrt(n)
        and (kept_up > TYPICAL[0] or abs(rho) >= 1.0)
    )
    if not at_random:
        return None
    step_s = float(np.mean(np.diff(t)))
    omega = windows.angular_frequency + math.atan2(rho.imag, rho.real) / step_s
    u = math.sqrt(mean / (2.0 * power) * (1.0 + 2.0 * max(lag.real, 0.0))) / step_s
    size = np.abs(windows.amplitude)
    return Walk(Estimate(omega, u, "rad/s"), math.sqrt(wander), math.sqrt(power / n), float(np.std(size)))
