"""Damping: fit every law to the amplitudes, reject those the record contradicts, name those it admits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.damping.evidence import choose, least_chi2, weigh
from pipeline.damping.law_fit import LawFit, Minimum, mean_squared_rate, minimum_of
from pipeline.damping.laws import LAWS, Drag, Law, find_law, free_power
from pipeline.errors import AnalysisError
from pipeline.numerics.regression import Scatter, chi2_quantile, correlation_length, scatter
from pipeline.numerics.robust import mad_sigma
from pipeline.track import F8
from pipeline.windows.demodulate import Demodulated

__all__ = ["Damping", "LawFit", "Params", "fit_damping", "select_law"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`fit_damping`.

    Parameters
    ----------
    rejection : float
        Probability at which chi-square rejects a law that is true.
    evidence : float
        A law whose BIC exceeds the best by more than this is not admissible; 6 is "strong" [1]_.
    laws : tuple of str or Law
        The laws to try: names of :data:`pipeline.damping.laws.LAWS`, or laws of one's own, such as
        :func:`pipeline.damping.laws.of_function.make_law` makes.
    stated : str, Law or None
        The law that the user knows the damping to follow. It is selected whatever the others say of the record, and
        results are stated by it alone; it is tried besides ``laws``, and the record may still contradict it.
    from_scene : bool
        Whether a law that the scene states counts as stated, where none is given here.
    otherwise : tuple of str or Law
        The laws to try where the record rejects all of ``laws``, or knows a curvature of the decay that none of them
        with one term makes, or leaves more than ``doubt`` allows: where few are tried to save time, a wrong one must
        not be stated.
    doubt : float
        Probability at which a record that one of ``laws`` made has ``otherwise`` tried, by its chi-square or by a term
        of linear and quadratic drag below zero.
    loosest_power : float
        Standard uncertainty up to which a free power is stated: known powers lie between 0 and 2.

    References
    ----------
    .. [1] R. E. Kass, A. E. Raftery, "Bayes factors", J. Am. Stat. Assoc. 90 (1995) 773,
       doi:10.1080/01621459.1995.10476572.
    """

    rejection: float = 1e-3
    evidence: float = 6.0
    laws: tuple[str | Law, ...] = tuple(LAWS)
    stated: str | Law | None = None
    from_scene: bool = True
    otherwise: tuple[str | Law, ...] = ()
    doubt: float = 0.01
    loosest_power: float = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Damping:
    """What the amplitudes say about damping.

    Parameters
    ----------
    t0 : float
        Time of the first sample used, s; laws count from here.
    fits : mapping of str to LawFit
        Every law tried that could be fitted.
    selected : str
        The admissible law of lowest BIC; of all laws where every one is rejected. Where BIC differs by less than 2
        ("not worth more than a bare mention") the law with fewer parameters, then the one listed first. A law that was
        stated is selected wherever it could be fitted.
    admissible : tuple of str
        Laws the record does not contradict and whose evidence is within reach of the best, best first; without those
        that repeat a simpler one (:func:`choose`).
    scatter : Scatter
        Of the amplitudes about a smooth curve.
    unfitted : mapping of str to str
        Why a law asked for has no fit.
    stated : str
        Name of the law that the user stated; empty where none was.
    """

    t0: float
    fits: Mapping[str, LawFit]
    selected: str
    admissible: tuple[str, ...]
    scatter: Scatter
    unfitted: Mapping[str, str] = field(default_factory=dict)
    stated: str = ""

    @property
    def by_statement(self) -> bool:
        """Whether the selected law is one that the user stated, and no choice of the record's."""
        return bool(self.stated) and self.selected == self.stated

    @property
    def ahead(self) -> bool:
        """Whether the selected law is clearly ahead: every other law that is admissible needs more coefficients.

        Not of a law without any, nor of one that the record rejects.
        """
        count = len(self.best.law.parameters)
        others = (len(self.fits[name].law.parameters) for name in self.admissible if name != self.selected)
        return count > 1 and self.selected in self.admissible and all(more > count for more in others)

    @property
    def best(self) -> LawFit:
        """The selected law's fit."""
        return self.fits[self.selected]

    @property
    def considered(self) -> Mapping[str, LawFit]:
        """The fits that an average over laws may draw on: the selected one and the admissible ones."""
        return {name: self.fits[name] for name in dict.fromkeys((self.selected, *self.admissible))}

    @property
    def settled(self) -> bool:
        """Whether the selected law is the only admissible one, so that its coefficients mean something."""
        return self.admissible == (self.selected,)

    def of_powers(self, *powers: int) -> LawFit | None:
        """Return the fit of the law whose rate has these powers of the amplitude, each with a coefficient."""
        fits = (fit for fit in self.fits.values() if isinstance(fit.law, Drag) and set(fit.law.powers) == set(powers))
        return next(fits, None)

    def squared_rate(self, t: F8) -> float:
        """Return by how much drag lowers the square of the angular frequency over times t (n,), s, 1/s^2.

        See :func:`pipeline.damping.law_fit.mean_squared_rate`.
        """
        return mean_squared_rate(self.best, self.best.amplitude(t - self.t0))


