"""Full fit: one robust least-squares fit of the whole waveform, started from the result of the windows."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.evidence import BARE_MENTION
from pipeline.damping.law_fit import LawFit, joint_of
from pipeline.damping.laws import LAWS, Law, free_power
from pipeline.damping.laws import in_units as in_length_units
from pipeline.damping.select import Damping
from pipeline.motion.phase import PhaseFit, amplitude_integral, wrapped
from pipeline.motion.waveform import Rest, Waveform
from pipeline.motion.waveform_model import Chooser, Record, Rows, State, WaveformModel
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length, solve_weighted
from pipeline.samples.condition import Conditioned
from pipeline.track import F8, UNUSABLE, Quality, Track
from pipeline.windows.demodulate import Demodulated

FEW_WINDOWS = 4  # minimum number of windows whose amplitudes can select a law
# Samples whose residuals exceed this many standard deviations are false echoes and are excluded from the fit.
CLIP_SIGMAS = 4.0
ROUNDS = 5  # maximum number of rounds of clipping and refitting
# Maximum share of the samples that may still enter or leave the fit in the last round. At the limit of 4 sigmas and
# with random signs they move an estimate by 4 sqrt(steady) = 0.04 of its standard uncertainty.
STEADY = 1e-4
STEPS = 25  # maximum number of evaluations of the model in one fit
# Laws that are fitted in addition to the selected and the admissible ones, even if the windows contradict them. The
# default is the single exponential, the usual reference for comparisons.
BESIDES = ("linear",)


@dataclass(frozen=True, slots=True, eq=False)
class FullFit:
    """Results of the fit of the whole waveform, in the form of the stages that it refines.

    Parameters
    ----------
    converged : bool
        Whether the selected law's fit converged. If not, all fields below except ``tried`` come from earlier stages.
    tried : str
        How the selected law's fit ended, worded for a finding.
    damping : Damping
        The selected, the admissible and the linear law with the parameters of the full fit; the other laws unchanged.
    phase : PhaseFit
    rest : Rest
    waveform : Waveform
    flags : (n,) uint8
        The final flags.
    noise_m : float
        Root mean square of the residual over the samples used, m.
    widening : mapping of str to float
        Factor by which each uncertainty exceeds that from white residuals.
    """

    converged: bool
    tried: str
    damping: Damping
    phase: PhaseFit
    rest: Rest
    waveform: Waveform
    flags: NDArray[np.uint8]
    noise_m: float
    widening: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class _Solved:
    """One law fitted to the samples used."""

    record: Record
    state: State
    model: WaveformModel
    rows: Rows
    fit: least_squares.Fit

    @property
    def dof(self) -> float:
        """Number of samples minus number of parameters, linear ones included."""
        return max(float(np.count_nonzero(self.rows) - self.size), 1.0)

    @property
    def size(self) -> int:
        """Number of parameters, linear ones included."""
        return int(self.fit.values.size + self.record.basis.shape[1])

    @property
    def noise_m(self) -> float:
        """Root mean square of the residual, m."""
        return math.sqrt(self.fit.cost / self.dof)

    def amplitude(self) -> F8:
        """Return the amplitude at every sample of the record (n,) in m."""
        return self.state.amplitude(self.record.elapsed)

    @functools.cached_property
    def position(self) -> F8:
        """Distance at every sample of the record minus the record's level, (n,) in m."""
        linear = self.record.basis @ self.model.linear(self.state.values)
        return np.asarray(linear + self.state.position(self.record.elapsed, self.record.tau))


