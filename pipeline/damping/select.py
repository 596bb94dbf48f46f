"""Selection of damping laws: fit all laws to the amplitudes and reject those that the record contradicts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.damping.law_fit import NEGATIVE, LawChoice, LawFit, choose, fit_law, least_chi2, weigh, without_beaten
from pipeline.damping.laws import LAWS, Drag, Law, find_law, free_power
from pipeline.errors import AnalysisError
from pipeline.numerics.least_squares import Fit
from pipeline.numerics.levels import OUTLIER
from pipeline.numerics.regression import Scatter, chi2_quantile, correlation_length, scatter
from pipeline.numerics.robust import mad_sigma
from pipeline.track import F8
from pipeline.windows.demodulate import ROUNDING, Windows

FEW_LAWS = ("none", "linear", "quadratic", "linear+quadratic")  # those of the tier "fast"
DOUBT = 0.01  # probability with which a record that follows one of the few laws still causes all to be tried
LOOSEST_POWER = 3.0  # maximum standard uncertainty of a free power that is stated: known powers lie between 0 and 2


@dataclass(frozen=True, slots=True, eq=False)
class Damping:
    """The damping laws fitted to a record, and which of them it admits.

    The selected law is the admissible one with the lowest BIC, or the law that fits best if all are rejected. Among
    differences of BIC below 2 it is the law with fewest parameters. A stated law is always selected if it has a fit.
    """

    t0: float  # time at which the analysed part starts, s; laws count time from here
    fits: Mapping[str, LawFit]  # every law that could be fitted, by name
    selected: str
    # Laws that the record does not contradict and whose BIC is near the lowest, from best to worst, without those that
    # idle: their damping is that of the selected one, with other coefficients.
    admissible: tuple[str, ...]
    scatter: Scatter  # of the amplitudes about a smooth curve
    idle: tuple[str, ...] = ()
    unfitted: Mapping[str, str] = field(default_factory=dict)  # the reason why a law has no fit, by name
    stated: str = ""  # the law that the user stated

    @property
    def by_statement(self) -> bool:
        """Whether the user stated the selected law, so that the record did not select it."""
        return bool(self.stated) and self.selected == self.stated

    @property
    def best(self) -> LawFit:
        """The fit of the selected law."""
        return self.fits[self.selected]

    @property
    def considered(self) -> Mapping[str, LawFit]:
        """The fits of the selected law and of the admissible laws."""
        return {name: self.fits[name] for name in dict.fromkeys((self.selected, *self.admissible))}

    @property
    def growth_rate(self) -> float:
        """The rate of an exponential growth that was admitted, 1/s; 0 for a decay."""
        gamma = self.best.joint["gamma"] if self.settled and self.best is self.of_powers(1) else None
        return -gamma.value if gamma is not None and gamma.value < -NEGATIVE * gamma.u else 0.0

    @property
    def possible(self) -> tuple[str, ...]:
        """The laws whose coefficients the record allows: the admissible ones, and idle ones with more drag of the air.

        A bob in air has linear and quadratic drag, even if the record does not show both, and dry friction only where
        something rubs. Without friction, the average over laws already allows for the other drag of the air.
        """
        law = self.best.law
        rubbed = isinstance(law, Drag) and 0 in law.powers
        return (*self.admissible, *(name for name in self.idle if rubbed))

    @property
    def settled(self) -> bool:
        """Whether the selected law is the only possible one, so that its coefficients are meaningful."""
        return self.possible == (self.selected,)

    def of_powers(self, *powers: int) -> LawFit | None:
        """Return the fit of the law whose rate has exactly these powers of the amplitude; None if it has no fit."""
        fits = (fit for fit in self.fits.values() if isinstance(fit.law, Drag) and set(fit.law.powers) == set(powers))
        return next(fits, None)


NO_LAWS = Damping(math.nan, {}, "", (), Scatter(np.empty(0), 0.0, np.empty(0, np.bool_), 1.0))
"""The damping of a motion that is no oscillation."""


def fit_laws(
    windows: Windows,
    t0: float,
    laws: Sequence[str | Law] = tuple(LAWS),
    stated: str | Law | None = None,
    unit: str = "m",
    *,
    coarse: bool = False,
) -> Damping:
    """Fit the damping laws to the windows' amplitudes; times count from ``t0``.

    A stated law is tried in addition to ``laws`` and selected however well other laws fit; the record may still
    contradict it. An :class:`AnalysisError` says that no law can be fitted.

    Real amplitudes scatter more than their noise, for example because of beats. The excess is measured about a smooth
    curve that is independent of all laws, so that a wrong law cannot hide its misfit in it; where no smooth curve
    follows the decay, a law whose residuals are less than half as large replaces it. Correlated points count as fewer
    points. If chi-square rejects a law, its covariance comes from the size and the correlation length of its own
    residuals.

    ``coarse`` says that rounding to steps larger than the noise makes most of the scatter. It has a pattern, which a
    law that drives the motion may follow better than others; then no such law rejects them.

    Only unbounded estimates of drag coefficients are unbiased and have correct intervals. So the fits are unbounded,
    and a coefficient that is negative by more than two standard uncertainties rejects its law.
    """
    t, amplitude = windows.t - t0, windows.amplitude
    noise = np.sqrt(windows.covariance[:, 0, 0])
    if t.size < 3:
        # One or two points determine no law: the decrease of the amplitude since the start then counts as uncertainty.
        noise = np.hypot(noise, amplitude * windows.decay * t)
    # Even for computed data the windows are not exact.
    noise = np.maximum(noise, ROUNDING * float(np.max(amplitude)) + 1e-100)
    points = _Points(t, amplitude, noise, scatter(t, amplitude, noise), coarse)
    known = None if stated is None else find_law(stated)
    found = _fit_laws(points, t0, laws, known, unit)
    # No wrong law is stated because only a few laws were tried to save time.
    enough = tuple(laws) != FEW_LAWS or (found.admissible and not _curved(found))
    return found if enough else _fit_laws(points, t0, tuple(LAWS), known, unit)


def select_law(fits: Mapping[str, LawFit], known: str, last_s: float) -> LawChoice:
    """Choose among the laws for a record of ``last_s`` seconds; a stated one stands alone."""
    if known in fits:
        return LawChoice(known, () if fits[known].rejected else (known,))
    ends = np.array([0.0, last_s])
    return choose(fits, lambda name: fits[name].amplitude(ends))


def _curved(damping: Damping) -> bool:
    """Return whether the decay has a curvature that neither linear nor quadratic drag explains alone."""
    mixed, best = damping.of_powers(1, 2), damping.best
    if best is mixed or (best.dof > 0 and best.reduced_chi2 * best.dof > chi2_quantile(1.0 - DOUBT, best.dof)):
        return True
    if mixed is None:
        return False
    below = math.sqrt(chi2_quantile(1.0 - DOUBT, 1.0))
    return any(term.value < -below * term.u for term in list(mixed.joint.estimates().values())[1:])


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Amplitudes (n,) at times (n,) since t0, their noise and scatter, and the fits of laws made so far."""

    t: F8
    amplitude: F8
    noise: F8
    spread: Scatter
    coarse: bool  # whether rounding makes most of the scatter
    found: dict[str, Fit] = field(default_factory=dict)

    @property
    def kept(self) -> tuple[F8, F8, F8]:
        """Times, amplitudes and uncertainties of the points that are no outliers."""
        kept = self.spread.kept
        return self.t[kept], self.amplitude[kept], self.spread.u[kept]

    def fit(self, law: Law) -> Fit:
        """Return the fit of a law, which is calculated only once."""
        if law.name not in self.found:
            self.found[law.name] = fit_law(law, *self.kept)
        return self.found[law.name]