def fit_damping(demodulated: Demodulated, t0: float, params: Params | None = None) -> Damping:
    """Fit the damping laws to the windows' amplitudes.

    Parameters
    ----------
    demodulated : Demodulated
    t0 : float
        Time of the first sample used, s.
    params : Params, optional

    Returns
    -------
    Damping

    Raises
    ------
    AnalysisError
        If no law can be fitted at all.

    Notes
    -----
    Real amplitudes scatter more than their noise says (beats with a sideways mode, clusters of false echoes).
    The excess is measured against a smooth curve that no law restricts, so that a wrong law cannot hide its misfit
    in it; where friction stops the motion at a corner that no smooth curve follows, a law that leaves less than
    half of it takes the curve's place. Points that are correlated count as fewer: chi-square, BIC and degrees of
    freedom are divided and the covariance is multiplied by the correlation length. The covariance of a law that
    chi-square rejects is by its own residuals: times its reduced chi-square, and with their correlation length.

    Coefficients of drag are not negative, yet their estimates may be by chance, and unbounded estimates are unbiased
    with intervals that hold. So fits are unbounded; a law with a coefficient below zero by more than two standard
    uncertainties is rejected; and the BIC is that of the law's best without negative coefficients, which lies in one
    of its special cases.
    """
    params = params or Params()
    t, amplitude = demodulated.t - t0, demodulated.amplitude
    noise = np.sqrt(demodulated.covariance[:, 0, 0])
    if t.size < 3:
        # One or two points show no law: what the amplitude lost since the start is then its uncertainty.
        noise = np.hypot(noise, amplitude * demodulated.decay * t)
    # Perfect data still carry rounding: without a floor chi-square would divide by nothing.
    noise = np.maximum(noise, 1e-12 * float(np.max(amplitude)) + 1e-100)
    points = _Points(t0, t, amplitude, noise, scatter(t, amplitude, noise))
    found = _fit_laws(points, params.laws, params)
    enough = not params.otherwise or (found.admissible and not _curved(found, params.doubt))
    return found if enough else _fit_laws(points, params.otherwise, params)


def select_law(fits: Mapping[str, LawFit], params: Params, last_s: float) -> tuple[str, tuple[str, ...], str]:
    """Return the selected law, the admissible ones and the stated one, of a record that lasts ``last_s`` seconds.

    A stated law is selected if it has a fit, and then it alone is admissible, or none is where the record rejects it.
    """
    stated = "" if params.stated is None else find_law(params.stated).name
    if stated in fits:
        return stated, () if fits[stated].rejected else (stated,), stated
    ends = np.array([0.0, last_s])
    return *choose(fits, params.evidence, lambda name: fits[name].amplitude(ends)), stated


