"""The equation of motion: strongly damped oscillations by their equation of motion, law by law, through every sample.

Amplitude laws are averages over a cycle, right to first order of the damping ratio. Where drag or friction takes a
hundredth of the amplitude in a radian, or friction ends the motion within the record, an average over a cycle no longer
says enough, and the equation itself is fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipeline.damping.law_fit import mean_squared_rate
from pipeline.damping.laws.drag import DRAGS, Drag
from pipeline.damping.select import Damping
from pipeline.damping.select import Params as DampingParams
from pipeline.motion.equation_model import COEFFICIENTS, STATE, envelope
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

__all__ = ["EquationFit", "EquationMisfit", "Params", "fit_equation"]

STATE_UNITS = ("m", "m", "m/s", "rad/s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`fit_equation`.

    Parameters
    ----------
    least_damping : float
        Damping ratio :math:`-\\dot A/A\\omega` at the first sample from which the equation of motion is fitted.
    always : float
        Damping ratio from which it is fitted even where the windows, then few, show linear drag or none.
    misfit : float
        Greatest root mean square of what the richest law leaves, in units of the record's noise.
    clip_sigmas : float
        Residuals beyond this many standard deviations are false echoes and leave the fit.
    most_periods : int
        Over more of them it is not fitted where damping is weak, though the bob stops.
    """

    most_periods: int = 250
    least_damping: float = 0.01
    always: float = 0.05
    misfit: float = 1.25
    clip_sigmas: float = 4.0


@dataclass(frozen=True, slots=True)
class EquationMisfit:
    """Why no solution of the equation of motion describes a strongly damped record.

    Parameters
    ----------
    why : str
    """

    why: str