def fit_record(
    conditioned: Conditioned,
    demodulated: Demodulated,
    damping: Damping,
    phase: PhaseFit,
    rest: Rest,
    waveform: Waveform,
    *,
    extra: F8 | None = None,
) -> FullFit:
    """Fit rest position, damping law and phase to all samples together.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated, damping, phase, rest, waveform
        Outputs of the stages with these names: the start values, and the results if the fit fails.
    extra : (n, k) float64, optional
        Columns that enter linearly in addition to the rest position: cosine and sine of a sideways mode, and steps.

    Returns
    -------
    FullFit

    Notes
    -----
    The model is :math:`y = L c + A(t; \\theta) \\cos\\bigl(\\varphi + \\omega\\tau + \\kappa \\int A^2\\bigr)`, where
    :math:`\\tau` is the time from the middle of the record; there frequency and phase are uncorrelated. A drifting
    rest position and further columns enter linearly and are projected out
    (:class:`pipeline.motion.waveform_model.WaveformModel`). A constant rest position is a parameter like the others.

    Samples whose residuals exceed four standard deviations, as estimated from the median absolute deviation, are
    excluded. The fit is repeated until the set of samples no longer changes
    (:class:`pipeline.motion.waveform_model.Chooser`).

    If residuals are not white the covariance is that of the score summed over whole periods, including correlation
    between neighbouring periods, if it exceeds the white covariance significantly.
    """
    record = Record.of(conditioned, demodulated, phase, rest, extra)
    chooser = Chooser(conditioned, demodulated, record, CLIP_SIGMAS)
    area_of = functools.partial(_area, record, damping.best, phase)
    if demodulated.t.size < FEW_WINDOWS and not damping.by_statement:
        phase = replace(phase, lag=None)  # only no damping and linear drag are tried, whose lag is constant
        damping, start = _select_short(record, chooser.by_windows, demodulated, damping, phase)
    else:
        theta = damping.best.joint.values
        area = area_of(theta) if phase.coefficients.size == 3 else None
        start = _state(record, damping.best.law, theta, phase.coefficients, area)
        if phase.lag is not None:
            start = replace(start, lag=(phase.lag[0] - phase.middle, phase.lag[1]))
    solved = _settled(record, chooser, start, area_of)
    if isinstance(solved, str):
        noise_m = demodulated.noise_m
        return FullFit(False, solved, damping, phase, rest, waveform, demodulated.flags, noise_m, {})
    covariance, factors = _covariance(solved, demodulated)
    fits = dict(damping.fits)
    for name in {damping.selected, *damping.admissible, *BESIDES} & fits.keys():
        if name == damping.selected:
            fits[name] = _with_joint(fits[name], solved, covariance)
            continue
        start = solved.state.with_law(fits[name].law, fits[name].joint.values)
        own = _solve(record, start, solved.rows)
        if own.fit.converged:
            fits[name] = _with_joint(fits[name], own, _covariance(own, demodulated)[0])
    damping = replace(damping, fits=fits)
    return FullFit(
        True,
        solved.fit.tried,
        damping,
        _refined_phase(phase, damping, demodulated, solved.state, covariance),
        _refined_rest(solved, rest, phase.middle, covariance),
        _refined_waveform(solved, conditioned.track),
        _flags(conditioned, solved),
        solved.noise_m,
        dict(zip(solved.state.names, factors.tolist(), strict=True)),
    )


def _state(record: Record, law: Law, theta: F8, turning: F8, area: tuple[F8, F8] | None = None) -> State:
    constant = record.order == 0
    return State(law, np.concatenate([theta, turning, [0.0] * constant]), constant, area)


def _area(record: Record, fit: LawFit, phase: PhaseFit, theta: F8) -> tuple[F8, F8]:
    """Return the backbone's column for the parameters ``theta`` of the law."""
    last = phase.t0 + float(record.elapsed.max())
    fit = replace(fit, joint=replace(fit.joint, values=theta))
    return amplitude_integral(fit, phase.t0, phase.middle, phase.t0, last)


def _solve(record: Record, state: State, rows: Rows) -> _Solved:
    model = WaveformModel(record, state, rows)
    if free_power(state.law) is None:
        fit = least_squares.minimise(model.residuals, state.values, model.jacobian, steps=STEPS)
    else:
        fit = _solve_by_amplitude(model, state)
    return _Solved(record, replace(state, values=fit.values), model, rows, fit)


