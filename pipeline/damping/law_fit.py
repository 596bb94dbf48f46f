"""The fit of one damping law to one record, its test against the points, and the choice among the laws.

Libraries rank models only by an information criterion, which names a winner even if no model fits. Here chi-square of
correlated points may reject a law, and so may a negative coefficient. A law that predicts the same damping as a simpler
one is not admissible. The true law is admissible in at least 95 % of simulated records and rejected in at most 2 %
(``benchmarks/accuracy``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from pipeline.damping.laws import LAWS, Drag, Law, in_units, units_of
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.least_squares import Fit
from pipeline.numerics.levels import (
    BARE_MENTION,
    COVERAGE,
    FALSE_ALARM,
    NEGLIGIBLE,
    STRONG,
    VERY_STRONG,
    normal_quantile,
)
from pipeline.numerics.regression import chi2_quantile, solve_weighted
from pipeline.track import F8

# "differ": the coefficients of several runs; "beaten": by a law that is rejected as negative
Rejection = Literal["", "misfit", "differ", "negative", "beaten"]
# A coefficient this many standard uncertainties below zero rejects its law: probability 0.023 if it is zero.
NEGATIVE = normal_quantile(COVERAGE)


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """The fit of one law to one record, and its test.

    A law is rejected if chi-square is improbable, if a coefficient is negative by more than two standard uncertainties,
    or if such a law fits better than every other one.
    """

    law: Law
    joint: Joint  # parameters with their covariance; the amplitude at the start is the first one
    reduced_chi2: float  # with noise and excess scatter as uncertainties
    dof: float  # reduced for the correlation between points
    bic: float  # of the best fit without negative coefficients, up to a constant that all laws share
    rejection: Rejection
    widening: float = 1.0  # factor of the covariance because chi-square rejects the law
    beaten_by: str = ""  # name of the law with a negative coefficient that fits better

    @property
    def rejected(self) -> bool:
        """Whether the record contradicts the law."""
        return self.rejection != ""

    @property
    def name(self) -> str:
        """The name of the law."""
        return self.law.name

    @property
    def chi2(self) -> float:
        """Chi-square of points of which the correlation counts several as one."""
        return self.reduced_chi2 * self.dof

    @property
    def limit(self) -> float:
        """The reduced chi-square from which the law is rejected."""
        return chi2_quantile(1.0 - FALSE_ALARM, self.dof) / self.dof

    def drag_term(self, name: str) -> float | None:
        """Return a coefficient of friction ("mu"), linear ("gamma") or quadratic ("beta") drag.

        None if the law lacks the term, or is no sum of such terms, so that its parameter of this name is another
        quantity.
        """
        return self.joint[name].value if isinstance(self.law, Drag) and name in self.joint.names else None

    def amplitude(self, t: F8) -> F8:
        """Return the amplitudes (n,) in m at times (n,) in s since the start."""
        return self.law.curve(t, self.joint.values)[0]

    def u_amplitude(self, t: F8) -> F8:
        """Return the standard uncertainty (n,) of :meth:`amplitude`."""
        return self.u_of(self.law.curve(t, self.joint.values)[1].T)

    def u_of(self, slopes: F8) -> F8:
        """Return the standard uncertainties (n,) of numbers from their derivatives (p, n) by the parameters."""
        variance = np.einsum("in,ij,jn->n", slopes, self.joint.covariance, slopes)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def rates(self, amplitude: F8) -> tuple[F8, F8]:
        """Return -dA/dt at amplitudes (n,) in m, and its standard uncertainty."""
        gradient = self.by_parameters(lambda theta: self.law.rate(amplitude, theta))
        return -self.law.rate(amplitude, self.joint.values), self.u_of(gradient)

    def rate_at_start(self) -> float:
        """Return the damping rate at the start, :math:`-\\dot A/A`, 1/s."""
        return _relative_rate(self.law, self.joint.values)

    def by_parameters(self, f: Callable[[F8], F8 | float]) -> F8:
        """Return the derivatives (p, ...) of a function, with a number or an array as its value, by the parameters."""
        # Central differences with steps of a thousandth of each parameter's uncertainty.
        theta, u = self.joint.values, np.sqrt(np.maximum(np.diag(self.joint.covariance), 0.0))
        steps = np.maximum(1e-3 * u, 1e-7 * np.abs(theta))
        steps = np.where(steps > 0.0, steps, 1e-16)
        shifts = zip(np.diag(steps), steps, strict=True)
        return np.array([(np.asarray(f(theta + d)) - f(theta - d)) / (2.0 * h) for d, h in shifts])

    def slopes_of_rate(self) -> F8:
        """Return the derivatives (p,) of :meth:`rate_at_start` by the parameters."""
        return self.by_parameters(lambda theta: _relative_rate(self.law, theta))

    def damping_rate(self) -> Estimate:
        """Return :meth:`rate_at_start` with its uncertainty."""
        return Estimate(self.rate_at_start(), float(self.u_of(self.slopes_of_rate()[:, None])[0]), "1/s")


def joint_of_law(law: Law, theta: F8, covariance: F8, unit: str) -> Joint:
    """Return a law's parameters (p,) and their covariance with names, and units for a record in a unit."""
    return Joint(tuple(law.parameters), theta, covariance, units_of(law, unit))


