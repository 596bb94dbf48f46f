"""Evidence: tests of the fitted laws against the points, and the selection among the laws.

This is written by hand because libraries rank models only by an information criterion, which names a winner even if no
model fits. Here chi-square of correlated points may reject a law, and so may a negative coefficient. A law that
predicts the same damping as a simpler one is not admissible. The true law is admissible in at least 95 % of simulated
records and rejected in at most 2 % (``tests/trials/test_law_selection.py``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from pipeline.damping.law_fit import LawFit, Rejection, joint_of
from pipeline.damping.laws import LAWS, Law
from pipeline.numerics.least_squares import Fit
from pipeline.numerics.levels import BARE_MENTION, COVERAGE, FALSE_ALARM, NEGLIGIBLE, normal_quantile
from pipeline.numerics.regression import chi2_quantile
from pipeline.track import F8

# A coefficient this many standard uncertainties below zero rejects its law: probability 0.023 if it is zero.
NEGATIVE = normal_quantile(COVERAGE)


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


def weigh(law: Law, fit: Fit, least_chi2: float, points: int, correlation: float, unit: str) -> LawFit:
    """Test the fit of one law against a number of points, of which ``correlation`` count as one.

    ``least_chi2`` is the law's value from :func:`least_chi2`, for the BIC.
    """
    count = len(law.parameters)
    covariance = correlation * fit.covariance
    free = points - count
    dof = max(free / correlation, 1.0) if free > 0 else 0.0
    reduced = fit.cost / free if free > 0 else math.nan
    bic = least_chi2 / correlation + count * math.log(max(points / correlation, 2.0))
    rejection: Rejection = ""
    if dof > 0 and reduced * dof > chi2_quantile(1.0 - FALSE_ALARM, dof):
        rejection = "misfit"
    elif np.any(fit.values < -NEGATIVE * np.sqrt(np.diag(covariance))):
        rejection = "negative"
    return LawFit(law, joint_of(law, fit.values, covariance, unit), reduced, dof, bic, rejection)


def choose(fits: Mapping[str, LawFit], evidence: float, span: Callable[[str], F8]) -> tuple[str, tuple[str, ...]]:
    """Return the selected law, and the admissible laws from best to worst.

    If all laws are rejected, the law that fits best is selected and no law is admissible.

    A law that contains the selected one as a special case is left out of the admissible laws on two conditions. Its
    further coefficient improves nothing: its BIC is higher by more than 2. Its damping, with twice its uncertainty, is
    within a tenth of the simpler law's at both ends of the span. The lower end of the span is at most a third of the
    largest amplitude, even if the record ends earlier. The law stays if the record cannot exclude a difference of a
    tenth.
    """
    allowed = [name for name in fits if not fits[name].rejected]
    count = {name: len(fit.law.parameters) for name, fit in fits.items()}
    if not allowed:
        # A damping law that does not fit is better than one that fits only because it drives the motion.
        damping = [name for name, fit in fits.items() if fit.rejection != "negative" and count[name] > 1]
        least = min(fits.values(), key=lambda fit: fit.bic).bic
        tolerable = [name for name in damping if fits[name].bic == least]
        return (tolerable or [min(fits, key=lambda name: (fits[name].reduced_chi2, count[name]))])[0], ()
    least = min(fits[name].bic for name in allowed)
    ties = [name for name in allowed if fits[name].bic - least < BARE_MENTION]
    selected = min(ties, key=lambda name: (count[name], list(fits).index(name)))
    best = fits[selected]
    order = sorted(allowed, key=lambda name: (name != selected, fits[name].bic))
    reach = [name for name in order if fits[name].bic - least <= evidence]
    idle = {n for n in reach if selected in fits[n].law.cases and fits[n].bic - best.bic > BARE_MENTION}
    if idle:
        most, least_m = span(selected)
        amplitudes = most * np.array([1.0, min(max(least_m / most, NEGLIGIBLE), 1.0 / 3.0)])
        alone, _ = best.rates(amplitudes)
        for name in sorted(idle):
            rate, u = fits[name].rates(amplitudes)
            if not np.all(np.abs(rate - alone) + 2.0 * u <= NEGLIGIBLE * alone):
                idle.remove(name)
    return selected, tuple(name for name in reach if name not in idle)
