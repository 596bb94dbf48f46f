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

from pipeline.damping.laws import LAWS, Drag
from pipeline.damping.select import Damping
from pipeline.damping.select import Params as DampingParams
from pipeline.motion.equation_model import COEFFICIENTS, STATE, envelope
from pipeline.motion.equation_search import Search
from pipeline.motion.phase import PhaseFit, wrapped
from pipeline.motion.waveform import Rest, Waveform
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.quantity import amount
from pipeline.numerics.robust import median
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, U8, Quality

__all__ = ["EquationFit", "EquationMisfit", "Params", "fit_equation", "moving_part"]

STATE_UNITS = ("m", "m", "m/s", "rad/s")
BLOCK = 25  # samples over which a bob is seen to move or not


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

    def phase(self, demodulated: Demodulated) -> PhaseFit:
        """Return the oscillation's frequency and phase as the stages after it take them.

        Notes
        -----
        Of the undamped :math:`\\omega_0` the frequency is :math:`\\sqrt{\\omega_0^2 - \\overline{\\lambda^2}}` with
        the mean of :math:`(\\dot A/A)^2`: what a line through the phases shows, to second order.
        """
        t, (_, y, v, natural) = demodulated.t, self.state.values.tolist()
        omega = math.sqrt(natural**2 - self.damping.squared_rate(t))
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
        )

    def windows(self, demodulated: Demodulated) -> Demodulated:
        """Return the windows with what the solution leaves: a sinusoid of their own fails where the bob stops."""
        noise = np.full(demodulated.noise.shape, self.waveform.rms_m)
        return replace(demodulated, flags=self.flags, residual=self.waveform.residual, noise=noise)

    def rest(self, demodulated: Demodulated) -> Rest:
        """Return the rest position, one for the whole record: where friction holds the bob is another."""
        rest = self.state["rest"]
        return Rest(rest, 0.0, False, demodulated.t, np.full(demodulated.t.size, rest.value))


def moving_part(conditioned: Conditioned, share: float) -> Conditioned | None:
    """Return the record up to where its bob stops for good; None where it moves for a share of the record, or never.

    A bob that friction stops early leaves a record in whose spectrum the oscillation drowns.
    """
    if (stop := _stop_row(conditioned)) is None:
        return None
    rows = np.flatnonzero(conditioned.used)
    if not np.count_nonzero(rows < stop) < share * rows.size:
        return None
    track = conditioned.track
    cut = replace(track, t=track.t[:stop], y=track.y[:stop], flags=track.flags[:stop], velocity=None)
    return replace(conditioned, track=cut, flags=conditioned.flags[:stop])


