"""Averages over laws: amplitude and damping rate if a record cannot show which law it follows.

This is written by hand because an average by an information criterion alone selects a single term if the other term is
too small to detect, and its interval then misses the true value. Here linear and quadratic drag are one family. The
prior for its curvature covers every known drag, from friction to quadratic drag, and the record's own information
outweighs the prior as it grows (``tests/trials/test_law_coverage.py``).
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

SPREAD_OF_POWER = 1.4  # prior u of the power of the drag about 1: 0 of friction and 2 of quadratic drag are well inside
OTHER_LAW = 0.15  # prior odds of a law with friction, or of a user-defined law, against linear and quadratic drag
BELOW_LINEAR = 0.03  # prior odds of a power below 1: no known damping but friction grows so slowly
APART = 5.0  # difference of rates, in standard uncertainties, at which evidence on a power counts 1.5 times, not twice
STEEPNESS, FAR = (
    5.0,
    5.0,
)  # exponent and factor of the spread between laws; chosen, as the values above, for the coverage of the intervals


@dataclass(frozen=True, slots=True, eq=False)
class Weighted:
    """A law that takes part in an average.

    Parameters
    ----------
    fit : LawFit
        The fit with the parameters and the covariance that the average uses.
    weight : float
        Weight of the law; the weights of all laws add up to 1.
    """

    fit: LawFit
    weight: float


def average_over_laws(damping: Damping, amplitude_m: float) -> tuple[Weighted, ...]:
    """Return the laws over which quantities are averaged, first the law whose coefficients are stated.

    If the user stated a law and it is selected, it is the only one.

    Parameters
    ----------
    damping : Damping
    amplitude_m : float
        Mean amplitude of the record, m.

    Notes
    -----
    The law of linear and quadratic drag together contains "none", "linear" and "quadratic" as special cases. If one of
    these is selected, a term was not detected, but it need not be zero. So unless the recording contradicts the law of
    both drags, results are stated by it, with a prior. The prior for the power
    :math:`1 + \\beta A/(\\gamma + \\beta A)` of the drag is :math:`1 \\pm 1.4`. This means
    :math:`\\beta = 0 \\pm \\tau`, with :math:`\\tau = 1.4\\,\\gamma_l/\\bar A` from the rate of the exponential alone.
    If the fit alone determines :math:`\\beta` with the standard uncertainty u, fit and prior together have the
    parameters and the covariance

    .. math:: \\theta = \\theta_l + w\\,(\\theta_{lq} - \\theta_l), \\quad
              C = C_l + w\\,(C_{lq} - C_l), \\quad w = \\frac{\\tau^2}{\\tau^2 + u^2}.

    If the record does not determine the curvature, they are those of the exponential, with an uncertainty that covers
    every drag from friction to quadratic. If it does, they are those of the fit.

    Every other admissible law, one with friction or a user-defined one, has the weight
    :math:`0.15\\,w\\,e^{-\\Delta\\mathrm{BIC}/2}` against the law of both drags. A free power has
    :math:`w\\,e^{-s\\Delta\\mathrm{BIC}/2}`, because its prior probability is as high. The weight of a power is also
    multiplied by :math:`P + 0.03 (1 - P)`, where P is the probability that the power is above 1. A smaller power
    represents friction together with drag, which has separate laws, and no recording can distinguish them. A power has
    as many parameters as both drags. If a recording distinguishes the power from both drags at all, the less likely
    law should soon lose its weight, or nearly every interval would widen. So :math:`s = 1 + 1/(1 + (d/5)^4)` if the
    rates of the two laws at the start are d standard uncertainties apart. If the rates are far apart, s is 1, because
    a rare record that supports the wrong law would then be wrong by as much.

    The law of both drags takes part even if a coefficient of its fit without the prior is negative. The condition is
    that, with the prior, no coefficient is negative by more than two standard uncertainties. If a record does not
    determine the curvature, the fit often gives one drag a negative coefficient by chance.

    Laws that are neither rejected nor admissible take part too, because a small weight counts if the rates are far
    apart. Laws that only add a term to the selected one do not. If the law of both drags cannot be used, the laws are
    weighted by their BIC. If all laws are rejected, the weights use the BIC over the reduced chi-square of the best
    law, because the points scatter by that much more than expected and several laws are about equally near.

    Covariances are multiplied by the reduced chi-square if it is above 1, the scale factor of [1]_. If the true law
    lies between two fitted laws, their residuals grow before chi-square rejects them.

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
    # A selected power or function states its own coefficients; otherwise those of both drags are stated, if possible.
    first = mixed.name if mixed is not None and stands and isinstance(damping.best.law, Drag) else damping.selected
    evidence.sort(key=lambda one: one[0].name != first)
    most = max(log for _, log in evidence)
    odds = [math.exp(log - most) for _, log in evidence]
    return tuple(Weighted(scaled(fit), odd / sum(odds)) for (fit, _), odd in zip(evidence, odds, strict=True))


def _in_family(law: Law) -> bool:
    """Return whether a law is linear and quadratic drag together, or a special case of it."""
    return isinstance(law, Drag) and set(law.powers) <= {1, 2}


