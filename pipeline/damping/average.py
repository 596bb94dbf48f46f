"""Averages over laws: amplitude and damping rate where a record cannot tell which law it follows.

Kept by hand: averages by an information criterion alone take a lone term where the other one is there and merely too
small to show, and state an interval that misses it. Here drag between friction and quadratic is one family, its
curvature known beforehand to within what any drag shows, and what the record knows of it takes over as it grows
(``tests/trials/test_law_coverage.py``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.damping.evidence import NEGATIVE
from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import Drag, Law, free_power
from pipeline.damping.select import Damping
from pipeline.track import F8

__all__ = ["Weighted", "average_over_laws", "scaled", "spread_counts"]

SPREAD_OF_POWER = 1.4  # about 1, of the power by which drag grows: friction's 0 and quadratic drag's 2 are well inside
OTHER_LAW = 0.15  # prior odds of a law with friction, or of one that the user made, against linear and quadratic drag
BELOW_LINEAR = 0.03  # the same of a power below 1: nothing that is known to damp grows so slowly, friction aside
APART = 5.0  # how many u rates lie apart where evidence on a power counts half as much again, and not twice
STEEPNESS, FAR = (
    5.0,
    5.0,
)  # of what the spread between laws counts; chosen with those above for the coverage of the intervals


@dataclass(frozen=True, slots=True, eq=False)
class Weighted:
    """A law that takes part in an average.

    Parameters
    ----------
    fit : LawFit
        Parameters and covariance are those to be used.
    weight : float
        All weights add up to 1.
    """

    fit: LawFit
    weight: float


def average_over_laws(damping: Damping, amplitude_m: float) -> tuple[Weighted, ...]:
    """Return the laws by which quantities are stated, the one whose coefficients are stated first.

    A law that the user stated is the only one.

    Parameters
    ----------
    damping : Damping
    amplitude_m : float
        Mean amplitude of the record, m.

    Notes
    -----
    Linear and quadratic drag together hold "none", "linear" and "quadratic"; which of the four is selected says that a
    term does not show, not that it is zero. So unless the recording contradicts it, what is stated is this law's,
    with what is known beforehand: the power :math:`1 + \\beta A/(\\gamma + \\beta A)` by which drag grows is
    :math:`1 \\pm 1.4`, which makes :math:`\\beta = 0 \\pm \\tau` with :math:`\\tau = 1.4\\,\\gamma_l/\\bar A` from the
    lone exponential's rate. The fit alone knows :math:`\\beta` to u; together parameters and covariance are

    .. math:: \\theta = \\theta_l + w\\,(\\theta_{lq} - \\theta_l), \\quad
              C = C_l + w\\,(C_{lq} - C_l), \\quad w = \\frac{\\tau^2}{\\tau^2 + u^2}:

    the exponential's where the record knows no curvature, and with an uncertainty that covers every drag from
    friction to quadratic; those of the fit where it does. The other admissible laws weigh
    :math:`0.15\\,w\\,e^{-\\Delta\\mathrm{BIC}/2}` each against it if they have friction, and a free power, which is as
    likely beforehand, :math:`w\\,e^{-s\\Delta\\mathrm{BIC}/2}`. Wherever it weighs it does so by the probability P that
    it is above 1, :math:`P + 0.03 (1 - P)`: a smaller one stands for friction together with drag, which has
    separate laws, and no recording can distinguish the two. A power has as many parameters as both drags. Where a
    recording distinguishes the two at all, the less likely one is soon left out, or nearly every interval would widen:
    :math:`s = 1 + 1/(1 + (d/5)^4)` for rates at the start that lie d standard uncertainties apart. Far apart s is 1,
    for there the rare record that supports the wrong one would be wrong by as much.

    Both drags take part although a coefficient of their free fit is negative, where none is by more than two standard
    uncertainties once what is known beforehand is in it: a record that knows no curvature gives one drag a negative
    coefficient by chance as often as not.

    Laws that are not rejected and no longer admissible weigh too, for a small weight counts where the rates lie far
    apart; those that only add a term to the selected one do not. Where linear and quadratic drag is out of reach, the
    laws are weighed by their BIC; where chi-square rejects them all, by their BIC over the reduced chi-square of the
    best: the points scatter by so much more than they should, and the nearest is one of several.

    Covariances are multiplied by the reduced chi-square where that is above 1, the scale factor of [1]_: a law between
    two that were fitted is seen in what they leave before it rejects them.

    References
    ----------
    .. [1] Particle Data Group, "Review of Particle Physics", Phys. Rev. D 110 (2024) 030001, section 5.2.2.
    """
    if damping.by_statement:
        return (Weighted(scaled(damping.best), 1.0),)
    if not damping.admissible:
        return _nearest(damping)
    names = damping.admissible
    mixed = damping.of_powers(1, 2)
    if mixed is not None and mixed.rejected and not _allowed_by_prior(mixed, damping.of_powers(1), amplitude_m):
        mixed = None
    stands = mixed is not None and (_in_family(damping.best.law) or mixed.name in names)
    names = (*names, *_far(damping, names))
    evidence: list[tuple[LawFit, float]]  # logarithms of the odds
    if mixed is None or not (stands or free_power(damping.best.law)):
        evidence = [(fit, _belief(fit) - 0.5 * fit.bic) for fit in (damping.fits[name] for name in names)]
    else:
        share, fit = _with_prior(mixed, damping.of_powers(1), amplitude_m)
        evidence = [(fit, -0.5 * mixed.bic)]
        for name in names:
            other = damping.fits[name]
            if not _in_family(other.law) and share > 0.0:
                prior = sharpness = 1.0
                if stands and free_power(other.law):
                    sharpness = _sharpness(other, scaled(fit))
                elif stands:
                    prior = OTHER_LAW
                against = 0.5 * sharpness * (other.bic - mixed.bic)
                evidence.append((other, _belief(other) + math.log(share * prior) - against - 0.5 * mixed.bic))
    # The coefficients of a power or of a function are stated where it is selected; else both drags', within reach.
    first = mixed.name if mixed is not None and stands and isinstance(damping.best.law, Drag) else damping.selected
    evidence.sort(key=lambda one: one[0].name != first)
    most = max(log for _, log in evidence)
    odds = [math.exp(log - most) for _, log in evidence]
    return tuple(Weighted(scaled(fit), odd / sum(odds)) for (fit, _), odd in zip(evidence, odds, strict=True))


def _in_family(law: Law) -> bool:
    """Whether a law is linear and quadratic drag together, or a case of it."""
    return isinstance(law, Drag) and set(law.powers) <= {1, 2}


def _belief(fit: LawFit) -> float:
    """Logarithm of how likely a free power's value is beforehand; 0 of other laws."""
    name = free_power(fit.law)
    if name is None:
        return 0.0
    power = fit.joint[name]
    above = 0.5 * math.erfc((1.0 - power.value) / (math.sqrt(2.0) * max(power.u, 1e-300)))
    return math.log(above + BELOW_LINEAR * (1.0 - above))


