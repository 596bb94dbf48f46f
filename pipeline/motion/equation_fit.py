"""Equation fit: fits of the equation of motion with every drag law to all samples of a strongly damped oscillation.

Amplitude laws are averages over a cycle and correct to first order in the damping ratio. If drag or friction takes a
hundredth of the amplitude per radian, or friction ends the motion within the record, an average over a cycle is no
longer sufficient, and the equation itself is fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipeline.damping.law_fit import mean_squared_rate
from pipeline.damping.laws.drag import COEFFICIENTS, DRAGS, Drag
from pipeline.damping.select import Damping
from pipeline.motion.equation_model import STATE, envelope
from pipeline.motion.equation_search import (
    Cleaned,
    Samples,
    choose_law,
    first_solution,
    full,
    samples_of,
    without_echoes,
)
from pipeline.motion.phase import PhaseFit, wrapped
from pipeline.motion.waveform import Rest, Waveform
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.quantity import amount
from pipeline.samples.condition import Conditioned
from pipeline.samples.stopping import stop_row
from pipeline.track import F8, U8, Quality
from pipeline.windows.demodulate import Demodulated

STATE_UNITS = ("m", "m", "m/s", "rad/s")
MOST_PERIODS = 250  # maximum number of periods for the fit of a weakly damped motion that stops within the record
# Damping ratio :math:`-\\dot A/A\\omega` at the first sample above which the equation of motion is fitted.
LEAST_DAMPING = 0.01
# Damping ratio above which it is fitted even if the windows, which are then few, show linear drag or none.
ALWAYS = 0.05
# Maximum root mean square of the residual of the law with most parameters, in units of the record's noise.
MISFIT = 1.25
# Samples whose residuals exceed this many standard deviations are false echoes and are excluded from the fit.
CLIP_SIGMAS = 4.0


@dataclass(frozen=True, slots=True)
class EquationMisfit:
    """The reason why the equation of motion was not fitted, or why its fit was rejected.

    Parameters
    ----------
    why : str
        The reason, worded for a finding.
    """

    why: str


@dataclass(frozen=True, slots=True, eq=False)
class EquationFit:
    """A strongly damped oscillation as a solution of its equation of motion.

    Parameters
    ----------
    why : str
        One sentence that states the strength of the damping and what was fitted.
    damping : Damping
        The coefficients of every law as fitted to the samples; A0 is the amplitude at the first sample
        (:func:`pipeline.motion.equation_model.envelope`).
    state : Joint
        Rest position, displacement and velocity at the first sample, and the undamped angular frequency, from the fit
        of the selected law.
    waveform : Waveform
    flags : (n,) uint8
        The final flags.
    """

    why: str
    damping: Damping
    state: Joint
    waveform: Waveform
    flags: U8

    def squared_rate(self, t: F8) -> float:
        """Return the mean decrease of the squared angular frequency by drag, 1/s^2, over times t (n,) in s."""
        best = self.damping.best
        return mean_squared_rate(best, best.amplitude(t - self.damping.t0), np.ones(t.size))

    def phase(self, demodulated: Demodulated) -> PhaseFit:
        """Return the oscillation's frequency and phase in the form that the later stages use.

        Notes
        -----
        The squared frequency is that of the undamped :math:`\\omega_0` minus the mean decrease by drag over the whole
        time (:func:`pipeline.damping.law_fit.mean_squared_rate`). To second order it is the frequency that a line
        through the turning points gives.
        """
        t, (_, y, v, natural) = demodulated.t, self.state.values.tolist()
        squared_rate = self.squared_rate(t)
        omega = math.sqrt(natural**2 - squared_rate)
        slope = np.array([0.0, v * natural, -y * natural, y * v]) / (v**2 + (y * natural) ** 2)
        u_phase = math.sqrt(float(slope @ self.state.covariance @ slope))
        coefficients = self.damping.best.joint.estimates()
        mu, gamma, beta = (coefficients[n].value if n in coefficients else 0.0 for n in COEFFICIENTS)
        _, start, _ = envelope(y, v, natural, mu, gamma, beta)
        middle = float(np.mean(t))
        # The total phase continues the windows' count of whole turns.
        turns = round((float(demodulated.phase[0]) - start - omega * float(t[0] - self.damping.t0)) / (2.0 * math.pi))
        centre = start + 2.0 * math.pi * turns + omega * (middle - self.damping.t0)
        return PhaseFit(
            self.damping.t0,
            Estimate(omega, self.state["angular_frequency"].u * natural / omega, "rad/s"),
            Estimate(wrapped(start), u_phase, "rad"),
            None,
            self.damping.best.reduced_chi2,
            self.damping.scatter.correlation,
            demodulated.phase - centre - omega * (t - middle),
            np.array([centre, omega]),
            middle,
            self.damping,
            squared_rate=squared_rate,
        )

    def windows(self, demodulated: Demodulated) -> Demodulated:
        """Return the windows with the residuals of the solution, as sinusoids in windows fail where the bob stops."""
        noise = np.full(demodulated.noise.shape, self.waveform.rms_m)
        return replace(demodulated, flags=self.flags, residual=self.waveform.residual, noise=noise)

    def rest(self, demodulated: Demodulated) -> Rest:
        """Return the constant rest position of the record; the place where friction holds the bob may differ."""
        rest = self.state["rest"]
        return Rest(rest, 0.0, False, demodulated.t, np.full(demodulated.t.size, rest.value))


def fit_equation(
    conditioned: Conditioned,
    demodulated: Demodulated,
    damping: Damping,
    *,
    stopped: bool = False,
) -> EquationFit | EquationMisfit | None:
    """Fit the equation of motion if the damping requires it.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated : Demodulated
    damping : Damping
        The fits of the amplitude laws, from which the fits here start.
    stopped : bool
        Whether the bob stops within the record, as found by :func:`pipeline.samples.stopping.moving_part`.

    Returns
    -------
    EquationFit, EquationMisfit or None
        None if damping is weak, if no law with damping can be fitted, or if linear drag or no damping is selected, for
        which the amplitude law is exact.

    Notes
    -----
    The equation of motion is
    :math:`\\ddot y = -\\omega_0^2 y - 2\\gamma\\dot y - b|\\dot y|\\dot y - f\\,\\mathrm{sign}(\\dot y)`.
    The parameters are the rest position, displacement and velocity at the first sample, :math:`\\omega_0`, and the
    coefficients as defined for the amplitude laws, :math:`\\gamma`, :math:`\\beta = 4\\omega_0 b/3\\pi` and
    :math:`\\mu = 2f/\\pi\\omega_0`. The equation is solved by Strang splitting with located turning points
    (:mod:`pipeline.dynamics.strang`) and fitted by :mod:`pipeline.numerics.least_squares`.

    The law with most parameters is fitted first: its residual shows the false echoes and the noise. The other laws are
    compared with this noise and selected by the same rules as the amplitude laws.
    """
    ratio = damping.best.rate_at_start() / demodulated.angular_frequency
    drags, unit = _fittable(damping), conditioned.track.unit
    if not drags or not _required(damping, demodulated, ratio, stopped=stopped):
        return None
    periods = demodulated.angular_frequency / (2.0 * math.pi) * float(np.ptp(demodulated.t))
    if ratio <= LEAST_DAMPING and periods > MOST_PERIODS:
        return EquationMisfit(
            f"the bob stops within the record, and whether friction stopped it was not settled: over {periods:.0f} "
            f"periods the equation of motion takes too long to solve (at most {MOST_PERIODS}); the averaged "
            "law stands"
        )
    samples = samples_of(conditioned, demodulated, damping, stop_row(conditioned))
    start, richest = first_solution(samples, demodulated, damping, drags, MISFIT), drags[-1]
    cleaned = without_echoes(samples, richest, start, CLIP_SIGMAS)
    if cleaned is None:
        return EquationMisfit(
            f"the damping ratio is {ratio:.2g} at the start, where laws of the amplitude err, and no motion with "
            f"{richest.words} comes near the samples: the averaged law stands"
        )
    if not cleaned.noise_m <= MISFIT * samples.expected_m:
        return EquationMisfit(
            f"the damping ratio is {ratio:.2g} at the start, where laws of the amplitude err, and the equation of "
            f"motion with {richest.words} leaves {amount(cleaned.noise_m, unit)} where samples scatter by "
            f"{amount(samples.expected_m, unit)}: the averaged law stands"
        )
    chosen = choose_law(samples, cleaned, damping, drags)
    if chosen is None:
        return EquationMisfit(f"the damping ratio is {ratio:.2g} at the start, and no fit of the equation converged")
    law = next(drag for drag in drags if drag.name == chosen[0].selected)
    found = _described(samples, cleaned, law, *chosen)
    if found.damping.best.rate_at_start() < 0.0:
        return EquationMisfit(
            f"the bob stops within the record, but the equation of motion with {law.words} "
            "would let it swing up: no damping ended this motion, and the averaged law stands"
        )
    if not found.squared_rate(demodulated.t) < found.state["angular_frequency"].value ** 2:
        return EquationMisfit(f"{found.why}; so strong a damping leaves no oscillation whose frequency could be given")
    return found


def _fittable(damping: Damping) -> list[Drag]:
    """Return the laws to be fitted that have an equation of motion with damping, in order of parameter count."""
    wanted = [law for law in DRAGS if law.powers and (law.name in damping.fits or law.name in damping.unfitted)]
    return sorted(wanted, key=lambda law: len(law.powers))


def _required(damping: Damping, demodulated: Demodulated, ratio: float, *, stopped: bool) -> bool:
    if stopped or ratio > ALWAYS:
        return True
    best = damping.best.law
    if isinstance(best, Drag) and set(best.powers) <= {1}:
        return False  # for these laws the amplitude law is exact
    last = damping.best.amplitude(np.array([float(np.max(demodulated.t)) - damping.t0]))
    return ratio > LEAST_DAMPING or bool(last[0] <= 0.0)


def _described(samples: Samples, cleaned: Cleaned, law: Drag, damping: Damping, fit: least_squares.Fit) -> EquationFit:
    """Return the result at every sample."""
    conditioned, every, theta = samples.conditioned, samples.model(), full(law, fit.values)
    position, velocity = every.position(theta), every.velocity(theta)
    residual = conditioned.track.y - position
    rms = math.sqrt(float(np.mean(residual[cleaned.used] ** 2)))
    flags = conditioned.flags.copy()
    flags[samples.within & ~cleaned.used] |= np.uint8(Quality.FALSE_ECHO)
    count = len(STATE)
    state = Joint(STATE, fit.values[:count], fit.covariance[:count, :count] * cleaned.correlation, STATE_UNITS)
    ratio = damping.best.rate_at_start() / state["angular_frequency"].value
    stops = damping.best.amplitude(np.array([np.max(samples.elapsed)]))[0] <= 0.0
    why = (
        f"the damping ratio is {ratio:.2g} at the first sample"
        + (" and friction ends the motion within the record" if stops else "")
        + f": the equation of motion with {law.words} was fitted to the samples; it leaves "
        + amount(rms, conditioned.track.unit)
    )
    return EquationFit(why, damping, state, Waveform(position, partial(np.asarray, velocity), residual, rms), flags)