def _relative_rate(law: Law, theta: F8) -> float:
    """Return -dA/dt over A at the start, 1/s."""
    return -float(law.rate(theta[:1], theta)[0] / theta[0])


def mean_squared_rate(fit: LawFit, amplitude: F8, weights: F8 | None = None) -> float:
    """Return the mean decrease of the squared angular frequency by drag, 1/s^2, over amplitudes (n,).

    The default weights are the squared amplitudes, as in the fit of a straight line to the phases of windows. The
    decrease is :math:`r r'/A`, where :math:`r(A)` is :math:`-\\dot A` without dry friction: :math:`\\gamma^2` for
    linear drag. Friction moves the rest position of a half-cycle but does not change its duration. Both statements are
    exact. For quadratic drag the exact decrease is 1.85 :math:`(r/A)^2` instead of 2.
    """
    moving = amplitude != 0.0
    amplitude, weights = amplitude[moving], (amplitude**2 if weights is None else weights)[moving]
    if not amplitude.size:
        return 0.0
    theta, step = fit.joint.values, 1e-4 * amplitude
    rate = -fit.law.rate(amplitude, theta) - (fit.drag_term("mu") or 0.0)
    slope = fit.law.rate(amplitude - step, theta) - fit.law.rate(amplitude + step, theta)
    return float(np.sum(weights / amplitude**2 * rate * slope)) / (2e-4 * float(np.sum(weights)))


def fit_law(law: Law, t: F8, y: F8, u: F8) -> Fit:
    """Fit a law to at least as many points as it has parameters, starting from the law's own guess.

    The unit of length in the search is the root mean square of the amplitudes, because in metres the factor of a free
    power is nearly degenerate with it. The result is not finite if the numbers of the law overflowed.
    """
    if len(law.parameters) == 1 and not law.rate(y, y[:1]).any():  # a constant amplitude is a mean and needs no search
        line = solve_weighted(np.ones((t.size, 1)), y, u)
        return Fit(line.values, line.covariance, line.residual / u, line.chi2, True, "")
    length = math.sqrt(float(y @ y) / y.size) or 1.0

    def both(theta: F8) -> tuple[F8, F8]:
        amplitude, by = law.curve(t, theta)
        return (length * amplitude - y) / u, by * (length / u)[:, None]

    search = least_squares.remembering(both)
    fit = least_squares.minimise(lambda x: search(x)[0], law.guess(t, y / length), lambda x: search(x)[1])
    with np.errstate(all="ignore"):
        in_metres = partial(in_units, law, length_m=1.0 / length)
        turn = least_squares.central_differences(in_metres, fit.values)
        return replace(fit, values=in_metres(fit.values), covariance=turn @ fit.covariance @ turn.T)


def least_chi2(fits: Mapping[str, Fit], laws: Mapping[str, Law] = LAWS) -> dict[str, float]:
    """Return the minimum chi-square of each law without negative coefficients: its own or that of a special case."""
    least: dict[str, float] = {}
    for name in sorted(fits, key=lambda name: len(laws[name].parameters)):
        fit = fits[name]
        least[name] = fit.cost
        if fit.values.min() < 0.0:
            with np.errstate(divide="ignore", invalid="ignore"):
                below = np.minimum(fit.values, 0.0) ** 2 / np.diag(fit.covariance)
            cases = [least[case] for case in laws[name].cases if case in least]
            # If no special case was fitted: the increase of chi-square if the most negative coefficient is set to zero.
            least[name] = min(cases) if cases else fit.cost + float(np.max(below))
    return least