def _fit_laws(points: _Points, t0: float, wanted: Sequence[str | Law], known: Law | None, unit: str) -> Damping:
    """Fit some laws and select among them."""
    laws = {law.name: law for law in map(find_law, wanted)}
    if known is not None:
        laws.setdefault(known.name, known)
    fits, unfitted = _weighed(laws, points, unit)
    if fits and (closer := _corner(fits, points)) is not None:
        points = replace(points, spread=closer, found={})
        fits, unfitted = _weighed(laws, points, unit)
    if not fits:
        raise AnalysisError("no damping law could be fitted to the amplitudes", "see the counts of flagged samples")
    fits = _with_growth(fits if points.coarse else without_beaten(fits))
    stated = "" if known is None else known.name
    choice = select_law(fits, stated, float(points.t[-1]))
    return Damping(
        **choice._asdict(),
        t0=t0,
        fits=fits,
        scatter=points.spread,
        unfitted=unfitted,
        stated=stated,
    )


def _with_growth(fits: dict[str, LawFit]) -> dict[str, LawFit]:
    """Admit exponential growth, as of forward Euler, if chi-square allows it and every law is rejected."""
    for name, fit in fits.items():
        exponential = isinstance(fit.law, Drag) and fit.law.powers == (1,)
        if exponential and fit.rejection == "negative" and all(other.rejected for other in fits.values()):
            return {**fits, name: replace(fit, rejection="")}
    return fits


