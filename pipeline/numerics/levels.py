"""Levels: the numbers by which all stages decide, each with its source. A stage states only those of its own physics.

A threshold that follows from a probability is computed where it is used, for example with :func:`normal_quantile`.
"""

from __future__ import annotations

import math
from functools import cache
from statistics import NormalDist

# Probability that a record that follows its model fails a test; it is chosen. A test of n things allows this
# probability over n for each (Bonferroni).
FALSE_ALARM = 1e-3
# Probability of a false alarm of tests that end an analysis or name a cause, although the noise may not be white. If
# two samples count as one, it rises to 5e-4.
IMPROBABLE = 1e-6
# Share of a standard uncertainty, or of any size, below which an effect is negligible. A bias of a tenth of u raises
# the probability that a 95 % interval misses the truth from 5.0 to 5.1 %.
NEGLIGIBLE = 0.1
# Share of the amplitude from which an effect is a warning, although the uncertainties include it. It is chosen:
# the next whole percent above u of the amplitudes of the bundled recordings, 0.6 % as measured by `springmass analyse`.
NOTICEABLE = 0.01
# Ratio of a model's residual to the noise above which the part that the model does not describe is larger than the
# noise, because variances add (ISO/IEC Guide 98-3).
MISFIT = math.sqrt(2.0)
# Standard deviations from which a normal deviate is an outlier: probability 6e-7, so one in two million samples.
OUTLIER = 5.0
# Standard uncertainties by which one pair of values differs significantly: probability 0.3 %.
SIGNIFICANT = 3.0
# Fewest values of which a median ignores one that is wrong; the chance that two of them are is the square of its own.
FEWEST_FOR_MEDIAN = 3
# Fewest points for a straight line and their scatter. Three degrees of freedom remain: with a probability of 14 % they
# appear half as large as they are (chi-square).
FEWEST_FOR_LINE = 5
# Fewest points for a curve of four parameters, such as an amplitude that decays, and their scatter. Four degrees of
# freedom remain: with a probability of 9 % they appear half as large as they are (chi-square).
FEWEST_FOR_CURVE = 8
# Most rounds of a search that usually ends by itself. With ten, two clipped records of `python -m tests.golden` change,
# their amplitudes and damping rates by less than 0.1 u as measured.
ROUNDS = 5
# Differences of BIC from which evidence is worth more than a bare mention, strong, and very strong: R. E. Kass,
# A. E. Raftery, J. Am. Stat. Assoc. 90 (1995) 773.
BARE_MENTION, STRONG, VERY_STRONG = 2.0, 6.0, 10.0
# Magnitude of a number beyond which it is no measured value, and no product of a few leaves the range of doubles, 1e308
# by definition (IEEE 754).
LARGEST = 1e30
# Probability of an upper limit, and weight of a law beside which all others are unlikely; the usual level of a test.
LIMIT = 0.95
# Coverage probability of an expanded uncertainty, with k = 2.00 for many degrees of freedom (EA-4/02 M:2022, annex E).
COVERAGE = 0.9545


def coverage_factor(dof: float) -> float:
    """Return the factor k of an expanded uncertainty: a quantile of Student's t (EA-4/02 M:2022, appendix E).

    >>> round(coverage_factor(math.inf), 2), round(coverage_factor(1), 2)
    (2.0, 13.97)
    """
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.5 * (1.0 + COVERAGE))) if math.isfinite(dof) else normal_quantile(COVERAGE)


@cache
def normal_quantile(share: float) -> float:
    """Return the size below which a share of the absolute values of standard normal deviates lie.

    >>> round(normal_quantile(0.95), 3)
    1.96
    """
    return NormalDist().inv_cdf(0.5 + 0.5 * share)