def _curved(damping: Damping, doubt: float) -> bool:
    """Whether the decay bends as neither linear nor quadratic drag can bend it; other laws may also explain it."""
    mixed, best = damping.of_powers(1, 2), damping.best
    if best is mixed or (best.dof > 0 and best.reduced_chi2 * best.dof > chi2_quantile(1.0 - doubt, best.dof)):
        return True
    if mixed is None:
        return False
    below = math.sqrt(chi2_quantile(1.0 - doubt, 1.0))
    return any(term.value < -below * term.u for term in list(mixed.joint.estimates().values())[1:])


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Amplitudes (n,) at times (n,) since t0, their noise, their scatter, and the laws fitted to them so far."""

    t0: float
    t: F8
    amplitude: F8
    noise: F8
    spread: Scatter
    minima: dict[str, Minimum] = field(default_factory=dict)

    def minimum(self, law: Law) -> Minimum:
        """Return the fit of a law, which is made once."""
        if law.name not in self.minima:
            kept = self.spread.kept
            self.minima[law.name] = minimum_of(law, self.t[kept], self.amplitude[kept], self.spread.u[kept])
        return self.minima[law.name]


def _fit_laws(points: _Points, wanted: Sequence[str | Law], params: Params) -> Damping:
    """Fit some of the laws and choose among them."""
    unfitted: dict[str, str] = {}
    every = [find_law(law) for law in wanted]
    if params.stated is not None and (known := find_law(params.stated)).name not in [law.name for law in every]:
        every.append(known)
    laws = _affordable(every, int(np.count_nonzero(points.spread.kept)), unfitted)
    fits = _weigh_all(laws, points, params, unfitted)
    if fits and (closer := _corner(fits, points)) is not None:
        points = replace(points, spread=closer, minima={})
        fits = _weigh_all(laws, points, params, unfitted)
    if not fits:
        raise AnalysisError("no damping law could be fitted to the amplitudes; see the counts of flagged samples")
    selected, admissible, stated = select_law(fits, params, float(points.t[-1]))
    return Damping(points.t0, fits, selected, admissible, points.spread, unfitted, stated)


def _affordable(wanted: Sequence[Law], points: int, unfitted: dict[str, str]) -> list[Law]:
    laws = []
    for law in wanted:
        needed = len(law.parameters)
        if points >= needed:
            laws.append(law)
        else:
            unfitted[law.name] = f"{needed} parameters need as many windows, and there are {points}"
    return laws


def _weigh_all(laws: Sequence[Law], points: _Points, params: Params, unfitted: dict[str, str]) -> dict[str, LawFit]:
    """Fit the laws; those whose numbers ran out of range, which no law with a chance does, are listed as unfitted."""
    spread = points.spread
    t, y, u = points.t[spread.kept], points.amplitude[spread.kept], spread.u[spread.kept]
    sound = {}
    for law in laws:
        if (why := _astray(law, points.minimum(law), t, y, params.loosest_power)) is None:
            sound[law.name] = points.minimum(law)
            unfitted.pop(law.name, None)
        else:
            unfitted[law.name] = why
    by_name = {law.name: law for law in laws}
    least = least_chi2(sound, by_name)
    weighed = {}
    for name, fit in sound.items():
        weighed[name] = weigh(by_name[name], fit, least[name], y.size, spread.correlation, params.rejection)
        if weighed[name].rejection == "misfit":
            weighed[name] = _widened(weighed[name], (y - weighed[name].amplitude(t)) / u, spread.correlation)
    return weighed


def _widened(fit: LawFit, residual: F8, correlation: float) -> LawFit:
    """Return a law that does not fit with uncertainties by its own residuals: their size and how they hang together."""
    # A law that runs away between its fit's points and these has no residuals to go by.
    own = correlation_length(residual) if np.isfinite(residual).all() else correlation
    widening = fit.reduced_chi2 * max(own / correlation, 1.0)
    return replace(fit, joint=replace(fit.joint, covariance=widening * fit.joint.covariance), widening=widening)


def _astray(law: Law, fit: Minimum, t: F8, y: F8, loosest_power: float) -> str | None:
    """Why a fit's numbers are of no use."""
    top = float(np.max(y))
    if not 1e-3 * top <= fit.theta[0] <= 1e3 * top or not math.isfinite(fit.chi2):
        return "its numbers ran out of range"
    if not np.isfinite(fit.covariance).all():
        return "the windows do not determine its parameters"
    power = free_power(law)
    if power is not None and np.diag(fit.covariance)[list(law.parameters).index(power)] > loosest_power**2:
        return "the windows do not determine its power"
    if fit.theta.min() >= 0.0:
        return None
    # Samples reach half a window beyond the last centre.
    end = t[-1:] + 0.5 * np.max(np.diff(t), initial=0.0)
    with np.errstate(all="ignore"):
        growth = law.rate(y, fit.theta) * (t[-1] - t[0])
        # A growth that outruns the record by e^20 is a fit gone astray, and so is a pole within it.
        astray = np.any(growth > 20.0 * top) or not np.isfinite(law.curve(end, fit.theta)[0][0])
    return "its numbers ran out of range" if astray else None


def _corner(fits: Mapping[str, LawFit], points: _Points) -> Scatter | None:
    """The scatter about a law that follows the points much closer than the smooth curve does, if there is one."""
    fit = min(fits.values(), key=lambda fit: fit.reduced_chi2)
    if points.spread.excess == 0.0 or not fit.reduced_chi2 < 0.25:
        return None
    residual = points.amplitude - fit.amplitude(points.t)
    typical, noise = mad_sigma(residual), float(np.median(points.noise))
    excess = math.sqrt(typical**2 - noise**2) if typical > 1.3 * noise else 0.0
    u = np.hypot(points.noise, excess)
    kept = np.abs(residual) <= 5.0 * u
    if np.count_nonzero(kept) < 0.8 * kept.size:
        return None
    return Scatter(u, excess, kept, correlation_length(residual[kept] / u[kept]))