def _weighed(laws: Mapping[str, Law], points: _Points, unit: str) -> tuple[dict[str, LawFit], dict[str, str]]:
    """Fit the laws and test each against the points; return the fits, and why other laws have none."""
    t, y, u = points.kept
    reasons = {name: _astray(law, points) for name, law in laws.items()}
    sound = {name: points.fit(law) for name, law in laws.items() if not reasons[name]}
    least = least_chi2(sound, laws)
    correlation, weighed = points.spread.correlation, {}
    for name, fit in sound.items():
        one = weigh(laws[name], fit, least[name], y.size, correlation, y.size / correlation, unit)
        weighed[name] = _widened(one, (y - one.amplitude(t)) / u, correlation) if one.rejection == "misfit" else one
    return weighed, {name: why for name, why in reasons.items() if why}


def _widened(fit: LawFit, residual: F8, correlation: float) -> LawFit:
    """Return a rejected fit with uncertainties from the size and the correlation length of its residuals."""
    # If the law is not finite at these points, it has no residuals to use.
    own = correlation_length(residual) if np.isfinite(residual).all() else correlation
    widening = fit.reduced_chi2 * max(own / correlation, 1.0)
    return replace(fit, joint=replace(fit.joint, covariance=widening * fit.joint.covariance), widening=widening)


def _astray(law: Law, points: _Points) -> str:
    """Return why a law has no usable fit; empty if it has one."""
    t, y, _ = points.kept
    needed = len(law.parameters)
    if y.size < needed:
        return f"{needed} parameters need as many windows, and there are {y.size}"
    fit, top = points.fit(law), float(np.max(y))
    if not 1e-3 * top <= fit.values[0] <= 1e3 * top or not math.isfinite(fit.cost):
        return "its numbers ran out of range"
    if not fit.converged:
        return f"its search found {fit.tried}"
    power = free_power(law)
    if power is not None and np.diag(fit.covariance)[list(law.parameters).index(power)] > LOOSEST_POWER**2:
        return "the windows do not determine its power"
    if fit.values.min() >= 0.0:
        return ""
    # Samples reach half a window beyond the last centre.
    end = t[-1:] + 0.5 * np.max(np.diff(t), initial=0.0)
    with np.errstate(all="ignore"):
        growth = law.rate(y, fit.values) * (t[-1] - t[0])
        # A fit has failed if its growth rate times the duration exceeds 20 times the largest amplitude, or at a pole.
        astray = np.any(growth > 20.0 * top) or not np.isfinite(law.curve(end, fit.values)[0][0])
    return "its numbers ran out of range" if astray else ""


def _corner(fits: Mapping[str, LawFit], points: _Points) -> Scatter | None:
    """Return the scatter about a law that fits the points much better than the smooth curve; None if none does."""
    fit = min(fits.values(), key=lambda fit: fit.reduced_chi2)
    if points.spread.excess == 0.0 or not fit.reduced_chi2 < 0.25:
        return None
    residual = points.amplitude - fit.amplitude(points.t)
    typical, noise = mad_sigma(residual), float(np.median(points.noise))
    excess = math.sqrt(typical**2 - noise**2) if typical > 1.3 * noise else 0.0
    u = np.hypot(points.noise, excess)
    kept = np.abs(residual) <= OUTLIER * u
    if np.count_nonzero(kept) < 0.8 * kept.size:
        return None
    return Scatter(u, excess, kept, correlation_length(residual[kept] / u[kept]))
