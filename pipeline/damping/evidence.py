"""Evidence: what the points say for and against fitted laws, and the choice among them.

Kept by hand: libraries rank models by an information criterion alone, which names a winner though none fits. Here
chi-square on correlated points may reject a law, a coefficient below zero contradicts it, and a law that says the
same as a simpler one is no other answer. The true law is admissible in at least 95 % of simulated records and rejected
in at most 2 % (``tests/trials/test_law_selection.py``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from pipeline.damping.law_fit import LawFit, Minimum, Rejection, joint_of
from pipeline.damping.laws import LAWS, Law
from pipeline.numerics.regression import chi2_quantile
from pipeline.track import F8

__all__ = ["BARE_MENTION", "NEGATIVE", "Weighed", "choose", "least_chi2", "weigh"]

# Difference of BIC below which evidence is "not worth more than a bare mention": Kass and Raftery, J. Am. Stat. Assoc.
# 90 (1995) 773.
BARE_MENTION = 2.0
ALIKE = 0.1  # share of the damping that two laws may differ by and still say the same
SMALLEST_SHARE, LARGEST_SHARE = 0.1, 1.0 / 3.0  # of the first amplitude, to which at most and at least it is compared
# Standard uncertainties below zero at which a coefficient rejects its law: a probability of 0.023 if it is truly zero.
NEGATIVE = 2.0


def least_chi2(fits: Mapping[str, Minimum], laws: Mapping[str, Law] = LAWS) -> dict[str, float]:
    """Each law's chi-square at its best without negative coefficients, which is a special case's or its own."""
    least: dict[str, float] = {}
    for name in sorted(fits, key=lambda name: len(laws[name].parameters)):
        fit = fits[name]
        least[name] = fit.chi2
        if fit.theta.min() < 0.0:
            with np.errstate(divide="ignore", invalid="ignore"):
                below = np.minimum(fit.theta, 0.0) ** 2 / np.diag(fit.covariance)
            cases = [least[case] for case in laws[name].cases if case in least]
            # Without its special cases at hand: what the worst coefficient costs to be zero.
            least[name] = min(cases) if cases else fit.chi2 + float(np.max(below))
    return least


def weigh(law: Law, fit: Minimum, least_chi2: float, points: int, correlation: float, rejection_level: float) -> LawFit:
    """Hold one law's fit to the points.

    Parameters
    ----------
    law : Law
    fit : Minimum
    least_chi2 : float
        As :func:`least_chi2` gives it, for the BIC.
    points : int
    correlation : float
        Points that count as one.
    rejection_level : float
        Probability at which chi-square rejects a law that is true.
    """
    count = len(law.parameters)
    covariance = correlation * fit.covariance
    free = points - count
    dof = max(free / correlation, 1.0) if free > 0 else 0.0
    reduced = fit.chi2 / free if free > 0 else math.nan
    bic = least_chi2 / correlation + count * math.log(max(points / correlation, 2.0))
    rejection: Rejection = ""
    if dof > 0 and reduced * dof > chi2_quantile(1.0 - rejection_level, dof):
        rejection = "misfit"
    elif np.any(fit.theta < -NEGATIVE * np.sqrt(np.diag(covariance))):
        rejection = "negative"
    elif not fit.converged:
        rejection = "not converged"
    return LawFit(law, joint_of(law, fit.theta, covariance), reduced, dof, bic, fit.converged, rejection, fit.tried)


class Weighed(Protocol):
    """A fit that takes part in the choice among laws: of one run, or of several together."""

    @property
    def law(self) -> Law:
        """Which law."""
        ...

    @property
    def bic(self) -> float:
        """Bayesian information criterion."""
        ...

    @property
    def rejection(self) -> str:
        """Why the law is rejected, empty where it is not."""
        ...

    @property
    def rejected(self) -> bool:
        """Whether the points contradict the law."""
        ...

    @property
    def reduced_chi2(self) -> float:
        """Chi-square by degrees of freedom."""
        ...

    def rates(self, amplitude: F8) -> tuple[F8, F8]:
        """Return -dA/dt at amplitudes (n,) m, and its standard uncertainty, m/s."""
        ...


def choose(fits: Mapping[str, Weighed], evidence: float, span: Callable[[str], F8]) -> tuple[str, tuple[str, ...]]:
    """Return the selected law and the admissible ones, best first; of rejected laws the one that fits best.

    Parameters
    ----------
    fits : mapping of str to fit
    evidence : float
        A law whose BIC exceeds the best by more than this is not admissible.
    span : callable
        Gives the greatest and the least amplitude, m, that a law shows over the points.

    Notes
    -----
    A law that holds the selected one as a special case is no other answer where its further coefficient gains it
    nothing (its BIC is higher by more than 2) and where the damping it tells is, with twice its uncertainty, within a
    tenth of the simpler law's at both ends of the span, which is taken to a third of the greatest amplitude where the
    record ends before. It is left out. Where the record cannot exclude a tenth, it stays.
    """
    allowed = [name for name in fits if not fits[name].rejected]
    count = {name: len(fit.law.parameters) for name, fit in fits.items()}
    if not allowed:
        # A law of damping that does not fit is better than one that fits by driving the motion, if any damps.
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
        amplitudes = most * np.array([1.0, min(max(least_m / most, SMALLEST_SHARE), LARGEST_SHARE)])
        alone, _ = best.rates(amplitudes)
        for name in sorted(idle):
            rate, u = fits[name].rates(amplitudes)
            if not np.all(np.abs(rate - alone) + 2.0 * u <= ALIKE * alone):
                idle.remove(name)
    return selected, tuple(name for name in reach if name not in idle)