def weigh(
    law: Law, fit: Fit, least_chi2: float, points: int, correlation: float, independent: float, unit: str
) -> LawFit:
    """Test the fit of a law against points, of which ``correlation`` count as one.

    ``least_chi2``, and the number of ``independent`` values of the amplitude that a parameter has to explain, are for
    the BIC.
    """
    count = len(law.parameters)
    covariance = correlation * fit.covariance
    free = points - count
    dof = max(free / correlation, 1.0) if free > 0 else 0.0
    reduced = fit.cost / free if free > 0 else math.nan
    bic = least_chi2 / correlation + count * math.log(max(independent, 2.0))
    rejection: Rejection = ""
    if dof > 0 and reduced > chi2_quantile(1.0 - FALSE_ALARM, dof) / dof:
        rejection = "misfit"
    elif np.any(fit.values < -NEGATIVE * np.sqrt(np.diag(covariance))):
        rejection = "negative"
    return LawFit(law, joint_of_law(law, fit.values, covariance, unit), reduced, dof, bic, rejection)


def without_beaten(fits: Mapping[str, LawFit]) -> dict[str, LawFit]:
    """Reject all laws if one with a negative coefficient fits better than each of them: then no law holds.

    A better fit of a law that drives the motion does not support the laws that damp it. Its BIC, with that coefficient,
    must be lower than each of theirs by very strong evidence.
    """
    allowed = [fit.bic for fit in fits.values() if not fit.rejected]
    rivals = {name: _own_bic(fit) for name, fit in fits.items() if fit.rejection == "negative"}
    best = min(rivals, key=lambda name: rivals[name], default="")
    if not allowed or not rivals or not min(allowed) - rivals[best] > VERY_STRONG:
        return dict(fits)
    return {
        name: fit if fit.rejected else replace(fit, rejection="beaten", beaten_by=best) for name, fit in fits.items()
    }


def _own_bic(fit: LawFit) -> float:
    """Return the BIC of a fit with its negative coefficients."""
    count = fit.joint.values.size
    return fit.chi2 + count * math.log(max(fit.dof + count, 2.0))


class LawChoice(NamedTuple):
    """The selected law, the admissible laws from best to worst, and the idle ones, whose damping is a simpler law's."""

    selected: str
    admissible: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()


def choose(fits: Mapping[str, LawFit], span: Callable[[str], F8]) -> LawChoice:
    """Select a law and list the admissible ones; if all are rejected, the nearest is selected and none is admissible.

    A law that contains the selected one as a special case is idle if its BIC is higher by more than 2, and its damping,
    with twice its uncertainty, is within a tenth of the simpler law's at both ends of the span. The lower end is at
    most a third of the largest amplitude, even if the record ends earlier.
    """
    allowed = [name for name in fits if not fits[name].rejected]
    count = {name: len(fit.law.parameters) for name, fit in fits.items()}
    if not allowed:
        # A damping law that does not fit is better than one that fits only because it drives the motion.
        damping = [name for name, fit in fits.items() if fit.rejection != "negative" and count[name] > 1]
        least = min(fits.values(), key=lambda fit: fit.bic).bic
        tolerable = [name for name in damping if fits[name].bic == least]
        return LawChoice((tolerable or [min(fits, key=lambda name: (fits[name].reduced_chi2, count[name]))])[0])
    least = min(fits[name].bic for name in allowed)
    ties = [name for name in allowed if fits[name].bic - least < BARE_MENTION]
    selected = min(ties, key=lambda name: (count[name], list(fits).index(name)))
    best = fits[selected]
    order = sorted(allowed, key=lambda name: (name != selected, fits[name].bic))
    reach = [name for name in order if fits[name].bic - least <= STRONG]
    idle = {n for n in reach if selected in fits[n].law.cases and fits[n].bic - best.bic > BARE_MENTION}
    if idle:
        most, smallest_amplitude = span(selected)
        amplitudes = most * np.array([1.0, min(max(smallest_amplitude / most, NEGLIGIBLE), 1.0 / 3.0)])
        alone, _ = best.rates(amplitudes)
        for name in sorted(idle):
            rate, u = fits[name].rates(amplitudes)
            if not np.all(np.abs(rate - alone) + 2.0 * u <= NEGLIGIBLE * alone):
                idle.remove(name)
    return LawChoice(selected, tuple(n for n in reach if n not in idle), tuple(n for n in reach if n in idle))
