"""Full fit: one robust least-squares fit of the whole waveform, from where the windows arrived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.evidence import BARE_MENTION
from pipeline.damping.laws import LAWS
from pipeline.damping.select import Damping, LawFit
from pipeline.motion.phase import PhaseFit, amplitude_integral
from pipeline.motion.rest import Rest
from pipeline.motion.waveform import Waveform
from pipeline.motion.waveform_model import Normal, Record, State, accumulate, scores
from pipeline.motion.waveform_results import refined_phase, refined_rest, refined_waveform
from pipeline.numerics.estimate import Joint
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, UNUSABLE, Quality

__all__ = ["FullFit", "Params", "fit_record"]

FEW_WINDOWS = 4  # below which the amplitudes of windows select no law


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`fit_record`.

    Parameters
    ----------
    clip_sigmas : float
        Residuals beyond this many standard deviations are false echoes and leave the fit.
    rounds : int
        Most rounds of clipping and fitting again.
    steps : int
        Most Gauss-Newton steps of a fit.
    """

    clip_sigmas: float = 4.0
    rounds: int = 5
    steps: int = 25


@dataclass(frozen=True, slots=True, eq=False)
class FullFit:
    """What the whole waveform says, in the form of the stages that it refines.

    Parameters
    ----------
    converged : bool
        Where it is False the stages' own results stand and nothing below but ``steps`` means anything.
    steps : int
        Gauss-Newton steps taken by the selected law's fit.
    damping : Damping
        The laws that were admissible and the linear one, with parameters of the full fit; the others as before.
    phase : PhaseFit
    rest : Rest
    waveform : Waveform
    flags : (n,) uint8
        Final ones.
    noise_m : float
        Root mean square of the residual over the samples used, m.
    widening : mapping of str to float
        By what factor each uncertainty exceeds that of white residuals.
    """

    converged: bool
    steps: int
    damping: Damping
    phase: PhaseFit
    rest: Rest
    waveform: Waveform
    flags: NDArray[np.uint8]
    noise_m: float
    widening: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    state: State
    normal: Normal
    weights: F8
    steps: int
    converged: bool

    @property
    def dof(self) -> float:
        return max(float(np.sum(self.weights)) - self.normal.right.size, 1.0)

    @property
    def noise_m(self) -> float:
        return math.sqrt(self.normal.squares / self.dof)


def fit_record(
    conditioned: Conditioned,
    demodulated: Demodulated,
    damping: Damping,
    phase: PhaseFit,
    rest: Rest,
    waveform: Waveform,
    *,
    extra: F8 | None = None,
    params: Params | None = None,
) -> FullFit:
    """Fit rest position, damping law and phase to all samples at once.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated, damping, phase, rest, waveform
        Outputs of the stages of those names: start values, and what stands if the fit fails.
    extra : (n, k) float64, optional
        Columns that enter linearly beside the rest position: cosine and sine of a sideways mode, steps.
    params : Params, optional

    Returns
    -------
    FullFit

    Notes
    -----
    The model is :math:`y = L c + A(t; \\theta) \\cos\\bigl(\\varphi + \\omega\\tau + \\kappa \\int A^p\\bigr)` with
    time counted from the middle of the record, where frequency and phase are not correlated. Gauss-Newton steps are
    taken in all parameters together; those of the linear columns are exact, which is variable projection [1]_. Steps
    that raise the sum of squares are halved.

    Residuals beyond four standard deviations (from their median) leave, and the fit is repeated until no sample
    changes. Beneath a clipped plateau samples are taken or left by the model, not by their own noise: those that the
    model sees within 3.5 standard deviations of where samples count as clipped are left out, and nothing is biased.

    Where residuals are not white the covariance is that of the sums of score over whole periods, correlation
    between neighbours included, if it exceeds the white one significantly.

    References
    ----------
    .. [1] G. Golub, V. Pereyra, "Separable nonlinear least squares", Inverse Problems 19 (2003) R1,
       doi:10.1088/0266-5611/19/2/201.
    """
    params = params or Params()
    record = _record(conditioned, demodulated, phase, rest, extra)
    base = (conditioned.flags & UNUSABLE) == 0
    weights = (base & ((demodulated.flags & UNUSABLE) == 0)).astype(np.float64)
    if demodulated.t.size < FEW_WINDOWS:
        damping, solved = _select_short(record, weights, demodulated, damping, phase, params)
    else:
        solved = _solve(record, _start(record, damping.best, phase), weights, params)
        if solved.converged and solved.state.area is not None:
            # The backbone's column was the windows' law's: once more with the amplitudes found.
            joint = replace(damping.best.joint, values=solved.state.theta)
            area = _area(record, replace(damping.best, joint=joint), phase)
            solved = _solve(record, replace(solved.state, area=area), weights, params)
    if solved.converged:
        solved = _clipped(record, conditioned, demodulated, solved, base, params)
    if not solved.converged:
        return FullFit(False, solved.steps, damping, phase, rest, waveform, demodulated.flags, demodulated.noise_m, {})
    fits = dict(damping.fits)
    # The one exponential too, for it is what everyone compares with, admissible or not.
    for name in {damping.selected, *damping.admissible, "linear"} & fits.keys():
        own = solved if name == damping.selected else _other_law(record, fits[name], solved, params)
        if own.converged:
            fits[name] = replace(fits[name], joint=_law_joint(record, own, demodulated), converged=True)
    damping = replace(damping, fits=fits)
    return _finish(record, conditioned, demodulated, damping, phase, rest, solved)


