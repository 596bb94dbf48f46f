"""The averaged motion fitted to all samples, started from the fit of the windows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Legendre

from pipeline.damping.law_fit import LawFit, joint_of_law
from pipeline.damping.laws import LAWS, Law
from pipeline.damping.select import Damping
from pipeline.motion.averaged import Averaged, assembled
from pipeline.motion.fit import Rows, clipped, covariance_of, fit
from pipeline.motion.fitted import Oscillation, Phase, RestPosition, wrapped
from pipeline.motion.frequency import amplitude_table, bends_of, turns
from pipeline.notice import Refusal
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import Fit
from pipeline.numerics.levels import BARE_MENTION, ROUNDS, STRONG
from pipeline.numerics.regression import degree_of_curve, solve_weighted
from pipeline.samples.condition import Samples
from pipeline.track import F8, UNUSABLE, Bools, Quality
from pipeline.windows.demodulate import Windows, model_error, with_prior

# Minimum number of windows whose amplitudes can select a law; with fewer the samples do. A law of two
# coefficients has three parameters, so that fewer leave no degree of freedom. With 5, one of 234 recordings changes, as
# measured by `python -m tests.golden --every 3`.
FEW_WINDOWS = 4


@dataclass(frozen=True, slots=True, eq=False)
class _OfLaw:
    """The fit of one law to the samples, with the covariance of its parameters."""

    model: Averaged
    fit: Fit
    covariance: F8
    dof: float


def fit_samples(fitted: Oscillation, samples: Samples) -> Oscillation:
    """Fit rest position, damping law and phase to all samples together.

    ``samples`` include the other modes. Their columns are projected out, so that the record without them gives the
    same fit. A drifting rest position follows a polynomial.
    """
    windows, damping, phase = fitted.windows, fitted.damping, fitted.phase
    few = windows.t.size < FEW_WINDOWS and not damping.by_statement
    laws, thetas = _short(windows, damping) if few else _considered(damping)
    first, *others = laws
    level = fitted.rest.mean.value
    rows = _rows(fitted, samples, level)
    # The lag is that of the windows' law; a law that is tried in its place has its own, which is constant.
    lags = {name: None if few and name in ("none", "linear") else phase.lag for name in laws}
    free = fitted.modes.samples
    last, reach = float(np.max(free.track.t[free.used])), float(np.max(np.abs(rows.t - phase.middle)))
    degree = degree_of_curve(windows.t.size) if fitted.rest.drifts else 0
    model = Averaged(
        law=laws[first],
        t0=phase.t0,
        last=last,
        middle=phase.middle,
        reach=reach,
        degree=degree,
        tables=phase.tables,
        lag=lags[first],
    )
    rest = np.zeros(model.degree + 1)
    if model.degree:
        rest = np.asarray(np.linalg.lstsq(model.rest(windows.t), fitted.rest.at(windows.t) - level, rcond=None)[0])
    start = np.concatenate([thetas[first], phase.coefficients, rest])
    least = float(np.median(model_error(windows.amplitude, windows.decay, windows.angular_frequency)))
    for _ in range(1 if phase.bend is None else 2):
        if phase.bend is not None:  # until the last round the columns of its change belong to other amplitudes
            amplitude = amplitude_table(model.law, model.split(start)[0], model.t0, model.last)
            model = replace(model, tables=bends_of(phase.bend.law, amplitude, model.middle))
        # Few periods cannot tell false echoes from a motion that the model does not describe; the windows' stand.
        scale = {"least": least, "noise": windows.noise}
        found, rows = clipped(model, rows, start, **scale, rounds=1 if few else ROUNDS)
        start = found.values
    if not found.converged:
        return replace(fitted, refused=(Refusal("not_fitted", {"tried": found.tried}),))
    stated, count = samples.track.sigma_m, windows.t.size
    fits = {first: _described(model, found, rows, count, stated)}
    tail = found.values[len(model.law.parameters) :]
    for name in others:
        other = replace(model, law=laws[name], lag=lags[name])
        own = fit(other, rows, np.concatenate([thetas[name], tail]))
        if own.converged:
            fits[name] = _described(other, own, rows, count, stated)
    damping = _selected(damping, fits) if few else _refined(damping, fits)
    best = fits[damping.selected]
    flags = rows.marked(free.flags, free.used, rows.y - rows.left(best.model, best.fit.values))
    return assembled(
        replace(windows, flags=flags),
        fitted.modes,
        damping,
        _phase(phase, windows, best),
        _rest(fitted.rest, best, level, windows.t),
        "samples",
    )


def _considered(damping: Damping) -> tuple[dict[str, Law], dict[str, F8]]:
    """Return laws and start values by name; the selected law first, which decides which samples are false echoes."""
    names = [name for name in (damping.selected, *damping.admissible) if name in damping.fits]
    fits = {name: damping.fits[name] for name in names}
    return {n: x.law for n, x in fits.items()}, {n: x.joint.values for n, x in fits.items()}


def _short(windows: Windows, damping: Damping) -> tuple[dict[str, Law], dict[str, F8]]:
    """Return linear drag and no damping, which are all that a record of few periods can distinguish.

    A stated built-in law is fitted as well, and the laws that fit the windows if linear drag contradicts these.
    """
    amplitude, rate, t = float(windows.amplitude[0]), float(windows.decay[0]), windows.t - damping.t0
    start = amplitude * math.exp(rate * float(t[0]))
    thetas = {"linear": np.array([start, rate]), "none": np.array([amplitude])}
    if damping.stated in LAWS.keys() - thetas.keys():
        thetas[damping.stated] = LAWS[damping.stated].guess(t, windows.amplitude)
    linear = damping.fits.get("linear")
    if linear is not None and linear.rejected:
        others = {n: x for n, x in damping.considered.items() if n in LAWS.keys() - thetas.keys()}
        thetas |= {name: other.joint.values for name, other in others.items()}
    return {name: LAWS[name] for name in thetas}, thetas


def _rows(fitted: Oscillation, samples: Samples, level: float) -> Rows:
    """Return the samples about a level, of which those in clusters of false echoes may not return."""
    free, flags = fitted.modes.samples, fitted.windows.flags
    track = free.track
    known = np.isfinite(track.y) & np.isfinite(track.t)
    usable = free.used
    echo = (flags & np.uint8(Quality.FALSE_ECHO)) != 0
    # Samples excluded by a window's narrow spread or a neighbouring spike may return; those in clusters may not.
    run = np.convolve(echo, np.ones(3), "same") == 3
    cluster = np.convolve(run, np.ones(3), "same") > 0
    others = ((flags & ~np.uint8(Quality.FALSE_ECHO)) | free.track.flags) & UNUSABLE != 0
    candidates = (usable | (echo & ~others)) & ~cluster
    t = np.where(np.isfinite(track.t), track.t, fitted.phase.middle)
    y = np.where(known, track.y, level) - level
    columns = None if fitted.modes.subtracted is None else fitted.modes.columns(samples.track.t)

    def near_plateau(position: F8) -> Bools:
        return free.near_plateau(level + position, fitted.windows.noise)

    used = usable & fitted.windows.used
    return Rows(t=t, y=y, candidates=candidates, used=used, u=1.0, columns=columns, near_plateau=near_plateau)


def _described(model: Averaged, found: Fit, rows: Rows, windows: int, stated: float | None) -> _OfLaw:
    """Return a fit with its covariance; a noise may be stated for its samples."""
    count = found.values.size + (0 if rows.columns is None else rows.columns.shape[1])
    dof = max(float(np.count_nonzero(rows.used) - count), 1.0)
    noise = with_prior(math.sqrt(found.cost / dof), dof, stated)
    return _OfLaw(model, found, covariance_of(found, model, rows, noise, windows), dof)


def _refined(damping: Damping, fits: Mapping[str, _OfLaw]) -> Damping:
    """Return the laws with the parameters of the fits to the samples."""
    changed = {}
    for name, one in fits.items():
        size, unit = len(one.model.law.parameters), damping.fits[name].joint.units[0]
        joint = joint_of_law(one.model.law, one.fit.values[:size], one.covariance[:size, :size], unit)
        changed[name] = replace(damping.fits[name], joint=joint)
    return replace(damping, fits={**damping.fits, **changed})


def _selected(damping: Damping, fits: Mapping[str, _OfLaw]) -> Damping:
    """Select a law by BIC from the logarithm of the residuals, as the noise is unknown, or the stated law."""
    found = {}
    for name in sorted(fits, key=lambda name: len(LAWS[name].parameters)):
        one, law = fits[name], LAWS[name]
        size, count = len(law.parameters), float(one.fit.residual.size)
        joint = joint_of_law(law, one.fit.values[:size], one.covariance[:size, :size], damping.best.joint.units[0])
        bic = count * math.log(max(one.fit.cost, 1e-300) / count) + one.fit.values.size * math.log(count)
        found[name] = LawFit(law, joint, 1.0, one.dof, bic, "")
    least = min(one.bic for one in found.values())
    selected = next(name for name, one in found.items() if one.bic - least < BARE_MENTION)
    admissible = tuple(name for name, one in found.items() if one.bic - least <= STRONG)
    if damping.stated in found:
        selected, admissible = damping.stated, (damping.stated,)
    unfitted = {name: why for name, why in damping.unfitted.items() if name not in found}
    return replace(damping, fits=found, selected=selected, admissible=admissible, idle=(), unfitted=unfitted)


def _phase(phase: Phase, windows: Windows, best: _OfLaw) -> Phase:
    """Return the phase with the values of the fit to the samples; its frequency is again the record's mean."""
    model = best.model
    _, turning, _ = model.split(best.fit.values)
    first = len(model.law.parameters)
    covariance = best.covariance[first : first + turning.size, first : first + turning.size]
    bend = phase.bend
    omega = Estimate(float(turning[1]), math.sqrt(covariance[1, 1]), "rad/s")
    small = phase.small_swings
    if bend is not None:
        bend = replace(bend, tables=model.tables)
        if bend.law.by == "amplitude":
            small = Estimate(omega.value, math.hypot(omega.u, bend.u_choice), "rad/s")
    found = replace(phase, coefficients=turning, bend=bend, lag=model.lag, small_swings=small)
    gradient = found.columns(np.array([phase.t0]))[0]
    if bend is not None:
        u = np.maximum(np.sqrt(windows.covariance[:, 1, 1]), 1e-12)
        line = solve_weighted(turns(windows.t, phase.middle, ()), replace(found, lag=None).total(windows.t), u)
        omega = Estimate(float(line.values[1]), phase.angular_frequency.u, omega.unit)
    at_start = wrapped(float(found.total(np.array([phase.t0]))[0]))
    start = Estimate(at_start, math.sqrt(float(gradient @ covariance @ gradient)), "rad")
    return replace(found, angular_frequency=omega, phase=start)


def _rest(rest: RestPosition, best: _OfLaw, level: float, t: F8) -> RestPosition:
    """Return the constant, or the curve, of the fit to the samples."""
    _, _, still = best.model.split(best.fit.values)
    middle, reach = best.model.middle, best.model.reach
    curve = level + Legendre(still, [middle - reach, middle + reach])
    if best.model.degree:
        return replace(rest, curve=curve.convert(domain=rest.curve.domain), drift=float(np.ptp(curve(t))))
    mean = Estimate(level + float(still[0]), math.sqrt(best.covariance[-1, -1]), rest.mean.unit)
    return replace(rest, mean=mean, curve=curve)