def _solve_by_amplitude(model: WaveformModel, state: State) -> least_squares.Fit:
    """Fit with lengths in units of the first amplitude; in metres a free power and its factor are nearly degenerate."""
    own, count = state.law, state.theta.size
    length = abs(float(state.theta[0])) or 1.0

    def in_units(values: F8, unit_m: float) -> F8:
        return np.concatenate([in_length_units(own, values[:count], length_m=unit_m), values[count:]])

    def in_metres(values: F8) -> F8:
        return in_units(values, 1.0 / length)

    def turn(values: F8) -> F8:
        return least_squares.central_differences(in_metres, values)

    fit = least_squares.minimise(
        lambda at: model.residuals(in_metres(at)),
        in_units(state.values, length),
        lambda at: model.jacobian(in_metres(at)) @ turn(at),
        steps=STEPS,
    )
    covariance = turn(fit.values) @ fit.covariance @ turn(fit.values).T
    return replace(fit, values=in_metres(fit.values), covariance=covariance)


def _settled(record: Record, chooser: Chooser, state: State, area_of: Callable[[F8], tuple[F8, F8]]) -> _Solved | str:
    """Fit repeatedly until the samples that lie on the model no longer change; return a text if that fails."""
    rows, state = chooser.settled(state, chooser.by_windows)
    for _ in range(ROUNDS):
        if np.count_nonzero(rows) < 2 * (state.values.size + record.basis.shape[1]):
            return f"only {np.count_nonzero(rows)} samples lie on the model"
        if state.area is not None:
            # The backbone's column so far belongs to the previous amplitudes.
            state = replace(state, area=area_of(state.theta))
        solved = _solve(record, state, rows)
        if not solved.fit.converged:
            return solved.fit.tried
        chosen = chooser.near(record.y - solved.position, rows)
        if np.count_nonzero(chosen != rows) <= STEADY * rows.size:
            break
        rows, state = chooser.settled(solved.state, chosen)
    return solved


def _select_short(
    record: Record, rows: Rows, demodulated: Demodulated, damping: Damping, phase: PhaseFit
) -> tuple[Damping, State]:
    """Select no damping or linear drag for a record of few periods: fit both to the waveform and compare by BIC."""
    fits: dict[str, LawFit] = {}
    states: dict[str, State] = {}
    amplitude = float(demodulated.amplitude[0])
    rate = float(demodulated.decay[0])
    elapsed = float(demodulated.t[0]) - damping.t0
    starts = {"none": np.array([amplitude]), "linear": np.array([amplitude * math.exp(rate * elapsed), rate])}
    for name, theta in starts.items():
        law = LAWS[name]
        solved = _solve(record, _state(record, law, theta, phase.coefficients[:2]), rows)
        if not solved.fit.converged:
            continue
        states[name] = solved.state
        count = float(np.count_nonzero(rows))
        # The noise is unknown, so that the BIC uses the logarithm of the mean squared residual.
        joint = joint_of(law, solved.state.theta, np.zeros((theta.size, theta.size)))
        bic = count * math.log(max(solved.fit.cost, 1e-300) / count) + solved.size * math.log(count)
        fits[name] = LawFit(law, joint, 1.0, solved.dof, bic, True, "")
    if not fits:
        return damping, solved.state
    least = min(fit.bic for fit in fits.values())
    selected = next(name for name in starts if name in fits and fits[name].bic - least < BARE_MENTION)
    admissible = tuple(name for name in fits if fits[name].bic - least <= 6.0)
    return replace(damping, fits=fits, selected=selected, admissible=admissible), states[selected]


def _covariance(solved: _Solved, demodulated: Demodulated) -> tuple[F8, F8]:
    """Return the covariance of the parameters, and the factors by which non-white residuals widen uncertainties."""
    inverse, u = solved.fit.covariance, np.sqrt(np.diag(solved.fit.covariance)) * solved.noise_m
    factors = np.ones(u.size)
    count = solved.record.tau.size
    period = max(round(count / max(demodulated.t.size, 1)), 1)
    starts = np.arange(0, count, period, dtype=np.int64)
    if starts.size >= 2 * FEW_WINDOWS and np.all(u > 0):
        scores = np.zeros((count, u.size))
        scores[solved.rows] = solved.model.jacobian(solved.state.values) * solved.fit.residual[:, None]
        pulls = np.add.reduceat(scores, starts, axis=0) @ inverse / u
        for k, pull in enumerate(pulls.T):
            squares = pull**2
            ratio = float(squares.sum())
            independent = ratio**2 / max(float(squares @ squares), 1e-300)
            significant = ratio > 1.0 + 3.3 * math.sqrt(2.0 / max(independent, 1.0))
            factors[k] = math.sqrt((ratio if significant else 1.0) * correlation_length(pull))
    return inverse * solved.noise_m**2 * np.outer(factors, factors), factors


