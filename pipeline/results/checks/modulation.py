"""Modulation: amplitude and phase that go to and fro together, as two oscillations that beat slower than the record."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.select import Damping
from pipeline.motion.phase import PhaseFit
from pipeline.numerics.quantity import amount
from pipeline.oscillation.demodulate import Demodulated
from pipeline.results.checks.finding import Checked, Finding, Misfit
from pipeline.track import F8

__all__ = ["judge_modulation"]

C16 = NDArray[np.complex128]
BENT = 2.0  # chi-square for each degree of freedom that phases leave beside their own model
LEAST_WINDOWS = 16
GAIN = 60.0  # fall of chi-square by which two oscillations must beat a damping law and a bent phase
FITS = 2.0  # chi-square for each degree of freedom that they may leave
MOST_WINDOWS = 2000  # longer records hold beats that are no slower than they
ROUGH = 8  # evaluations from each start, before the best goes on
TURNS = (0.3, 0.7, 1.2)  # turns of the one against the other within the record, to start from


@dataclass(frozen=True, slots=True)
class _Two:
    """Two oscillations: how large the second is, m, how far apart they are, rad/s, and what they leave."""

    size: float
    apart: float
    chi2: float


def judge_modulation(demodulated: Demodulated, damping: Damping, phase: PhaseFit, unit: str) -> Checked:
    """Return whether a second oscillation explains what neither a damping law nor a bent phase does.

    Parameters
    ----------
    demodulated, damping, phase
        Outputs of the stages of those names.
    unit : str
        Of the amplitudes.

    Notes
    -----
    Looked for only where every law is rejected, or the phases leave twice their noise; and where windows do not jump
    from one to the next, which nothing that beats slowly makes them do (50 ms saved on the record of a disc that
    flutters). Fitted to the windows' complex amplitudes are a bob with linear and quadratic drag and a second
    oscillation of constant size B,
    :math:`A(t) e^{i(\\varphi + \\delta t)} + B e^{i\\Delta t}`. Where their beat is slower than the record the
    two share their amplitude: each is uncertain by B, the damping rate by :math:`B\\Delta/A`, the frequency by
    as much.
    """
    rejected = bool(damping.fits) and all(fit.rejected for fit in damping.fits.values())
    count = demodulated.t.size
    if not LEAST_WINDOWS <= count <= MOST_WINDOWS or not (rejected or phase.reduced_chi2 > BENT):
        return Checked()
    start = float(abs(damping.best.joint["A0"].value))
    u_size, u_phase = np.sqrt(demodulated.covariance[:, 0, 0]), np.sqrt(demodulated.covariance[:, 1, 1])
    slow = demodulated.phase - demodulated.angular_frequency * demodulated.t
    rough = 0.5 * (_roughness(demodulated.amplitude, u_size) + _roughness(slow, u_phase))
    if rough > FITS * (1.0 + 2.0 / math.sqrt(count)):  # its own scatter; whatever is smooth leaves as much
        return Checked()
    fallen = demodulated.amplitude - damping.best.amplitude(demodulated.t - damping.t0)
    turned = demodulated.phase - phase.total(demodulated.t)
    single = float(np.sum((fallen / u_size) ** 2) + np.sum((turned / u_phase) ** 2))
    found = _two_oscillations(demodulated, phase, start)
    free = 2 * count - 8
    if found.chi2 > FITS * free or single - found.chi2 < GAIN or not 0.0 < found.size < 0.5 * start:
        return Checked()
    omega, share = phase.angular_frequency.value, found.size / start
    hertz = abs(found.apart) / (2.0 * math.pi)
    return Checked(
        (
            Finding(
                "amplitude_modulated",
                "warning",
                f"amplitude and phase go to and fro as those of two oscillations {hertz:.2g} Hz apart, the second of "
                f"{amount(found.size, unit)} ({share:.1%}): a swing sideways, or a force with a period of its own, "
                f"beats with the bob every {1.0 / hertz:.3g} s. Amplitude, damping and period are uncertain by what "
                "it may add; record for longer than a beat, and see what else moves",
            ),
        ),
        (
            Misfit(
                name="modulation",
                amplitude_m=found.size,
                phase_rad=share,
                damping_rate=share * abs(found.apart),
                clock=share * abs(found.apart) / omega,
            ),
        ),
    )


def _roughness(values: F8, u: F8) -> float:
    """Mean square of third differences over their variance: 1 of noise about any smooth curve."""
    variance = u * u
    of_differences = variance[:-3] + 9.0 * variance[1:-2] + 9.0 * variance[2:-1] + variance[3:]
    return float(np.mean(np.diff(values, 3) ** 2 / of_differences))


def _two_oscillations(demodulated: Demodulated, phase: PhaseFit, start_m: float) -> _Two:
    """The fit that the best of several starts leads to."""
    from scipy.optimize import least_squares

    tau = demodulated.t - demodulated.t[0]
    seconds = float(tau[-1])
    angle = demodulated.phase - phase.angular_frequency.value * tau
    seen: C16 = demodulated.amplitude * np.exp(1j * (angle - angle[0])) / start_m
    u_radial = np.sqrt(demodulated.covariance[:, 0, 0]) / start_m
    u_across = np.sqrt(demodulated.covariance[:, 1, 1]) * np.abs(seen)
    turn = np.exp(-1j * np.angle(seen))

    def left(theta: F8) -> F8:
        first, gamma, beta, at, drift, x, y, apart = theta
        fall = -np.expm1(-gamma * tau) / gamma if abs(gamma) > 1e-9 else tau
        size = first * np.exp(-gamma * tau) / np.maximum(1.0 + beta * fall, 1e-6)
        model = size * np.exp(1j * (at + drift * tau)) + (x + 1j * y) * np.exp(1j * apart * tau)
        off = (model - seen) * turn
        return np.concatenate([off.real / u_radial, off.imag / u_across])

    rate = 1.0 / (8.0 * seconds)
    scale = [1.0, rate, rate, 1.0, rate, 0.05, 0.05, rate]
    starts = [
        np.array([1.0, rate, rate, 0.0, 0.0, 0.02, 0.02, sign * turns * 2.0 * math.pi / seconds])
        for turns in TURNS
        for sign in (1.0, -1.0)
    ]
    rough = [least_squares(left, start, x_scale=scale, max_nfev=ROUGH) for start in starts]
    fit = least_squares(left, min(rough, key=lambda one: float(one.cost)).x, x_scale=scale, max_nfev=100)
    return _Two(float(np.hypot(fit.x[5], fit.x[6])) * start_m, float(fit.x[7] - fit.x[4]), 2.0 * float(fit.cost))
