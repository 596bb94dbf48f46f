"""Averages over laws: amplitude and damping rate if a record cannot show which law it follows.

An average by an information criterion alone selects a single term if the other term is too small to detect, and its
interval then misses the true value. Here linear and quadratic drag are one family. The prior for its curvature covers
every known drag, from friction to quadratic drag, and the record's own information outweighs the prior as it grows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import Drag, Law
from pipeline.damping.select import Damping

# Prior u of the power of the drag about 1: friction and quadratic drag have 0.77 times the probability of linear drag.
SPREAD_OF_POWER = 1.4
OUTSIDE = 4.0  # BIC added to laws outside the family, which are a seventh as probable beforehand (tests/trials)


@dataclass(frozen=True, slots=True, eq=False)
class Weighted:
    """A law that takes part in an average: the fit as the average uses it, and its weight; all weights add up to 1."""

    fit: LawFit
    weight: float


def average_over_laws(damping: Damping, amplitude: float) -> tuple[Weighted, ...]:
    """Return the laws over which quantities are averaged, first the law whose coefficients are stated.

    A stated law that is selected is the only one. ``amplitude`` is the mean one of the record.

    The law of linear and quadratic drag together contains "none", "linear" and "quadratic" as special cases. If one of
    these is selected, a term was not detected, but it need not be zero. So unless the recording contradicts it, this
    law stands for all of them, with the prior :math:`1 \\pm 1.4` for the power
    :math:`1 + \\beta A/(\\gamma + \\beta A)` of the drag. This means :math:`\\beta = 0 \\pm \\tau`, with
    :math:`\\tau = 1.4\\,\\gamma_l/\\bar A` from the rate of the exponential alone. If the fit determines
    :math:`\\beta` with the standard uncertainty u, fit and prior together have the parameters and the covariance

    .. math:: \\theta = \\theta_l + w\\,(\\theta_{lq} - \\theta_l), \\quad
              C = C_l + w\\,(C_{lq} - C_l), \\quad w = \\frac{\\tau^2}{\\tau^2 + u^2}.

    Every other admissible law takes part with the weight :math:`e^{-(\\mathrm{BIC} + 4)/2}`. Covariances are
    multiplied by the reduced chi-square if it is above 1, the scale factor of the Particle Data Group (Phys. Rev. D 110
    (2024) 030001, section 5.2.2). If all laws are rejected, the weights use the BIC over the reduced chi-square of the
    best law, because the points scatter by that much more than expected and several laws are about equally near.
    """
    if damping.by_statement:
        return (Weighted(scaled(damping.best), 1.0),)
    if not damping.admissible:
        return _nearest(damping)
    mixed = damping.of_powers(1, 2)
    found = [(damping.fits[name], damping.fits[name].bic) for name in damping.admissible]
    first = damping.selected
    if mixed is not None and not mixed.rejected:
        found = [(fit, bic + OUTSIDE) for fit, bic in found if not _in_family(fit.law)]
        found.append((_with_prior(mixed, damping.of_powers(1), amplitude), mixed.bic))
        if _in_family(damping.best.law) or (mixed.name in damping.admissible and isinstance(damping.best.law, Drag)):
            first = mixed.name
    found.sort(key=lambda one: one[0].name != first)
    least = min(bic for _, bic in found)
    odds = [math.exp(-0.5 * (bic - least)) for _, bic in found]
    return tuple(Weighted(scaled(fit), odd / sum(odds)) for (fit, _), odd in zip(found, odds, strict=True))


def _in_family(law: Law) -> bool:
    """Return whether a law is linear and quadratic drag together, or a special case of it."""
    return isinstance(law, Drag) and set(law.powers) <= {1, 2}


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


def _with_prior(mixed: LawFit, linear: LawFit | None, amplitude: float) -> LawFit:
    """Return the fit of both drags combined with the prior."""
    if linear is None:
        return mixed
    gamma = linear.joint["gamma"]
    tau = SPREAD_OF_POWER * math.hypot(gamma.value, gamma.u) / amplitude
    share = 1.0 / (1.0 + (mixed.joint["beta"].u / tau) ** 2) if tau > 0.0 else 0.0
    values, covariance = np.zeros(3), np.zeros((3, 3))
    # If chi-square rejected the exponential, its covariance was widened. Here it is part of a law that fits.
    values[:2], covariance[:2, :2] = linear.joint.values, linear.joint.covariance / linear.widening
    values += share * (mixed.joint.values - values)
    covariance += share * (mixed.joint.covariance - covariance)
    return replace(mixed, joint=replace(mixed.joint, values=values, covariance=covariance))
