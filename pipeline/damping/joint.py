"""Joint damping: does one law with one set of coefficients describe several runs?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.damping.evidence import NEGATIVE, choose
from pipeline.damping.law_fit import rates_of
from pipeline.damping.laws import LAWS, Law, in_units, words_of
from pipeline.damping.select import Damping, Params
from pipeline.errors import AnalysisError
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.regression import chi2_quantile, covariance_of
from pipeline.track import F8
from pipeline.windows.demodulate import Demodulated

__all__ = ["JointDamping", "JointFit", "fit_joint"]

Rejection = Literal["", "misfit", "differ", "negative", "not converged"]


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """The fit of one law to all runs, with common coefficients.

    Parameters
    ----------
    law : Law
    coefficients : Joint
        The common coefficients; empty for the law "none".
    amplitudes : tuple of Estimate
        Amplitude at the start of each run, m.
    chi2, dof : float
        Chi-square and degrees of freedom of all runs together, reduced for the correlation between points.
    bic : float
        Bayesian information criterion, up to a constant that is the same for all laws.
    excess_chi2, excess_dof : float
        The increase of chi-square over separate fits of the runs, and the number of coefficients saved.
    rejection : {"", "misfit", "differ", "negative", "not converged"}
        Why the law does not describe all runs, if it does not: chi-square is improbable; each run follows the law but
        the coefficients differ; a parameter is negative by more than two standard uncertainties; the fit did not
        converge.
    """

    law: Law
    coefficients: Joint
    amplitudes: tuple[Estimate, ...]
    chi2: float
    dof: float
    bic: float
    excess_chi2: float
    excess_dof: float
    rejection: Rejection

    @property
    def rejected(self) -> bool:
        """Whether the runs contradict one law with common coefficients."""
        return self.rejection != ""

    @property
    def reduced_chi2(self) -> float:
        """Chi-square over the degrees of freedom."""
        return self.chi2 / self.dof if self.dof > 0 else math.nan

    def rates(self, amplitude: F8) -> tuple[F8, F8]:
        """Return -dA/dt at amplitudes (n,) in m, and its standard uncertainty, both (n,) in m/s."""
        # The rate depends only on the coefficients, so any start amplitude gives the same result.
        theta = np.concatenate([[1.0], self.coefficients.values])
        covariance = np.zeros((theta.size, theta.size))
        covariance[1:, 1:] = self.coefficients.covariance
        return rates_of(self.law, amplitude, theta, covariance)

    def span(self, times: Sequence[F8]) -> F8:
        """Return the largest and the smallest amplitude of all runs, m, at times since the start of each run."""
        ends = [
            self.law.curve(np.array([0.0, float(t[-1])]), np.concatenate([[a.value], self.coefficients.values]))[0]
            for t, a in zip(times, self.amplitudes, strict=True)
        ]
        return np.array([np.max(ends), np.min(ends)])


@dataclass(frozen=True, slots=True, eq=False)
class JointDamping:
    """The damping laws fitted to several runs together, and which of them the runs admit.

    Parameters
    ----------
    runs : tuple of str
        Names of the runs.
    fits : mapping of str to JointFit
    selected : str
        As in :class:`pipeline.damping.select.Damping`.
    admissible : tuple of str
        Laws that describe all runs, from best to worst; empty if none does.
    message : str
        The result in one sentence.
    """

    runs: tuple[str, ...]
    fits: Mapping[str, JointFit]
    selected: str
    admissible: tuple[str, ...]
    message: str

    @property
    def best(self) -> JointFit:
        """The fit of the selected law."""
        return self.fits[self.selected]

    @property
    def one_law(self) -> bool:
        """Whether one law with one set of coefficients describes all runs."""
        return bool(self.admissible)


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """The amplitudes of all runs, concatenated; ``parts`` are the slices of the runs."""

    t: tuple[F8, ...]
    y: F8
    u: F8
    parts: tuple[slice, ...]


def fit_joint(runs: Sequence[tuple[str, Demodulated, Damping]], params: Params | None = None) -> JointDamping:
    """Fit each damping law with coefficients that all runs share and one amplitude for each run.

    Parameters
    ----------
    runs : sequence of (name, Demodulated, Damping)
        At least two runs with the same bob and disc, because the coefficients are inversely proportional to the mass.
    params : Params, optional
        Options of :func:`pipeline.damping.select.fit_damping`. Laws without a fit to every run are left out.

    Returns
    -------
    JointDamping

    Raises
    ------
    AnalysisError
        If fewer than two runs are given, or no law was fitted to every run.

    Notes
    -----
    The points and their uncertainties, including excess scatter, are those of the separate fits. The chi-square of each
    run is divided by its correlation length. The chi-square of the joint fit, less the sum of those of the separate
    fits, tests whether the coefficients of the runs are equal. If they are, the difference follows a chi-square
    distribution whose degrees of freedom are (runs - 1) times the number of coefficients.
    """
    params = params or Params()
    if len(runs) < 2:
        raise AnalysisError(f"a joint fit needs two runs at least, got {len(runs)}")
    laws = {name: fit.law for _, _, damping in runs for name, fit in damping.fits.items()}
    # User-defined laws are always included if they were fitted.
    allowed = {law if isinstance(law, str) else law.name for law in params.laws}
    wanted = [name for name in laws if name in allowed or name not in LAWS]
    shared = [name for name in wanted if all(name in damping.fits for _, _, damping in runs)]
    if not shared:
        raise AnalysisError("no damping law was fitted to every run; a joint fit has nothing to join")
    points = _points(runs)
    fits = {name: _fit(laws[name], runs, points, params) for name in shared}
    # As for one run, a law is left out if the windows do not determine its parameters.
    fits = {name: fit for name, fit in fits.items() if math.isfinite(fit.chi2) and _determined(fit)}
    if not fits:
        raise AnalysisError("no damping law could be fitted to the runs together; fit them one by one")
    ends = points.t
    selected, admissible = choose(fits, params.evidence, lambda name: fits[name].span(ends))
    names = tuple(name for name, _, _ in runs)
    return JointDamping(names, fits, selected, admissible, _message(names, fits, selected, admissible))


def _determined(fit: JointFit) -> bool:
    coefficients = bool(np.isfinite(fit.coefficients.covariance).all())
    return coefficients and all(math.isfinite(amplitude.u) for amplitude in fit.amplitudes)


def _points(runs: Sequence[tuple[str, Demodulated, Damping]]) -> _Points:
    times, values, errors, parts = [], [], [], []
    at = 0
    for _, demodulated, damping in runs:
        spread = damping.scatter
        kept = spread.kept
        times.append((demodulated.t - damping.t0)[kept])
        values.append(demodulated.amplitude[kept])
        # Correlated points count as fewer points, so their uncertainties are increased.
        errors.append(spread.u[kept] * math.sqrt(spread.correlation))
        parts.append(slice(at, at + int(np.count_nonzero(kept))))
        at = parts[-1].stop
    return _Points(tuple(times), np.concatenate(values), np.concatenate(errors), tuple(parts))


def _curve(law: Law, points: _Points, theta: F8) -> F8:
    """Return the amplitudes (n,) of all runs; ``theta`` contains the start amplitudes, then the coefficients."""
    count = len(points.t)
    return np.concatenate([law.curve(t, np.append(theta[run], theta[count:]))[0] for run, t in enumerate(points.t)])


def _slopes(law: Law, points: _Points, theta: F8) -> F8:
    """Return the derivatives (n, p) of the amplitudes of all runs by the parameters."""
    count = len(points.t)
    slopes = np.zeros((points.y.size, theta.size))
    for run, (t, part) in enumerate(zip(points.t, points.parts, strict=True)):
        _, by = law.curve(t, np.append(theta[run], theta[count:]))
        slopes[part, run], slopes[part, count:] = by[:, 0], by[:, 1:]
    return slopes


def _fit(law: Law, runs: Sequence[tuple[str, Demodulated, Damping]], points: _Points, params: Params) -> JointFit:
    count, shared = len(runs), len(law.parameters) - 1
    own = [damping.fits[law.name] for _, _, damping in runs]
    length = float(np.sqrt(np.mean(points.y**2))) or 1.0
    theta = _scaled(law, _start([fit.joint for fit in own]), length, count)
    y, u = points.y / length, points.u / length
    end = least_squares.minimise(
        lambda at: (_curve(law, points, at) - y) / u,
        theta,
        lambda at: _slopes(law, points, at) / u[:, None],
    )
    values = _scaled(law, end.values, 1.0 / length, count)
    with np.errstate(all="ignore"):
        covariance = covariance_of(_slopes(law, points, values) / points.u[:, None])
    chi2 = end.cost
    size = sum(float(t.size) / damping.scatter.correlation for t, (_, _, damping) in zip(points.t, runs, strict=True))
    dof = max(size - values.size, 0.0)
    separate = sum(
        _chi2(fit.reduced_chi2, t.size - len(law.parameters)) / damping.scatter.correlation
        for fit, t, (_, _, damping) in zip(own, points.t, runs, strict=True)
    )
    units = own[0].joint.units
    excess, saved = max(chi2 - separate, 0.0), float((count - 1) * shared)
    deviation = np.sqrt(np.diag(covariance))
    rejection: Rejection = ""
    if dof >= 1.0 and chi2 > chi2_quantile(1.0 - params.rejection, dof):
        rejection = "misfit"
    elif saved and excess > chi2_quantile(1.0 - params.rejection, saved):
        rejection = "differ"
    elif np.any(values < -NEGATIVE * deviation):
        rejection = "negative"
    elif not end.converged:
        rejection = "not converged"
    amplitudes = tuple(
        Estimate(float(a), float(u), units[0]) for a, u in zip(values[:count], deviation[:count], strict=True)
    )
    joint = Joint(tuple(law.parameters)[1:], values[count:], covariance[count:, count:], units[1:])
    bic = chi2 + values.size * math.log(max(size, 2.0))
    return JointFit(law, joint, amplitudes, chi2, dof, bic, excess, saved, rejection)


def _start(joints: Sequence[Joint]) -> F8:
    """Return start values: the amplitudes of the separate fits, and the weighted means of their coefficients."""
    amplitudes = [joint.values[0] for joint in joints]
    coefficients = np.array([joint.values[1:] for joint in joints])
    weights = 1.0 / np.maximum([np.diag(joint.covariance)[1:] for joint in joints], 1e-300)
    return np.concatenate([amplitudes, (coefficients * weights).sum(axis=0) / weights.sum(axis=0)])


def _scaled(law: Law, theta: F8, length_m: float, count: int) -> F8:
    """Return all parameters in units of length of ``length_m`` metres."""
    coefficients = in_units(law, np.concatenate([[1.0], theta[count:]]), length_m=length_m)[1:]
    return np.concatenate([theta[:count] / length_m, coefficients])


def _chi2(reduced: float, free: int) -> float:
    """Return the chi-square of the fit to one run; 0 if no degree of freedom is left."""
    return reduced * free if free > 0 else 0.0


def _message(names: tuple[str, ...], fits: Mapping[str, JointFit], selected: str, admissible: tuple[str, ...]) -> str:
    together, best = ", ".join(names), fits[selected]
    if admissible:
        values = ", ".join(f"{name} = {value}" for name, value in best.coefficients.estimates().items()) or "none"
        rest = f"; {', '.join(admissible[1:])} would do as well" if len(admissible) > 1 else ""
        return f"One damping law holds across {together}: {words_of(best.law)} ({values}){rest}."
    alike = [words_of(fit.law) for fit in fits.values() if fit.rejection == "differ"]
    if alike:
        return f"No common coefficients: {together} each follow {alike[0]}, with different coefficients."
    return f"No one damping law holds across {together}; the least bad is {words_of(best.law)}."