def _sharpness(power: LawFit, mixed: LawFit) -> float:
    """By how much the evidence on a power counts more than it says; 1 where the rates at the start lie far apart."""
    rate = mixed.damping_rate()
    apart = abs(power.rate_at_start() - rate.value)
    return 1.0 + 1.0 / (1.0 + (apart / (APART * rate.u)) ** 4) if rate.u > 0.0 else 1.0


def spread_counts(weights: F8, rates: F8, variances: F8) -> float:
    """Return the factor by which the spread of quantities between laws enters their variances.

    Parameters
    ----------
    weights : (k,) float64
        Of the laws; their sum is 1.
    rates, variances : (k,) float64
        Damping rate at the start by each law, 1/s, and its variance: what laws differ in most.

    Notes
    -----
    With the mean own variance :math:`W` and the variance :math:`B = \\sum_i w_i (x_i - x)^2` between laws it is
    :math:`5 \\min(B/W, 1)^5`: hardly anything where laws agree within their own uncertainties, for an
    interval of these holds the neighbours too; and more than all of it where they do not, for then the truth is one
    law's value and not a mean, and the interval has to reach the one that weighs less. With 1 throughout, intervals
    cover the truth too often in the first case and too seldom in the second (``tests/trials/test_law_coverage.py``).
    """
    own, between = float(weights @ variances), float(weights @ (rates - weights @ rates) ** 2)
    if between == 0.0:
        return 0.0
    return FAR * min(between / own, 1.0) ** STEEPNESS if own > 0.0 else FAR


def _far(damping: Damping, names: tuple[str, ...]) -> list[str]:
    """Laws that stand beside the admissible ones: neither rejected nor the selected one with a term more.

    Nor any with a coefficient below zero, whose evidence is that of one of its cases.
    """
    others = {name: fit for name, fit in damping.fits.items() if name not in names and not fit.rejected}
    return [
        name for name, fit in others.items() if damping.selected not in fit.law.cases and fit.joint.values.min() >= 0.0
    ]


def _nearest(damping: Damping) -> tuple[Weighted, ...]:
    """Return the laws that come near where none fits, the selected one first."""
    best = damping.best
    odds = {best.name: 1.0}
    for name, fit in damping.fits.items():
        if name != best.name and fit.rejection == "misfit" and fit.joint.values.min() >= 0.0:
            odds[name] = math.exp(min(0.5 * (best.bic - fit.bic) / max(best.reduced_chi2, 1.0), 0.0))
    total = sum(odds.values())
    return tuple(Weighted(scaled(damping.fits[name]), odd / total) for name, odd in odds.items())


def scaled(fit: LawFit) -> LawFit:
    """Return a fit with its covariance times the reduced chi-square where that exceeds 1 and is not in it already."""
    if not fit.reduced_chi2 > 1.0 or fit.widening != 1.0:
        return fit
    return replace(fit, joint=replace(fit.joint, covariance=fit.reduced_chi2 * fit.joint.covariance))


def _with_prior(mixed: LawFit, linear: LawFit | None, amplitude_m: float) -> tuple[float, LawFit]:
    """The share that the record has in the curvature, and linear and quadratic drag with what is known beforehand."""
    if linear is None:
        return 1.0, mixed
    gamma = linear.joint["gamma"]
    tau = SPREAD_OF_POWER * math.hypot(gamma.value, gamma.u) / amplitude_m
    share = 1.0 / (1.0 + (mixed.joint["beta"].u / tau) ** 2) if tau > 0.0 else 0.0
    values, covariance = np.zeros(3), np.zeros((3, 3))
    # Where chi-square rejects the exponential its covariance was widened: here it is a part of what fits.
    values[:2], covariance[:2, :2] = linear.joint.values, linear.joint.covariance / linear.widening
    joint = replace(
        mixed.joint,
        values=_between(values, mixed.joint.values, share),
        covariance=_between(covariance, mixed.joint.covariance, share),
    )
    return share, replace(mixed, joint=joint)


def _allowed_by_prior(mixed: LawFit, linear: LawFit | None, amplitude_m: float) -> bool:
    """Whether linear and quadratic drag are rejected only for a negative coefficient, which the prior removes."""
    joint = _with_prior(mixed, linear, amplitude_m)[1].joint
    return mixed.rejection == "negative" and bool(
        np.all(joint.values >= -NEGATIVE * np.sqrt(np.diag(joint.covariance)))
    )


def _between(one: F8, other: F8, share: float) -> F8:
    return np.asarray(one + share * (other - one))