def _belief(fit: LawFit) -> float:
    """Return the logarithm of the prior odds of the value of a free power; 0 for other laws."""
    name = free_power(fit.law)
    if name is None:
        return 0.0
    power = fit.joint[name]
    above = 0.5 * math.erfc((1.0 - power.value) / (math.sqrt(2.0) * max(power.u, 1e-300)))
    return math.log(above + BELOW_LINEAR * (1.0 - above))


def _sharpness(power: LawFit, mixed: LawFit) -> float:
    """Return the factor on the evidence for or against a power; 1 if the rates at the start are far apart."""
    rate = mixed.damping_rate()
    apart = abs(power.rate_at_start() - rate.value)
    return 1.0 + 1.0 / (1.0 + (apart / (APART * rate.u)) ** 4) if rate.u > 0.0 else 1.0


def spread_counts(weights: F8, rates: F8, variances: F8) -> float:
    """Return the factor by which the spread of quantities between laws enters their variances.

    Parameters
    ----------
    weights : (k,) float64
        Weights of the laws; their sum is 1.
    rates, variances : (k,) float64
        Damping rate at the start by each law, 1/s, and its variance: the quantity in which laws differ most.

    Notes
    -----
    Let :math:`W` be the mean variance within laws and :math:`B = \\sum_i w_i (x_i - x)^2` the variance between laws.
    The factor is :math:`5 \\min(B/W, 1)^5`. It is nearly 0 if the laws agree within their own uncertainties, because
    their intervals then cover the other laws too. It is above 1 if they disagree, because the true value is then that
    of one law and not the mean, and the interval must include the law with less weight. With a constant factor of 1,
    intervals cover the true value too often in the first case and too seldom in the second
    (``tests/trials/test_law_coverage.py``).
    """
    own, between = float(weights @ variances), float(weights @ (rates - weights @ rates) ** 2)
    if between == 0.0:
        return 0.0
    return FAR * min(between / own, 1.0) ** STEEPNESS if own > 0.0 else FAR


def _far(damping: Damping, names: tuple[str, ...]) -> list[str]:
    """Return the laws that are neither admissible nor rejected, and do not only add a term to the selected law.

    Laws with a negative coefficient are left out too, because their evidence is that of a special case.
    """
    others = {name: fit for name, fit in damping.fits.items() if name not in names and not fit.rejected}
    return [
        name for name, fit in others.items() if damping.selected not in fit.law.cases and fit.joint.values.min() >= 0.0
    ]


def _nearest(damping: Damping) -> tuple[Weighted, ...]:
    """Return the laws nearest to the record if no law fits, the selected one first."""
    best = damping.best
    odds = {best.name: 1.0}
    for name, fit in damping.fits.items():
        if name != best.name and fit.rejection == "misfit" and fit.joint.values.min() >= 0.0:
            odds[name] = math.exp(min(0.5 * (best.bic - fit.bic) / max(best.reduced_chi2, 1.0), 0.0))
    total = sum(odds.values())
    return tuple(Weighted(scaled(damping.fits[name]), odd / total) for name, odd in odds.items())


def scaled(fit: LawFit) -> LawFit:
    """Return a fit, its covariance multiplied by the reduced chi-square if that exceeds 1 and was not applied yet."""
    if not fit.reduced_chi2 > 1.0 or fit.widening != 1.0:
        return fit
    return replace(fit, joint=replace(fit.joint, covariance=fit.reduced_chi2 * fit.joint.covariance))


def _with_prior(mixed: LawFit, linear: LawFit | None, amplitude_m: float) -> tuple[float, LawFit]:
    """Return the weight of the record in the curvature, and the fit of both drags combined with the prior."""
    if linear is None:
        return 1.0, mixed
    gamma = linear.joint["gamma"]
    tau = SPREAD_OF_POWER * math.hypot(gamma.value, gamma.u) / amplitude_m
    share = 1.0 / (1.0 + (mixed.joint["beta"].u / tau) ** 2) if tau > 0.0 else 0.0
    values, covariance = np.zeros(3), np.zeros((3, 3))
    # If chi-square rejected the exponential, its covariance was widened. Here it is part of a law that fits.
    values[:2], covariance[:2, :2] = linear.joint.values, linear.joint.covariance / linear.widening
    joint = replace(
        mixed.joint,
        values=_between(values, mixed.joint.values, share),
        covariance=_between(covariance, mixed.joint.covariance, share),
    )
    return share, replace(mixed, joint=joint)


def _allowed_by_prior(mixed: LawFit, linear: LawFit | None, amplitude_m: float) -> bool:
    """Return whether both drags together are rejected only for a negative coefficient that the prior removes."""
    joint = _with_prior(mixed, linear, amplitude_m)[1].joint
    return mixed.rejection == "negative" and bool(
        np.all(joint.values >= -NEGATIVE * np.sqrt(np.diag(joint.covariance)))
    )


def _between(one: F8, other: F8, share: float) -> F8:
    return np.asarray(one + share * (other - one))