def _record(
    conditioned: Conditioned, demodulated: Demodulated, phase: PhaseFit, rest: Rest, extra: F8 | None
) -> Record:
    track = conditioned.track
    known = np.isfinite(track.y) & np.isfinite(track.t)
    t = np.where(np.isfinite(track.t), track.t, phase.middle)
    last = float(np.max(track.t[conditioned.used]))
    level = rest.mean.value
    order = min(6, demodulated.t.size // 4 - 1) if rest.drifts else 0
    columns = np.empty((len(track), 0)) if extra is None else np.asarray(extra, np.float64)
    return Record(
        np.clip(t, phase.t0, last) - phase.t0,
        t - phase.middle,
        np.where(known, track.y, level) - level,
        level,
        order,
        float(np.max(np.abs(t - phase.middle))),
        columns,
    )


def _start(record: Record, fit: LawFit, phase: PhaseFit) -> State:
    area = _area(record, fit, phase) if phase.coefficients.size == 3 else None
    return State(
        fit.law, fit.joint.values.copy(), phase.coefficients.copy(), np.zeros(record.linear_count), area, phase.exponent
    )


def _area(record: Record, fit: LawFit, phase: PhaseFit) -> tuple[F8, F8]:
    last = phase.t0 + float(record.elapsed.max())
    return amplitude_integral(fit, phase.t0, phase.middle, phase.t0, last, phase.exponent)


def _solve(record: Record, state: State, weights: F8, params: Params) -> _Solved:
    """Gauss-Newton to a thousandth of the standard uncertainties."""
    with np.errstate(all="ignore"):
        normal = accumulate(record, state, weights)
    dof = max(float(np.sum(weights)) - normal.right.size, 1.0)
    for taken in range(1, params.steps + 1):
        if not (np.isfinite(normal.matrix).all() and np.isfinite(normal.right).all()):
            return _Solved(state, normal, weights, taken, False)
        step = _pseudo_inverse(normal.matrix) @ normal.right
        expected = float(step @ normal.right)
        if not math.isfinite(expected):
            return _Solved(state, normal, weights, taken, False)
        small = expected <= 1e-6 * normal.squares / dof or expected <= 1e-20 * float(record.y @ record.y)
        for _ in range(8):
            with np.errstate(all="ignore"):
                trial_state = state.moved(step)
                trial = accumulate(record, trial_state, weights)
            if math.isfinite(trial.squares) and trial.squares <= normal.squares * (1.0 + 1e-12):
                state, normal = trial_state, trial
                break
            if small:
                return _Solved(state, normal, weights, taken, True)
            step = 0.5 * step
        else:
            return _Solved(state, normal, weights, taken, False)
        if small:
            return _Solved(state, normal, weights, taken, True)
    return _Solved(state, normal, weights, params.steps, False)


def _pseudo_inverse(matrix: F8) -> F8:
    """Inverse of a normal matrix; directions that the record does not show are left where they are."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    kept = values > 1e-13
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    return np.asarray(inverse / np.outer(scale, scale))


def _clipped(
    record: Record,
    conditioned: Conditioned,
    demodulated: Demodulated,
    solved: _Solved,
    base: NDArray[np.bool_],
    params: Params,
) -> _Solved:
    """Fit again without what lies off the model, until no sample changes."""
    steps = solved.steps
    echo = (demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0
    # Samples that a window's narrow spread or a neighbour's spike put out may come back; those in clusters may not.
    run = np.convolve(echo, np.ones(3), "same") == 3
    cluster = np.convolve(run, np.ones(3), "same") > 0
    told = (conditioned.track.flags & UNUSABLE) != 0
    others = (demodulated.flags & UNUSABLE & ~np.uint8(Quality.FALSE_ECHO)) != 0
    candidates = (base | (echo & ~told & ~others)) & ~cluster
    for _ in range(params.rounds):
        residual = solved.normal.residual
        spread = mad_sigma(residual[candidates])
        kept = candidates & ~conditioned.near_plateau(record.y - residual + record.level, demodulated.noise_m)
        if spread > 1.5 * demodulated.noise_m:
            # What the model leaves is not noise alone: the windows' own verdict on each sample stands.
            kept &= solved.weights > 0
        else:
            kept &= np.abs(residual) <= params.clip_sigmas * spread
        weights = kept.astype(np.float64)
        if np.array_equal(weights, solved.weights):
            break
        if np.count_nonzero(kept) < 2 * solved.normal.right.size:
            return replace(solved, converged=False)
        solved = _solve(record, solved.state, weights, params)
        steps += solved.steps
        if not solved.converged:
            break
    return replace(solved, steps=steps)


def _other_law(record: Record, fit: LawFit, solved: _Solved, params: Params) -> _Solved:
    """Another law, from its own start and the selected one's phase and rest position."""
    state = replace(solved.state, law=fit.law, theta=fit.joint.values.copy())
    return _solve(record, state, solved.weights, params)


def _select_short(
    record: Record, weights: F8, demodulated: Demodulated, damping: Damping, phase: PhaseFit, params: Params
) -> tuple[Damping, _Solved]:
    """A record of so few periods shows damping or none: both are fitted to the waveform, and BIC decides."""
    fits: dict[str, LawFit] = {}
    solutions: dict[str, _Solved] = {}
    amplitude = float(demodulated.amplitude[0])
    rate = float(demodulated.decay[0])
    elapsed = float(demodulated.t[0]) - damping.t0
    starts = {"none": np.array([amplitude]), "linear": np.array([amplitude * math.exp(rate * elapsed), rate])}
    for name, theta in starts.items():
        law = LAWS[name]
        state = State(law, theta, phase.coefficients[:2].copy(), np.zeros(record.linear_count))
        solved = _solve(record, state, weights, params)
        if not solved.converged:
            continue
        solutions[name] = solved
        count = float(np.sum(weights))
        size = solved.normal.right.size
        # Sums of squares are compared at the noise of the fuller model, as a test of chi-square would.
        joint = Joint(law.parameters, solved.state.theta, np.zeros((theta.size, theta.size)), law.units)
        bic = count * math.log(max(solved.normal.squares, 1e-300) / count) + size * math.log(count)
        fits[name] = LawFit(law, joint, 1.0, solved.dof, bic, True, "")
    if not fits:
        return damping, solved
    least = min(fit.bic for fit in fits.values())
    selected = next(name for name in starts if name in fits and fits[name].bic - least < BARE_MENTION)
    admissible = tuple(name for name in fits if fits[name].bic - least <= 6.0)
    return replace(damping, fits=fits, selected=selected, admissible=admissible), solutions[selected]


def _covariance(record: Record, solved: _Solved, demodulated: Demodulated) -> tuple[F8, F8]:
    """Covariance of all parameters, and the factors by which residuals that are not white widened it."""
    inverse = _pseudo_inverse(solved.normal.matrix)
    white = inverse * solved.noise_m**2
    factors = np.ones(white.shape[0])
    period = max(round(record.tau.size / max(demodulated.t.size, 1)), 1)
    starts = np.arange(0, record.tau.size, period, dtype=np.int64)
    u = np.sqrt(np.diag(white))
    if starts.size >= 2 * FEW_WINDOWS and np.all(u > 0):
        pulls = scores(record, solved.state, solved.weights, starts) @ inverse / u
        for k in range(factors.size):
            squares = pulls[:, k] ** 2
            ratio = float(squares.sum())
            independent = ratio**2 / max(float(squares @ squares), 1e-300)
            significant = ratio > 1.0 + 3.3 * math.sqrt(2.0 / max(independent, 1.0))
            factors[k] = math.sqrt((ratio if significant else 1.0) * correlation_length(pulls[:, k]))
    return white * np.outer(factors, factors), factors


def _law_joint(record: Record, solved: _Solved, demodulated: Demodulated) -> Joint:
    law, p = solved.state.law, solved.state.theta.size
    covariance, _ = _covariance(record, solved, demodulated)
    return Joint(law.parameters, solved.state.theta, covariance[:p, :p], law.units)


def _finish(
    record: Record,
    conditioned: Conditioned,
    demodulated: Demodulated,
    damping: Damping,
    phase: PhaseFit,
    rest: Rest,
    solved: _Solved,
) -> FullFit:
    state = solved.state
    covariance, factors = _covariance(record, solved, demodulated)
    p, turns = state.theta.size, state.turning.size
    names = (*state.law.parameters, "phase", "angular_frequency", "backbone")[: p + turns] + tuple(
        f"linear{k}" for k in range(state.linear.size)
    )
    flags = conditioned.flags.copy()
    left = (conditioned.flags & UNUSABLE) == 0
    left &= solved.weights == 0
    crest = left & conditioned.near_plateau(record.y - solved.normal.residual + record.level, demodulated.noise_m)
    flags[crest] |= np.uint8(Quality.CLIPPED)
    flags[left & ~crest] |= np.uint8(Quality.FALSE_ECHO)
    return FullFit(
        True,
        solved.steps,
        damping,
        refined_phase(phase, damping, demodulated, state, covariance[p : p + turns, p : p + turns]),
        refined_rest(record, rest, phase.middle, state.linear, covariance[p + turns :, p + turns :]),
        refined_waveform(record, conditioned.track, state, solved.noise_m),
        flags,
        solved.noise_m,
        dict(zip(names, factors.tolist(), strict=True)),
    )