def _stop_row(conditioned: Conditioned) -> int | None:
    """Index of the sample by which the bob has stopped for good; None where it moves to the end, or never."""
    rows = np.flatnonzero(conditioned.used)
    count = rows.size // BLOCK
    noise = max(conditioned.noise_m, conditioned.quantum_m or 0.0)
    if count < 8 or not noise > 0.0:
        return None
    y, blocks = conditioned.track.y, rows[: count * BLOCK].reshape(-1, BLOCK)
    end = median(y[blocks[-max(count // 10, 2) :]].ravel())
    # Of a sensor that counts, distances are whole steps: two of them are two in every unit, however that rounds.
    least = (2.0 + 1e-6) * noise
    # Most bobs move at the end of their record, and the last blocks say so.
    if _away(y[blocks[-4:]], end).max() > least:
        return None
    moving = np.flatnonzero(_away(y[blocks], end) > least)
    # A few blocks that deep noise lifts are no motion: of those before the stop a share must stand off.
    if moving.size < 3 or moving.size < 0.3 * (moving[-1] + 1):
        return None
    return int(blocks[int(moving[-1]) + 2, 0])


def _away(blocks: F8, end: float) -> F8:
    """Median distance of each block's samples from where the record ends, m."""
    # The middle one of an odd number; the library's median takes ten times as long for a few blocks.
    return np.asarray(np.partition(np.abs(blocks - end), BLOCK // 2, axis=1)[:, BLOCK // 2])


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
    names, unit = _fittable(damping), conditioned.track.unit
    if not names or not _required(damping, demodulated, ratio, params, stopped=stopped):
        return None
    periods = demodulated.angular_frequency / (2.0 * math.pi) * float(np.ptp(demodulated.t))
    if ratio <= params.least_damping and periods > params.most_periods:
        return EquationMisfit(
            f"the bob stops within the record, and whether friction stopped it was not settled: over {periods:.0f} "
            f"periods the equation of motion takes too long to solve (at most {params.most_periods}); the averaged "
            "law stands"
        )
    search = Search.of(conditioned, demodulated, damping, names, _stop_row(conditioned), params.clip_sigmas)
    search.clean()
    if math.isinf(search.noise_m):
        return EquationMisfit(
            f"the damping ratio is {ratio:.2g} at the start, where laws of the amplitude err, and no motion with "
            f"{LAWS[search.richest].words} comes near the samples: the averaged law stands"
        )
    if not search.noise_m <= params.misfit * search.expected_m:
        return EquationMisfit(
            f"the damping ratio is {ratio:.2g} at the start, where laws of the amplitude err, and the equation of "
            f"motion with {LAWS[search.richest].words} leaves {amount(search.noise_m, unit)} where samples scatter by "
            f"{amount(search.expected_m, unit)}: the averaged law stands"
        )
    chosen = search.choose(laws)
    if chosen is None:
        return EquationMisfit(f"the damping ratio is {ratio:.2g} at the start, and no fit of the equation converged")
    found = _described(search, *chosen)
    if found.damping.best.rate_at_start() < 0.0:
        return EquationMisfit(
            f"the bob stops within the record, but the equation of motion with {LAWS[found.damping.selected].words} "
            "would let it swing up: no damping ended this motion, and the averaged law stands"
        )
    if not found.damping.squared_rate(demodulated.t) < found.state["angular_frequency"].value ** 2:
        return EquationMisfit(f"{found.why}; so strong a damping leaves no oscillation whose frequency could be given")
    return found


def _fittable(damping: Damping) -> list[str]:
    """Names of the laws to be fitted that have an equation of motion, the richest last."""
    names = [n for n in LAWS if (n in damping.fits or n in damping.unfitted) and isinstance(LAWS[n], Drag)]
    return sorted((n for n in names if n != "none"), key=lambda name: len(LAWS[name].parameters))


def _required(damping: Damping, demodulated: Demodulated, ratio: float, params: Params, *, stopped: bool) -> bool:
    if stopped or ratio > params.always:
        return True
    if damping.selected in ("none", "linear"):
        return False
    last = damping.best.amplitude(np.array([float(np.max(demodulated.t)) - damping.t0]))
    return ratio > params.least_damping or bool(last[0] <= 0.0)


def _described(search: Search, damping: Damping, fit: least_squares.Fit) -> EquationFit:
    """Return the result at every sample."""
    theta = search.full(damping.selected, fit.values)
    every = search.model(np.ones(search.used.size, np.bool_))
    position, velocity = every.position(theta), every.velocity(theta)
    residual = search.conditioned.track.y - position
    rms = math.sqrt(float(np.mean(residual[search.used] ** 2)))
    flags = search.conditioned.flags.copy()
    dropped = search.within & ~search.used
    plateau = dropped & search.conditioned.near_plateau(position, search.noise_m)
    flags[plateau] |= np.uint8(Quality.CLIPPED)
    flags[dropped & ~plateau] |= np.uint8(Quality.FALSE_ECHO)
    count = len(STATE)
    state = Joint(STATE, fit.values[:count], fit.covariance[:count, :count] * search.correlation, STATE_UNITS)
    law, ratio = LAWS[damping.selected].words, damping.best.rate_at_start() / state["angular_frequency"].value
    stops = damping.best.amplitude(np.array([np.max(search.elapsed)]))[0] <= 0.0
    why = (
        f"the damping ratio is {ratio:.2g} at the first sample"
        + (" and friction ends the motion within the record" if stops else "")
        + f": the equation of motion with {law} was fitted to the samples; it leaves "
        + amount(rms, search.conditioned.track.unit)
    )
    return EquationFit(why, damping, state, Waveform(position, partial(np.asarray, velocity), residual, rms), flags)