@dataclass(frozen=True, slots=True, eq=False)
class EquationFit:
    """A strongly damped oscillation as a solution of its equation of motion.

    Parameters
    ----------
    why : str
        One sentence: how strong the damping is, and what was fitted.
    damping : Damping
        Every law's coefficients from the samples; A0 is the amplitude at the first of them
        (:func:`pipeline.motion.equation_model.envelope`).
    state : Joint
        Rest position, displacement and velocity at the first sample, and the undamped angular frequency, as the
        selected law has them.
    waveform : Waveform
    flags : (n,) uint8
    """

    why: str
    damping: Damping
    state: Joint
    waveform: Waveform
    flags: U8

    def squared_rate(self, t: F8) -> float:
        """Return the mean by which drag lowers the square of the angular frequency over times t (n,), s, 1/s^2."""
        best = self.damping.best
        return mean_squared_rate(best, best.amplitude(t - self.damping.t0), np.ones(t.size))

    def phase(self, demodulated: Demodulated) -> PhaseFit:
        """Return the oscillation's frequency and phase as the stages after it take them.

        Notes
        -----
        The square of the frequency is that of the undamped :math:`\\omega_0` less the mean of what drag takes over the
        whole time, see :func:`pipeline.damping.law_fit.mean_squared_rate`: what a line through the turning points
        shows, to second order.
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
        # The total phase goes on from the windows' own count of turns.
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
        """Return the windows with the residuals of the solution: a sinusoid per window fails where the bob stops."""
        noise = np.full(demodulated.noise.shape, self.waveform.rms_m)
        return replace(demodulated, flags=self.flags, residual=self.waveform.residual, noise=noise)

    def rest(self, demodulated: Demodulated) -> Rest:
        """Return the rest position, one for the whole record: where friction holds the bob is another."""
        rest = self.state["rest"]
        return Rest(rest, 0.0, False, demodulated.t, np.full(demodulated.t.size, rest.value))


def fit_equation(
    conditioned: Conditioned,
    demodulated: Demodulated,
    damping: Damping,
    params: Params | None = None,
    laws: DampingParams | None = None,
    *,
    stopped: bool = False,
) -> EquationFit | EquationMisfit | None:
    """Fit the equation of motion where the damping requires it.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated : Demodulated
    damping : Damping
        The laws of the amplitude, from which the fits start.
    params : Params, optional
    laws : pipeline.damping.select.Params, optional
        For the choice among the laws.
    stopped : bool
        Whether the bob was seen to stop within the record, as :func:`moving_part` finds.

    Returns
    -------
    EquationFit, EquationMisfit or None
        None where damping is weak or no law but none and linear drag is at hand, for which the amplitude's law is
        exact.

    Notes
    -----
    Of :math:`\\ddot y = -\\omega_0^2 y - 2\\gamma\\dot y - b|\\dot y|\\dot y - f\\,\\mathrm{sign}(\\dot y)` the
    parameters are the rest position, displacement and velocity at the first sample, :math:`\\omega_0`, and the
    coefficients in the convention of the amplitude, :math:`\\beta = 4\\omega_0 b/3\\pi` and
    :math:`\\mu = 2f/\\pi\\omega_0`. Solutions come from Strang splitting with located turning points
    (:mod:`pipeline.dynamics.strang`), the least squares from :mod:`pipeline.numerics.least_squares`.

    The richest law goes first: what it leaves shows false echoes and the noise. The others are held to that noise,
    and chosen among as the amplitude's laws are.
    """
    params, laws = params or Params(), laws or DampingParams()
    ratio = damping.best.rate_at_start() / demodulated.angular_frequency
    drags, unit = _fittable(damping), conditioned.track.unit
    if not drags or not _required(damping, demodulated, ratio, params, stopped=stopped):
        return None
    periods = demodulated.angular_frequency / (2.0 * math.pi) * float(np.ptp(demodulated.t))
    if ratio <= params.least_damping and periods > params.most_periods:
        return EquationMisfit(
            f"the bob stops within the record, and whether friction stopped it was not settled: over {periods:.0f} "
            f"periods the equation of motion takes too long to solve (at most {params.most_periods}); the averaged "
            "law stands"
        )
    samples = samples_of(conditioned, demodulated, damping, stop_row(conditioned))
    start, richest = first_solution(samples, demodulated, damping, drags, params.misfit), drags[-1]
    cleaned = without_echoes(samples, richest, start, params.clip_sigmas)
    if cleaned is None:
        return EquationMisfit(
            f"the damping ratio is {ratio:.2g} at the start, where laws of the amplitude err, and no motion with "
            f"{richest.words} comes near the samples: the averaged law stands"
        )
    if not cleaned.noise_m <= params.misfit * samples.expected_m:
        return EquationMisfit(
            f"the damping ratio is {ratio:.2g} at the start, where laws of the amplitude err, and the equation of "
            f"motion with {richest.words} leaves {amount(cleaned.noise_m, unit)} where samples scatter by "
            f"{amount(samples.expected_m, unit)}: the averaged law stands"
        )
    chosen = choose_law(samples, cleaned, damping, drags, laws)
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
    """The laws to be fitted that have an equation of motion with damping, the richest last."""
    wanted = [law for law in DRAGS if law.powers and (law.name in damping.fits or law.name in damping.unfitted)]
    return sorted(wanted, key=lambda law: len(law.powers))


def _required(damping: Damping, demodulated: Demodulated, ratio: float, params: Params, *, stopped: bool) -> bool:
    if stopped or ratio > params.always:
        return True
    best = damping.best.law
    if isinstance(best, Drag) and set(best.powers) <= {1}:
        return False  # the amplitude's law is exact
    last = damping.best.amplitude(np.array([float(np.max(demodulated.t)) - damping.t0]))
    return ratio > params.least_damping or bool(last[0] <= 0.0)


def _described(samples: Samples, cleaned: Cleaned, law: Drag, damping: Damping, fit: least_squares.Fit) -> EquationFit:
    """Return the result at every sample."""
    conditioned, every, theta = samples.conditioned, samples.model(), full(law, fit.values)
    position, velocity = every.position(theta), every.velocity(theta)
    residual = conditioned.track.y - position
    rms = math.sqrt(float(np.mean(residual[cleaned.used] ** 2)))
    flags = conditioned.flags.copy()
    dropped = samples.within & ~cleaned.used
    plateau = dropped & conditioned.near_plateau(position, cleaned.noise_m)
    flags[plateau] |= np.uint8(Quality.CLIPPED)
    flags[dropped & ~plateau] |= np.uint8(Quality.FALSE_ECHO)
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