def _with_joint(fit: LawFit, solved: _Solved, covariance: F8) -> LawFit:
    law, theta = solved.state.law, solved.state.theta
    joint = joint_of(law, theta, covariance[: theta.size, : theta.size])
    return replace(fit, joint=joint, converged=True)


def _flags(conditioned: Conditioned, solved: _Solved) -> NDArray[np.uint8]:
    """Return the flags, with the samples excluded from the fit flagged as false echoes."""
    flags = conditioned.flags.copy()
    out = ((flags & UNUSABLE) == 0) & ~solved.rows
    flags[out] |= np.uint8(Quality.FALSE_ECHO)
    return flags


def _refined_phase(
    phase: PhaseFit, damping: Damping, demodulated: Demodulated, state: State, covariance: F8
) -> PhaseFit:
    """Return the phase with the full fit's values; the reported frequency is again the record's mean."""
    first = state.theta.size
    covariance = covariance[first : first + state.turning.size, first : first + state.turning.size]
    before = np.array([phase.t0 - phase.middle])
    gradient = np.array([1.0, before[0], 0.0])[: state.turning.size]
    omega = Estimate(float(state.turning[1]), math.sqrt(covariance[1, 1]), "rad/s")
    backbone = None
    if state.area is not None:
        gradient[2] = float(np.interp(before, *state.area)[0])
        backbone = Estimate(float(state.turning[2]), math.sqrt(covariance[2, 2]), "rad/(s m^2)")
        tau = demodulated.t - phase.middle
        u = np.maximum(np.sqrt(demodulated.covariance[:, 1, 1]), 1e-12)
        line = solve_weighted(np.stack([np.ones(tau.size), tau], axis=1), state.steady_angle(tau), u)
        omega = Estimate(float(line.values[1]), phase.angular_frequency.u, "rad/s")
    u_start = math.sqrt(float(gradient @ covariance @ gradient))
    return replace(
        phase,
        angular_frequency=omega,
        phase=Estimate(wrapped(float(state.angle(before)[0])), u_start, "rad"),
        backbone=backbone,
        coefficients=state.turning,
        damping=damping,
    )


def _refined_rest(solved: _Solved, rest: Rest, middle: float, covariance: F8) -> Rest:
    """Return the rest position with the constant or curve of the full fit."""
    if solved.state.constant:
        mean = solved.record.level + float(solved.state.values[-1])
        return replace(rest, mean=Estimate(mean, math.sqrt(covariance[-1, -1]), "m"), curve=np.full(rest.t.size, mean))
    curve = solved.record.curve(rest.t - middle, solved.model.linear(solved.state.values))
    return replace(rest, curve=curve, drift_m=float(np.ptp(curve)))


def _refined_waveform(solved: _Solved, track: Track) -> Waveform:
    """Return the model at every sample; its velocity excludes drift and extra columns."""
    state, amplitude = solved.state, solved.amplitude()
    position = solved.record.level + solved.position
    moving = functools.partial(_velocity, state, amplitude, solved.record.tau)
    return Waveform(position, moving, track.y - position, solved.noise_m)


def _velocity(state: State, amplitude: F8, tau: F8) -> F8:
    angle, rate = state.angle(tau), state.turning[1]
    if state.area is not None:
        rate = rate + state.turning[2] * amplitude**2
    return np.asarray(state.law.rate(amplitude, state.theta) * np.cos(angle) - amplitude * rate * np.sin(angle))
